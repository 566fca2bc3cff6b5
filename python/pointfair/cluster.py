# SPDX-License-Identifier: Apache-2.0
"""Clouds larger than memory on a Dask cluster: the tasks of `pointfair tile` as tasks of Dask.

    from dask.distributed import Client
    import pointfair.cluster

    client = Client("tcp://scheduler:8786")
    pointfair.cluster.denoise(client, ["a.laz", "b.laz"], output_folder="denoised", work="/scratch/work", memory="14G")

    pointfair cluster tcp://scheduler:8786 a.laz b.laz --out-dir denoised --work /scratch/work --memory 14G

Only names travel over the network: each task is a process of the program, which reads and writes files in the work
folder. The workers and this process must see that folder, and inputs and outputs that are paths, under the same names.
Relative paths are taken from the folder of this process. Inputs and outputs may also be addresses of a store that fsspec
knows, "s3://bucket/a.laz": whole files are then copied into the work folder and out of it, by workers.
"""
from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import json
import os
import posixpath
import shutil
import subprocess
import sys
import tempfile
from importlib import import_module
from typing import Any, Callable, Iterator, Mapping, Sequence

from ._errors import DeviceError, Error, FileError, OutOfMemory, UsageError
from ._program import program_path

_CODES = {2: UsageError, 3: FileError, 4: OutOfMemory, 5: DeviceError}  # of the program, by which this one ends, too
_INTERRUPTED = 130


def _call(program: str, *words: str) -> str:
    """Runs the program and returns what it prints. Raises Error with its own line."""
    done = subprocess.run([program, *words], capture_output=True, text=True)
    if done.returncode != 0:
        said = done.stderr.strip().removeprefix("pointfair: ") or f"pointfair ended with {done.returncode}"
        raise _CODES.get(done.returncode, Error)(said)
    return done.stdout


_NO_MEMORY, _KILLED = 4, -9  # how a task ends that this worker cannot do; -9: mostly by a system that is out of memory


def _run(task: str, program: str, work: str, *words: str) -> tuple[int, str, str]:
    """Does the task. Returns how it ended if another worker should have it, this worker's address, and what was said."""
    done = subprocess.run([program, "tile", "run", work, "--task", task, "--end-with-parent", str(os.getpid()), *words],
                          capture_output=True, text=True)
    said = done.stderr.strip().removeprefix("pointfair: ") or f"{task} ended with {done.returncode}"
    if done.returncode not in (0, _NO_MEMORY, _KILLED):
        raise _CODES.get(done.returncode, Error)(said)
    return done.returncode, import_module("distributed").get_worker().address, said


def _copy(pair: tuple[str, str]) -> None:
    """A whole file from one store to another, under its name only when it is complete."""
    try:
        _copy_file(*pair)
    except Exception as error:  # each store has its own
        raise FileError(f"{pair[0]}: cannot be copied to {pair[1]}: {error}") from None


def _fetch(wanted: tuple[str, str, bool]) -> None:
    """Copies an input into the work folder, with a note of which file it was. A copy of the file as it is now stays; one of
    another is made again, and refused where the run that goes on was planned with it."""
    address, path, is_planned = wanted
    note = os.path.join(os.path.dirname(path), f".copied-{os.path.basename(path)}")
    state = _state_of(address)
    if os.path.exists(path):
        known = None
        if os.path.exists(note):
            with open(note, encoding="utf-8") as file:
                known = file.read()
        if known == state or (known is None and is_planned):  # an older version left no note
            return
        if is_planned:
            raise FileError(f"{address}: has changed since this run was planned; plan it again in another work folder")
    with open(note, "w", encoding="utf-8") as file:  # a copy is there with its note only
        file.write(state)
    _copy((address, path))


def _looked_up(address: str, ask: Callable[[Any, str], Any]) -> Any:
    """What a store says of an address."""
    try:
        return ask(*import_module("fsspec.core").url_to_fs(address))
    except Exception as error:  # each store has its own
        raise FileError(f"{address}: cannot be looked up: {error}") from None


def _state_of(address: str) -> str:
    """What tells a file of a store from another one under its name: the size, and what the store says of its content or time."""
    info = _looked_up(address, lambda files, path: files.info(path))
    names = ("ETag", "etag", "md5Hash", "mtime", "LastModified", "last_modified", "updated", "created")
    return f"{info.get('size')} {next((info[name] for name in names if info.get(name) is not None), '')}"


def _copy_file(source: str, target: str) -> None:
    fsspec: Any = import_module("fsspec")
    if _is_remote(target):
        with fsspec.open(source, "rb") as reader, fsspec.open(target, "wb") as writer:
            shutil.copyfileobj(reader, writer, 1 << 24)
        return
    number, part = tempfile.mkstemp(prefix=os.path.basename(target) + ".part-", dir=os.path.dirname(target))
    try:  # another worker may copy the same
        with fsspec.open(source, "rb") as reader, os.fdopen(number, "wb") as writer:
            shutil.copyfileobj(reader, writer, 1 << 24)
        os.replace(part, target)
    except BaseException:
        os.unlink(part)
        raise


def _refuse_existing(address: str) -> None:
    if _looked_up(address, lambda files, path: files.exists(path)):
        raise FileError(f"{address}: exists already; add --force to replace it")


@contextlib.contextmanager
def _scheduler_lives() -> Iterator[None]:
    """Says in one line that it does not."""
    lost = (asyncio.CancelledError, concurrent.futures.CancelledError, import_module("distributed.comm").CommClosedError)
    try:
        yield
    except lost as error:
        raise Error("the scheduler cannot be reached any more; what is finished is kept: call again with the same work "
                    "folder, on a scheduler that runs") from error


def _allow_failures(dask_scheduler: Any = None) -> None:
    """A worker that dies is held against each task that it had, also those that never began."""
    dask_scheduler.allowed_failures = max(dask_scheduler.allowed_failures, 20)


_SWITCHES = ("force", "strict")  # flags of the program that take no value


def _flags(parameters: Mapping[str, Any]) -> list[str]:
    words = []
    for name, value in parameters.items():
        flag = "--" + name.replace("_", "-")
        if name in _SWITCHES:
            words += [flag] if value else []
            continue
        text = ("on" if value else "off") if isinstance(value, bool) else str(value)
        words += [flag, text]
    return words


def _parameters(words: Sequence[str]) -> dict[str, Any]:
    """Of flags: the other way round."""
    parameters: dict[str, Any] = {}
    left = iter(words)
    for word in left:
        flag, has_value, value = word.partition("=")
        name = flag.removeprefix("--").replace("-", "_")
        if not flag.startswith("--"):
            raise UsageError(f"{word}: is neither a flag nor the value of one; give the inputs before the flags")
        if name in _SWITCHES and not has_value:
            parameters[name] = True
            continue
        text = value if has_value else next(left, None)
        if text is None or name in _SWITCHES:
            raise UsageError(f"{flag}: takes {'no' if name in _SWITCHES else 'a'} value")
        parameters[name] = text
    return parameters


def _is_remote(name: str) -> bool:
    return "://" in name


def _absolute(name: str) -> str:
    return name if _is_remote(name) else os.path.abspath(name)


def _place(name: str) -> str:
    """The same for names of the same file."""
    path = name.removeprefix("file://")
    if not _is_remote(path):
        return os.path.realpath(path)
    store, path = path.split("://", 1)
    return f"{store}://{posixpath.normpath(path)}"


def _output_name(name: str) -> str:
    """As the program writes it into a folder."""
    file = os.path.basename(name)
    octree = ".copc.laz"
    return file[:-len(octree)] + ".laz" if file.lower().endswith(octree) else file


class _Cluster:
    """Calls on the workers, each tried again as the options say."""

    def __init__(self, client: Any, options: dict[str, Any]) -> None:
        self.client, self.options = client, options

    def each(self, function: Any, tasks: Sequence[Any]) -> None:
        futures = self.client.map(function, tasks, **self.options)
        import_module("distributed").wait(futures)
        self.client.gather(futures)  # raises what a task raised

    def run(self, tasks: Sequence[str], *words: str) -> None:
        """The program's tasks. What a worker has no memory for goes to others, until none is left."""
        short: set[str] = set()  # addresses of workers
        killed = dict.fromkeys(tasks, 0)
        asked = dict(zip(self.client.map(_run, tasks, *[[word] * len(tasks) for word in words], **self.options), tasks))
        running = import_module("distributed").as_completed(asked)
        for future in running:
            task = asked.pop(future)
            ended, worker, said = future.result()  # raises what the task raised
            if ended == 0:
                continue
            if ended == _NO_MEMORY:
                short.add(worker)
            killed[task] += ended == _KILLED
            if killed[task] > self.options["retries"]:
                raise OutOfMemory(f"{said}: it was killed {killed[task]} times, as a system does that is out of memory")
            able = set(self.client.nthreads()) - short
            if not able:
                raise OutOfMemory(said)
            others = able - {worker} if ended == _KILLED else able
            again = self.client.submit(_run, task, *words, workers=sorted(others or able), **self.options)
            asked[again] = task
            running.add(again)


class _Job:
    """Which files the program reads and writes, and which are copied: those whose address is not a path."""

    def __init__(self, inputs: Sequence[str], output: str, work: str, into_folder: bool) -> None:
        self.names = [_absolute(name) for name in inputs]
        self.work, self.goal, self.into_folder = work, _absolute(output), into_folder
        folder = os.path.join(work, "inputs")
        self.local = [os.path.join(folder, os.path.basename(name)) if _is_remote(name) else name for name in self.names]
        for number, path in enumerate(self.local):
            if _is_remote(self.names[number]) and path in self.local[:number]:
                raise UsageError(f"{self.names[number]}: two inputs have this name, so their results would be one file; rename one")
        self.goals = [self.goal]
        if into_folder:
            self.goals = [self.goal.rstrip("/") + "/" + _output_name(name) for name in self.names]
        places = set(map(_place, self.names))
        for goal in self.goals:
            if _place(goal) in places:
                raise UsageError(f"{goal}: is input and output at once; name another output")
        os.makedirs(folder if any(map(_is_remote, self.names)) else work, exist_ok=True)

    @property
    def is_planned(self) -> bool:
        """Whether a run goes on."""
        return os.path.exists(os.path.join(self.work, "plan.txt"))

    def fetched(self) -> list[tuple[str, str, bool]]:
        """Inputs to be copied, from where and to where, and whether a run goes on."""
        return [(name, path, self.is_planned) for name, path in zip(self.names, self.local) if name != path]

    def where(self) -> list[str]:
        """The flags that say where the program writes."""
        if not _is_remote(self.goal):
            return ["--out-dir" if self.into_folder else "--out", self.goal]
        folder = os.path.join(self.work, "outputs")
        if self.into_folder:
            return ["--out-dir", folder]
        os.makedirs(folder, exist_ok=True)
        return ["--out", os.path.join(folder, os.path.basename(self.goal))]

    def kept(self) -> list[str]:
        """Addresses where nothing may be yet. Where a run goes on, its own outputs may."""
        return self.goals if _is_remote(self.goal) and not self.is_planned else []

    def sent(self) -> list[tuple[str, str]]:
        """Outputs to be copied, once they are there, from where and to where."""
        if not _is_remote(self.goal):
            return []
        target = self.where()[1]
        if not self.into_folder:
            return [(target, self.goal)]
        files = sorted(file for file in os.listdir(target) if not file.startswith("."))
        return [(os.path.join(target, file), self.goal.rstrip("/") + "/" + file) for file in files]


def denoise(client: Any, inputs: Sequence[str] | str, output: str | None = None, *, work: str,
            output_folder: str | None = None, memory: str = "4G", tiles: int = 1, threads: int = 0,
            device: str = "auto", resources: Mapping[str, float] | None = None, retries: int = 3,
            program: str | None = None, **parameters: Any) -> dict[str, Any]:
    """Denoises clouds on a Dask cluster; the bits are those of one run in memory. Finished tasks of the same job that
    lie in `work` are not done again.

    Args:
        client: a distributed.Client of the cluster.
        inputs: files, which together are one cloud: paths that every worker sees, or addresses that fsspec knows.
        output: the file to write, if there is one input.
        work: a folder that every worker sees; it stays.
        output_folder: in place of `output`: each input is written there under its name.
        memory: memory that one task may take, as `--memory`. A worker with n threads runs n tasks at once.
        tiles: the least number of tiles.
        threads: CPU threads of each task; 0: all cores of its machine.
        device: device of each task, as `--device`.
        resources: the part of a worker's resources that each task takes, {"GPU": 1} for instance. Only workers that
            declare that much get tasks.
        retries: how often a task that failed is tried again.
        program: path of the program on the workers; None: that of this package.
        **parameters: as the flags of `pointfair tile plan`: k=8, noise="3mm", force=True.

    Returns:
        The report, as `pointfair tile merge --report`.

    Raises:
        Error: with the line that the program said, UsageError, FileError, OutOfMemory or DeviceError where that is its kind;
            and if the scheduler is lost.
    """
    if output is None and output_folder is None:
        raise UsageError("denoise needs an output, or an output_folder")
    tool = program or program_path()
    job = _Job([inputs] if isinstance(inputs, str) else inputs, output_folder or output or "", os.path.abspath(work),
               output_folder is not None)
    cluster = _Cluster(client, {"pure": False, "retries": retries, "resources": dict(resources or {})})
    run_words = ["--threads", str(threads), "--device", device, "-q"]
    with _scheduler_lives():
        client.run_on_scheduler(_allow_failures)
        cluster.each(_refuse_existing, [] if parameters.get("force") else job.kept())
        cluster.each(_fetch, job.fetched())
        client.submit(_call, tool, "tile", "plan", *job.local, *job.where(), "--work", job.work, "--memory", memory,
                      "--tiles", str(tiles), *_flags(parameters), **cluster.options).result()
        for step in json.loads(_call(tool, "tile", "status", job.work, "--report", "-"))["steps"]:
            if step["done"] < step["tasks"]:
                cluster.run([f"{step['step']}:{number}" for number in range(step["tasks"])], tool, job.work, *run_words)
        report: dict[str, Any] = json.loads(_call(tool, "tile", "merge", job.work, "-q", "--report", "-"))
        cluster.each(_copy, job.sent())
    return report


def main(words: Sequence[str]) -> int:
    """`pointfair cluster SCHEDULER IN... --out OUT --work DIR [flags of pointfair tile plan]`"""
    import argparse

    parser = argparse.ArgumentParser(prog="pointfair cluster", description="Denoise on a Dask cluster.")
    parser.add_argument("scheduler", help="its address, tcp://host:8786")
    parser.add_argument("inputs", nargs="+")
    parser.add_argument("--out")
    parser.add_argument("--out-dir")
    parser.add_argument("--work", required=True)
    parser.add_argument("--memory", default="4G")
    parser.add_argument("--tiles", type=int, default=1)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--device", default="auto")
    parser.add_argument("--retries", type=int, default=3)
    parser.add_argument("--program", help="where the workers have the program")
    given, rest = parser.parse_known_args(words)
    try:
        parameters = _parameters(rest)
        try:
            client = import_module("distributed").Client(given.scheduler)
        except OSError as error:
            raise Error(f"{given.scheduler}: the scheduler cannot be reached: {error}") from error
        with client:
            report = denoise(client, given.inputs, given.out, work=given.work, output_folder=given.out_dir,
                             memory=given.memory, tiles=given.tiles, threads=given.threads, device=given.device,
                             retries=given.retries, program=given.program, **parameters)
    except Error as error:
        print(f"pointfair: {error}", file=sys.stderr)
        return next((code for code, kind in _CODES.items() if isinstance(error, kind)), 1)
    except KeyboardInterrupt:
        print("pointfair: interrupted; what is finished is kept: call again with the same work folder", file=sys.stderr)
        return _INTERRUPTED
    print(json.dumps(report, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
