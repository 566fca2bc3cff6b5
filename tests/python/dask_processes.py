# SPDX-License-Identifier: Apache-2.0
"""A Dask cluster of processes that tests kill: a scheduler and workers, started by their command line."""
import json
import os
import random
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

from pointfair._program import program_path

PROGRAM = os.environ.get("POINTFAIR_BIN") or program_path()
SETTINGS = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "10s", "DASK_DISTRIBUTED__ADMIN__LOG_FORMAT": "%(message)s"}


def write_cloud(path, count=20000):
    generator = random.Random(1)
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
            "property float x\nproperty float y\nproperty float z\nend_header\n").encode()
    path.write_bytes(head + b"".join(
        struct.pack("<3f", generator.random(), generator.random(), generator.gauss(0, 0.004)) for _ in range(count)))
    return path


def wait_for(condition, what, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.05)


class Cluster:
    """With `before`: words that each worker's command begins with, which enter a network namespace for instance."""

    def __init__(self, folder, workers=2, host="127.0.0.1", before=lambda number: [], environment=lambda number: {}):
        self.folder, self.host, self.count = Path(folder), host, workers
        self.before, self.environment = before, environment
        self.file = self.folder / "scheduler.json"
        self.scheduler, self.workers = None, []

    def start(self, tool, words, before=(), more=None):
        log = open(self.folder / "dask.log", "ab")
        return subprocess.Popen([*before, sys.executable, "-m", f"distributed.cli.dask_{tool}", *map(str, words)],
                                env={**os.environ, **SETTINGS, **(more or {})}, stdout=log, stderr=log, start_new_session=True)

    def start_all(self):
        self.file.unlink(missing_ok=True)
        self.scheduler = self.start("scheduler", ["--host", self.host, "--port", 0, "--no-dashboard", "--scheduler-file", self.file])
        wait_for(self.file.exists, "the scheduler does not start")
        wait_for(lambda: self.file.read_text().endswith("}"), "the scheduler does not start")
        self.workers = [self.start_worker(number) for number in range(self.count)]
        return self

    def start_worker(self, number):
        words = [self.address(), "--nthreads", 1, "--no-dashboard", "--no-nanny", "--name", f"worker{number}",
                 "--local-directory", self.folder / f"scratch{number}", "--death-timeout", 60]
        return self.start("worker", words, self.before(number), self.environment(number))

    def address(self):
        return json.loads(self.file.read_text())["address"]

    def denoise(self, source, out, work, *flags):
        return subprocess.Popen([sys.executable, "-m", "pointfair.cluster", self.address(), str(source), "--out", str(out),
                                 "--work", str(work), "--program", PROGRAM, *map(str, flags)],
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, **SETTINGS})

    def kill_worker(self, number):
        """And starts another one, as an operator or an engine would."""
        self.workers[number].kill()
        self.workers[number].wait()
        self.workers[number] = self.start_worker(number)

    def kill_scheduler(self):
        self.scheduler.kill()
        self.scheduler.wait()

    def stop(self):
        for process in [*self.workers, self.scheduler]:
            if process is not None and process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    def __enter__(self):
        return self.start_all()

    def __exit__(self, *_):
        self.stop()
