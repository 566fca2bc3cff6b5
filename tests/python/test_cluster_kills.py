# SPDX-License-Identifier: Apache-2.0
"""Whatever is killed of a Dask cluster, the result has the bits of the run in memory, and what is finished stays.

POINTFAIR_KILLS=50 kills so often (unset: 4); POINTFAIR_SEED=N at other moments."""
import os
import random
import shutil
import signal
import stat
import subprocess
import time

import pytest

pytest.importorskip("distributed")
pytest.importorskip("fsspec")

from dask_processes import PROGRAM, Cluster, write_cloud  # noqa: E402

KILLS = int(os.environ.get("POINTFAIR_KILLS", 4))
SEED = int(os.environ.get("POINTFAIR_SEED", 1))
TASKS = {f"{step}-{task:05}" for step in ("tile-1", "tile-2") for task in range(9)} | {"chunk-00000", "measured", "written-00000"}


@pytest.fixture
def source(tmp_path):
    path = write_cloud(tmp_path / "in.ply")
    subprocess.run([PROGRAM, "run", path, tmp_path / "whole.ply", "-q"], check=True)
    return path


def finished(work):
    """What tasks left, with what tells a file from another one under its name."""
    marks = {}
    for entry in work.iterdir() if work.exists() else ():
        if entry.name in TASKS:
            marks[entry.name] = (entry.stat().st_ino, entry.stat().st_mtime_ns)
    return marks


def unfinished(folder):
    return [name for name in os.listdir(folder) if name.startswith(".")]


def expect_nothing_unfinished(work):
    """A task that is killed while it waits for the disk ends a little later; the next use of the folder removes its file."""
    end = time.monotonic() + 30
    for name in unfinished(work):
        while os.path.exists(f"/proc/{name.split('-')[-2]}") and time.monotonic() < end:
            time.sleep(0.1)
    subprocess.run([PROGRAM, "tile", "status", work, "--report", "-"], check=True, capture_output=True)
    assert unfinished(work) == []


def expect_the_bits(folder):
    assert (folder / "out.ply").read_bytes() == (folder / "whole.ply").read_bytes()


def children(process):
    done = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process)], capture_output=True, text=True)
    return [int(word) for word in done.stdout.split()]


class Killing:
    """Kills parts of a cluster at random moments while a run goes on; the run is called again where it failed."""

    def __init__(self, cluster, folder, source, parts):
        self.cluster, self.folder, self.source, self.parts = cluster, folder, source, parts
        self.generator = random.Random(SEED)
        self.kills = dict.fromkeys(parts, 0)
        begin = time.monotonic()
        self.finish()
        self.duration = time.monotonic() - begin

    def call(self):
        return self.cluster.denoise(self.source, self.folder / "out.ply", self.folder / "work", "--tiles", 9, "--memory", "256M")

    def finish(self):
        run = self.call()
        said = run.communicate(timeout=300)[1]
        assert run.returncode == 0, said
        expect_the_bits(self.folder)
        assert finished(self.folder / "work").keys() == TASKS
        assert unfinished(self.folder) == []
        expect_nothing_unfinished(self.folder / "work")
        shutil.rmtree(self.folder / "work")
        (self.folder / "out.ply").unlink()

    def kill(self, part):
        number = self.generator.randrange(self.cluster.count)
        if part == "worker":
            self.cluster.kill_worker(number)
        elif part == "scheduler":
            self.cluster.kill_scheduler()
        else:
            end = time.monotonic() + 5
            while not (tasks := children(self.cluster.workers[number].pid)) and time.monotonic() < end:
                pass
            if not tasks:
                return
            try:
                os.kill(tasks[0], signal.SIGKILL)
            except ProcessLookupError:
                return
        self.kills[part] += 1

    def once(self):
        """One run with a kill; returns when it is finished, after another call if it has to be."""
        part = self.generator.choice(self.parts)
        run = self.call()
        time.sleep(self.generator.uniform(0.1, 0.8) * self.duration)
        before = finished(self.folder / "work")
        self.kill(part)
        said = run.communicate(timeout=300)[1]
        if part != "scheduler":
            assert run.returncode == 0, said
        elif run.returncode != 0:
            line = said.strip().splitlines()[-1]  # the ones before are Dask's
            assert line.startswith("pointfair: ") and "the scheduler cannot be reached" in line, said
        after = finished(self.folder / "work")
        assert {name: after[name] for name in before} == before
        if part == "scheduler":
            self.cluster.stop()
            self.cluster.start_all()
        self.finish()
        return part


@pytest.mark.parametrize("parts", [["worker", "task"], ["scheduler"]], ids=["workers", "scheduler"])
def test_what_is_killed_of_a_cluster_changes_no_bit(tmp_path, source, parts):
    with Cluster(tmp_path) as cluster:
        killing = Killing(cluster, tmp_path, source, parts)
        while sum(killing.kills.values()) < KILLS // 2:
            killing.once()
        print(killing.kills)


def test_a_worker_without_the_memory_for_its_tile_gives_it_to_another(tmp_path):
    """One worker's tasks may take 150 MB, where they need more."""
    source = write_cloud(tmp_path / "in.ply", 100000)
    program = tmp_path / "program"
    program.write_text(f'#!/bin/sh\nif [ "$SMALL" = 1 ]; then echo $5 >> {tmp_path}/tried; ulimit -d 150000; fi\nexec {PROGRAM} "$@"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    flags = ["--k", 200, "--iterations", 1, "--tiles", 2, "--memory", "1G"]
    subprocess.run([PROGRAM, "run", source, tmp_path / "whole.ply", "-q", *map(str, flags[:4])], check=True)
    with Cluster(tmp_path, environment=lambda number: {"SMALL": str(int(number == 0))}) as cluster:
        run = cluster.denoise(source, tmp_path / "out.ply", tmp_path / "work", *flags, "--program", program)
        said = run.communicate(timeout=300)[1]
        assert run.returncode == 0, said
    expect_the_bits(tmp_path)
    assert "denoise-1" in (tmp_path / "tried").read_text()


def test_tasks_that_no_worker_has_the_memory_for_end_with_the_programs_line(tmp_path):
    source = write_cloud(tmp_path / "in.ply", 100000)
    program = tmp_path / "program"
    program.write_text(f'#!/bin/sh\nif [ "$2" = run ]; then ulimit -d 150000; fi\nexec {PROGRAM} "$@"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    with Cluster(tmp_path) as cluster:
        run = cluster.denoise(source, tmp_path / "out.ply", tmp_path / "work", "--k", 200, "--tiles", 2, "--memory", "1G",
                              "--program", program)
        said = run.communicate(timeout=300)[1]
    assert run.returncode == 4 and "MiB are free here" in said, said
    assert len(said.strip().splitlines()) == 1
    assert not (tmp_path / "out.ply").exists()


class Namespaces:
    """Two network namespaces and this one on a bridge. Skips where they cannot be made."""

    def __init__(self):
        self.names = [f"pointfair{os.getpid()}-{side}" for side in (1, 2)]
        self.bridge, self.net = f"pf{os.getpid()}", f"10.{os.getpid() % 200 + 20}.77"

    def ip(self, *words):
        done = subprocess.run(["ip", *words], capture_output=True, text=True)
        if done.returncode != 0:
            pytest.skip(f"no network namespaces can be made here: {done.stderr.strip()}")

    def __enter__(self):
        if os.geteuid() != 0 or shutil.which("ip") is None:
            pytest.skip("network namespaces need root, and the program ip")
        try:
            self.ip("link", "add", self.bridge, "type", "bridge")
            self.ip("addr", "add", f"{self.net}.1/24", "dev", self.bridge)
            self.ip("link", "set", self.bridge, "up")
            for side, name in enumerate(self.names):
                outer, inner = f"{self.bridge}o{side}", f"{self.bridge}i{side}"
                self.ip("netns", "add", name)
                self.ip("link", "add", outer, "type", "veth", "peer", "name", inner, "netns", name)
                self.ip("link", "set", outer, "master", self.bridge, "up")
                self.ip("-n", name, "addr", "add", f"{self.net}.{side + 2}/24", "dev", inner)
                self.ip("-n", name, "link", "set", inner, "up")
                self.ip("-n", name, "link", "set", "lo", "up")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for name in self.names:
            subprocess.run(["ip", "netns", "del", name], capture_output=True)
        subprocess.run(["ip", "link", "del", self.bridge], capture_output=True)


def test_four_workers_in_two_network_namespaces_have_the_bits_though_workers_are_killed(tmp_path, source):
    with Namespaces() as spaces:
        def enter(number):
            return ["ip", "netns", "exec", spaces.names[number % 2]]

        with Cluster(tmp_path, workers=4, host=f"{spaces.net}.1", before=enter) as cluster:
            killing = Killing(cluster, tmp_path, source, ["worker", "task"])
            while sum(killing.kills.values()) < KILLS // 2:
                killing.once()
        assert f"{spaces.net}.2:" in (tmp_path / "dask.log").read_text()
        assert f"{spaces.net}.3:" in (tmp_path / "dask.log").read_text()
