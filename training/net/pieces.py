# SPDX-License-Identifier: Apache-2.0
"""Draws clouds (training/families.py), runs the program on each, and writes pieces of them for training (data.py).

    python pieces.py OUT PROGRAM SECONDS [WORKER WORKERS [FIRST]]

Each worker takes every WORKERS-th seed from FIRST on, until SECONDS have passed.
"""
import os
import subprocess
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from scipy.spatial import cKDTree

import families
import spec

SIZE = 8192  # points of a piece; clouds of 10,000 points are common
MOST = 3  # pieces of a cloud
OBJECTS = 0.4  # of the clouds; training draws half of its pieces from them
TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4"}


def write_ply(path, points):
    names = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{names}end_header\n"
    Path(path).write_bytes(head.encode() + np.ascontiguousarray(points, "<f4").tobytes())


def read_ply(path):
    data = Path(path).read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    words = [line.split() for line in data[:end].decode().splitlines()]
    columns = [(w[2], TYPES[w[1]]) for w in words if w[0] == "property"]
    return np.frombuffer(data, np.dtype(columns), offset=end)


def default_run(program, points, scratch):
    """Places, normals and noise of the default run."""
    given, made = f"{scratch}.ply", f"{scratch}-out.ply"
    write_ply(given, points)
    options = ["--force", "-q", "--threads", "1", "--device", "cpu", "--normals", "write", "--write-noise"]
    subprocess.run([program, "run", given, made, *options], check=True, capture_output=True)
    rows = read_ply(made)
    column = lambda *names: np.stack([rows[name] for name in names], 1).astype(np.float32)
    return column("x", "y", "z"), column("nx", "ny", "nz"), rows["noise"].astype(np.float32)


def lists_of(points, rng):
    """Neighbours in each scale; a random choice stands for the program's hash."""
    lists, own = [], np.arange(len(points))[:, None]
    for stride in spec.STRIDES:
        members = np.sort(rng.permutation(len(points))[: len(points) // stride])
        found = members[cKDTree(points[members]).query(points, spec.NEIGHBORS + 1)[1]]
        is_own = found == own
        is_own[~is_own.any(1), spec.NEIGHBORS] = True
        lists.append(found[~is_own].reshape(-1, spec.NEIGHBORS))
    return np.stack(lists, 1).astype(np.uint16)


def pieces_of(cloud, program, scratch, rng):
    measured, true = cloud.points.astype(float), cloud.clean.astype(float)
    places, normals, noise = default_run(program, measured, scratch)
    finite = np.isfinite(places).all(1) & np.isfinite(noise) & np.isfinite(true).all(1)
    tree, used, pieces = cKDTree(measured), np.zeros(len(measured), bool), []
    for middle in rng.permutation(len(measured))[: 6 * MOST]:
        chosen = np.sort(tree.query(measured[middle], SIZE)[1])
        sound = cloud.surface[chosen]
        if len(pieces) == MOST or used[middle] or sound.mean() < 0.6 or not finite[chosen].all():
            continue
        used[chosen[: SIZE // 2]] = True
        off = lambda a: (a[chosen] - true[middle]).astype(np.float32)
        away = np.linalg.norm(off(true), axis=1)
        within = away < (0.9 * away.max() if len(measured) > 1.3 * SIZE else np.inf)
        columns = [off(measured), off(places.astype(float)), normals[chosen], noise[chosen], off(true)]
        pieces.append(columns + [cloud.normal[chosen].astype(np.float32), sound, within, lists_of(off(places), rng)])
    return pieces


def kind_of(family):
    group = families.FAMILIES[family].group
    return "obj" if group == "objects" else f"clean_{family}" if group == "clean" else family


def main(out, program, seconds, worker=0, workers=1, first=1_000_000):
    Path(out).mkdir(parents=True, exist_ok=True)
    end, seed, names = time.time() + float(seconds), int(first) + int(worker), sorted(families.FAMILIES)
    objects = [name for name in names if kind_of(name) == "obj"]
    while time.time() < end:
        rng = np.random.default_rng(seed)
        among = objects if rng.random() < OBJECTS else names
        family = among[rng.integers(len(among))]
        cloud = families.draw(family, seed)
        if len(cloud.points) >= SIZE:
            pieces = pieces_of(cloud, program, f"{out}/scratch{worker}", rng)
            if pieces:
                np.savez(f"{out}/{seed}.tmp.npz", *[np.stack(c) for c in zip(*pieces)], kind=kind_of(family))
                os.replace(f"{out}/{seed}.tmp.npz", f"{out}/{seed}.npz")
        seed += int(workers)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 6, 7):
        sys.exit(__doc__)
    main(*sys.argv[1:])
