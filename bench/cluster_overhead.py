#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What a Dask cluster costs beside the work: a plan of 1,000 tiles, done once, then with tasks that are all done, then with
tasks that are no work at all.

    bench/cluster_overhead.py --program build/bin/pointfair [--tiles 1000] [--points 200000] [--workers 4]

Needs the Python package and distributed. Prints what each took."""
import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
from distributed import Client, LocalCluster

import pointfair.cluster


def write_cloud(path, count):
    rng = np.random.default_rng(1)
    points = np.stack([*rng.random((2, count)), rng.normal(0, 0.002, count)], 1).astype("<f4")
    path.write_bytes((f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n"
                      "property float z\nend_header\n").encode() + points.tobytes())
    return path


def processor_seconds():
    """Of this process, the scheduler in it, the workers, and the tasks that have ended."""
    here = psutil.Process()
    return sum(sum(process.cpu_times()[:4]) for process in [here, *here.children(recursive=True)])


def timed(name, call):
    begin, spent = time.monotonic(), processor_seconds()
    call()
    print(f"{name}: {time.monotonic() - begin:.1f} s, {processor_seconds() - spent:.1f} s of processor time", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path)
    parser.add_argument("--tiles", type=int, default=1000)
    parser.add_argument("--points", type=int, default=200000)
    parser.add_argument("--workers", type=int, default=4)
    given = parser.parse_args()
    program = str(given.program.resolve()) if given.program else pointfair.cluster.program_path()
    with tempfile.TemporaryDirectory() as folder, \
            LocalCluster(n_workers=given.workers, threads_per_worker=1, dashboard_address=None) as local, Client(local) as client:
        source, work = write_cloud(Path(folder, "in.ply"), given.points), Path(folder, "work")

        def whole():
            pointfair.cluster.denoise(client, str(source), str(Path(folder, "out.ply")), work=str(work), tiles=given.tiles,
                                      threads=1, program=program, k=8, iterations=1)

        timed(f"{given.points} points in {given.tiles} tiles", whole)
        subprocess.run([program, "run", source, Path(folder, "whole.ply"), "-q", "--k", "8", "--iterations", "1"], check=True)
        assert Path(folder, "out.ply").read_bytes() == Path(folder, "whole.ply").read_bytes()
        cluster = pointfair.cluster._Cluster(client, {"pure": False, "retries": 0, "resources": {}})
        tasks = [f"denoise-1:{number}" for number in range(given.tiles)]
        timed(f"{given.tiles} tasks that are done", lambda: cluster.run(tasks, program, str(work), "-q"))
        timed(f"{given.tiles} tasks that do nothing", lambda: cluster.run(tasks, "/bin/true", str(work), "-q"))


if __name__ == "__main__":
    main()
