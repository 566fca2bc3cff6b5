# SPDX-License-Identifier: Apache-2.0
"""Draws clouds (training/families.py), runs the program on each, and writes pieces of them for training (data.py).

    python pieces.py OUT PROGRAM SECONDS [WORKER WORKERS [FIRST]]

Each worker takes every WORKERS-th seed from FIRST on, until SECONDS have passed. Clouds smaller than a piece share one.
"""
import os
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from scipy.spatial import cKDTree

import families
import spec

SIZE = 8192  # points of a piece; clouds of 10,000 points are common
MOST = 3  # pieces of a cloud
# Of the clouds: object_even, any object, spec.HARD, noise that neighbours share; the others from all families.
EVEN, OBJECTS, HARD, CORRELATED = 0.2, 0.1, 0.25, 0.15
SOUND = 0.05  # of a piece's points at least lie on a surface; there are forests with 15 leaves for a point of the ground
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


def nearest(points):
    """The 16 nearest others of each."""
    found = cKDTree(points).query(points, spec.NEIGHBORS + 1)[1]
    is_own = found == np.arange(len(points))[:, None]
    is_own[~is_own.any(1), spec.NEIGHBORS] = True
    return found[~is_own].reshape(-1, spec.NEIGHBORS).astype(np.uint16)


def pieces_of(cloud, program, scratch, rng):
    measured, true = cloud.points.astype(float), cloud.clean.astype(float)
    places, normals, noise = default_run(program, measured, scratch)
    finite = np.isfinite(places).all(1) & np.isfinite(noise) & np.isfinite(true).all(1)
    tree, used, pieces = cKDTree(measured), np.zeros(len(measured), bool), []
    for middle in rng.permutation(len(measured))[: 6 * MOST]:
        chosen = np.sort(tree.query(measured[middle], SIZE)[1])
        sound = cloud.surface[chosen]
        if len(pieces) == MOST or used[middle] or sound.mean() < SOUND or not finite[chosen].all():
            continue
        used[chosen[: SIZE // 2]] = True
        off = lambda a: (a[chosen] - true[middle]).astype(np.float32)
        away = np.linalg.norm(off(true), axis=1)
        within = away < (0.9 * away.max() if len(measured) > 1.3 * SIZE else np.inf)
        classical = off(places.astype(float))
        columns = [off(measured), classical, normals[chosen], noise[chosen], off(true)]
        columns += [cloud.normal[chosen].astype(np.float32), sound, within, np.zeros(SIZE, np.int16)]
        pieces.append(columns + [nearest(classical)])
    return pieces


def whole_cloud(cloud, program, scratch):
    """The columns of a cloud smaller than a piece, in a unit in which the default run leaves an error of about 1, so
    that clouds that share a piece count alike."""
    measured, true = cloud.points.astype(float), cloud.clean.astype(float)
    places, normals, noise = default_run(program, measured, scratch)
    left = np.sqrt(np.mean(np.sum((places - true) ** 2, axis=1)[cloud.surface]))
    scale = 1 / max(left, 0.02 * float(np.median(cloud.spacing)))
    off = lambda a: ((a - true[0]) * scale).astype(np.float32)
    classical = off(places.astype(float))
    columns = [off(measured), classical, normals, noise * np.float32(scale), off(true)]
    columns += [cloud.normal.astype(np.float32), cloud.surface, np.ones(len(true), bool), np.zeros(len(true), np.int16)]
    return columns + [nearest(classical)]


class Pile:
    """Small clouds side by side, until no further one fits into a piece; repeats of a point, not judged, fill it."""

    def __init__(self):
        self.clouds, self.count = [], 0

    def add(self, columns):
        """The columns of a piece, if the cloud did not fit any more and begins another."""
        full = self.piece() if self.count + len(columns[0]) > SIZE else None
        if full:
            self.clouds, self.count = [], 0
        columns[8] = columns[8] + np.int16(len(self.clouds))
        columns[9] = columns[9] + np.uint16(self.count)
        self.clouds.append(columns)
        self.count += len(columns[0])
        return full

    def piece(self):
        columns = [np.concatenate(parts) for parts in zip(*self.clouds)]
        rows = np.minimum(np.arange(SIZE), self.count - 1)
        columns = [column[rows] for column in columns]
        columns[7][self.count :] = False
        columns[8][self.count :] = -1
        return columns


def kind_of(family):
    group = families.FAMILIES[family].group
    return f"{group}_{family}"


def write(out, seed, pieces, kind):
    np.savez(f"{out}/{seed}.tmp.npz", *[np.stack(c) for c in zip(*pieces)], kind=kind)
    os.replace(f"{out}/{seed}.tmp.npz", f"{out}/{seed}.npz")


def main(out, program, seconds, worker=0, workers=1, first=1_000_000):
    Path(out).mkdir(parents=True, exist_ok=True)
    end, seed, names = time.time() + float(seconds), int(first) + int(worker), sorted(families.FAMILIES)
    objects = [name for name in names if families.FAMILIES[name].group == "objects"]
    correlated = [name for name in names if families.FAMILIES[name].correlated]
    piles, scratch = defaultdict(Pile), f"{out}/scratch{worker}"
    while time.time() < end:
        rng = np.random.default_rng(seed)
        shares = [EVEN, OBJECTS, HARD, CORRELATED, 1 - EVEN - OBJECTS - HARD - CORRELATED]
        among = (["object_even"], objects, spec.HARD, correlated, names)[rng.choice(5, p=shares)]
        family = among[rng.integers(len(among))]
        cloud = families.draw(family, seed)
        if len(cloud.points) >= SIZE:
            pieces = pieces_of(cloud, program, scratch, rng)
        else:
            columns = whole_cloud(cloud, program, scratch)
            sound = all(np.isfinite(column).all() for column in columns[:6]) and cloud.surface.mean() > SOUND
            full = piles[family].add(columns) if sound else None
            pieces = [full] if full else []
        if pieces:
            write(out, seed, pieces, kind_of(family))
        seed += int(workers)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 6, 7):
        sys.exit(__doc__)
    main(*sys.argv[1:])
