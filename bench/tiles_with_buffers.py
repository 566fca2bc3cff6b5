#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What tiles with a buffer cost a plain script: points that differ from the run over the whole cloud.

    pip install open3d dask numpy
    bench/tiles_with_buffers.py [--points 1000000] [--side 4] [--pointfair build/bin/pointfair]

Two filters as such scripts have them, each over the whole cloud and as Dask tasks over tiles that are loaded with a
buffer, of which the inner part is kept:

* plane: Open3D's neighbour search; each point goes onto the plane of its 16 nearest, twice.
* outliers: Open3D's remove_statistical_outlier(16, 2.0): a point goes if it is farther from its neighbours than the mean
  over all points and two standard deviations.

The cloud is hilly ground as a tripod's scanner sees it: its density falls to a fiftieth from the middle to the rim, with
noise of 3 mm, and one point of 2,000 lies off. With --pointfair, the same cloud in as many tiles of pointfair.
Prints a table."""
import argparse
import subprocess
import tempfile
from pathlib import Path

import dask
import numpy as np
import open3d as o3d

NEIGHBOURS = 16
NOISE = 0.003


def scan(count):
    rng = np.random.default_rng(1)
    radius = np.sqrt(rng.random(count)) ** 2.8 * 20  # points per area fall with the distance
    angle = rng.random(count) * 2 * np.pi
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    z = 0.8 * np.sin(x / 3.1) * np.cos(y / 2.3) + rng.normal(0, NOISE, count)
    z[::2000] += rng.choice([-1, 1], len(z[::2000])) * rng.uniform(0.05, 0.5, len(z[::2000]))
    return np.stack([x, y, z], 1).astype(np.float32)


def onto_planes(points):
    """Points on the planes of their nearest, twice."""
    for _ in range(2):
        search = o3d.core.nns.NearestNeighborSearch(o3d.core.Tensor(points))
        search.knn_index()
        moved = np.empty_like(points)
        for begin in range(0, len(points), 1 << 17):
            some = points[begin:begin + (1 << 17)]
            near = points[search.knn_search(o3d.core.Tensor(some), NEIGHBOURS)[0].numpy()].astype(np.float64)
            centre = near.mean(1)
            offsets = near - centre[:, None]
            normal = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1][:, :, 0]
            height = ((some - centre) * normal).sum(1)
            moved[begin:begin + len(some)] = some - height[:, None] * normal
        points = moved
    return points


def without_outliers(points):
    """The points, NaN where the filter removes one."""
    cloud = o3d.t.geometry.PointCloud(o3d.core.Tensor(points))
    kept = cloud.remove_statistical_outliers(NEIGHBOURS, 2.0)[1].numpy()
    return np.where(kept[:, None], points, np.nan).astype(np.float32)


def tile(run, points, low, high, buffer):
    """Where the tile's points are in the cloud, as the filter has them with what lies in the buffer, and how many were
    loaded."""
    place = points[:, :2]
    loaded = np.flatnonzero(((place >= low - buffer) & (place < high + buffer)).all(1))
    result = run(points[loaded])
    inner = ((place[loaded] >= low) & (place[loaded] < high)).all(1)
    return loaded[inner], result[inner], len(loaded)


def in_tiles(run, points, side, buffer):
    edges = np.linspace(-20.001, 20.001, side + 1)
    tasks = [dask.delayed(tile)(run, points, edges[[i, j]], edges[[i + 1, j + 1]], buffer)
             for i in range(side) for j in range(side)]
    result, loaded = np.full_like(points, np.nan), 0
    for places, values, count in dask.compute(*tasks, scheduler="synchronous"):
        result[places] = values
        loaded += count
    return result, loaded / len(points)


def differing(a, b):
    """Points that are not the same, those that are off by more than a tenth of the noise, and the farthest."""
    same = ((a == b) | (np.isnan(a) & np.isnan(b))).all(1)
    off = np.linalg.norm(np.nan_to_num(a.astype(np.float64)) - np.nan_to_num(b), axis=1)
    gone = np.isnan(a).any(1) != np.isnan(b).any(1)
    return (~same).sum(), (gone | (off > NOISE / 10)).sum(), 0 if gone.all() else off[~gone].max()


def by_pointfair(program, points, tiles):
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
            "property float x\nproperty float y\nproperty float z\nend_header\n").encode()
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "in.ply")
        source.write_bytes(head + points.tobytes())
        for name, more in (("whole", []), ("tiles", ["--tiles", str(tiles)])):
            subprocess.run([program, "run", source, Path(folder, name + ".ply"), "-q", *more], check=True)
        whole, cut = (np.frombuffer(Path(folder, name + ".ply").read_bytes()[-points.nbytes:], np.float32).reshape(-1, 3)
                      for name in ("whole", "tiles"))
    return differing(whole, cut)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--side", type=int, default=4, help="tiles along each side")
    parser.add_argument("--buffers", type=float, nargs="*", default=[0, 0.1, 0.5, 2], help="metres")
    parser.add_argument("--pointfair", help="the program, to compare")
    arguments = parser.parse_args()
    points = scan(arguments.points)
    print("| filter | buffer, m | points loaded | points that differ | by more than a tenth of the noise | farthest, mm |\n"
          "|---|---|---|---|---|---|")
    for name, run in (("plane", onto_planes), ("outliers", without_outliers)):
        whole = run(points)
        for buffer in arguments.buffers:
            cut, loaded = in_tiles(run, points, arguments.side, buffer)
            count, far, most = differing(whole, cut)
            print(f"| {name} | {buffer:g} | {loaded:.2f} times | {count:,} | {far:,} | {1000 * most:.2f} |", flush=True)
    if arguments.pointfair:
        count, far, most = by_pointfair(arguments.pointfair, points, arguments.side ** 2)
        print(f"| pointfair | none to choose | | {count:,} | {far:,} | {1000 * most:.2f} |")


if __name__ == "__main__":
    main()
