#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The smoothers of Open3D and PyMeshLab as peers: functions of points, and a program like those of bench/peers.

`bench/python_peers.py` puts a copy of this file into bin/peers under the name of each method, with a Python that has the packages:

    open3d_mls IN.ply [--k K] [--width W] [--iterations N] [--scale S] [--repeat R] [--threads T] [--order input|morton] [--out OUT.ply]

Without the first four, a method runs at its documented defaults. It goes from array to array and prints one line of JSON. Normals that it
needs are made before the clock starts."""
import argparse
import functools
import importlib
import importlib.metadata
import json
import os
import random
import resource
import statistics
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

NORMAL_NEIGHBORS = 16  # of PyMeshLab's normals


def spacing_of(points):
    """The median of the points' mean distances to their 6 nearest."""
    import numpy as np
    from scipy.spatial import cKDTree
    some = points[np.random.default_rng(1).permutation(len(points))[:20_000]]
    return float(np.median(cKDTree(points).query(some, 7)[0][:, 1:].mean(1)))


def open3d_cloud(points):
    import open3d as o3d
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(float)))


def search_of(k):
    import open3d as o3d
    return o3d.geometry.KDTreeSearchParamKNN(k)


# Each takes points and settings, and returns a function without arguments: what is timed. It returns the moved points, as an
# array or what NumPy makes one of. Packages are loaded where they are used, since the tables need no more than METHODS.

def open3d_mls(points, k=None):
    cloud = open3d_cloud(points)
    return lambda: (cloud.smooth_mls() if k is None else cloud.smooth_mls(search_of(k))).points


def open3d_laplacian(points, k=20, iterations=10):
    cloud = open3d_cloud(points)
    return lambda: cloud.smooth_laplacian(iterations, knn=k).points


def open3d_taubin(points, k=20, iterations=10):
    cloud = open3d_cloud(points)
    return lambda: cloud.smooth_taubin(iterations, knn=k).points


def open3d_bilateral(points, k=None, width=3.0):
    """width: sigma_s in spacings, of which sigma_r is a third."""
    cloud = open3d_cloud(points)
    if k is None:
        return lambda: cloud.smooth_bilateral().points
    cloud.estimate_normals(search_of(30))
    sigma = width * spacing_of(points)
    return lambda: cloud.smooth_bilateral(search_of(k), sigma, sigma / 3).points


def pymeshlab_projection(name, points, scale=2.0, k=NORMAL_NEIGHBORS):
    """scale: of MeshLab's filter, in its spacings."""
    import pymeshlab
    normals = pymeshlab.MeshSet(verbose=False)
    normals.add_mesh(pymeshlab.Mesh(vertex_matrix=points.astype(float)))
    normals.compute_normal_for_point_clouds(k=k)
    vertices, vectors = normals.current_mesh().vertex_matrix(), normals.current_mesh().vertex_normal_matrix()

    def run():
        meshes = pymeshlab.MeshSet(verbose=False)
        for _ in range(2):  # the surface's points, and those that go onto it
            meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=vertices, v_normals_matrix=vectors))
        getattr(meshes, name)(controlmesh=1, proxymesh=0, filterscale=scale)
        return meshes.mesh(0).vertex_matrix()
    return run


@dataclass(frozen=True)
class Method:
    """A method: what the tables call it, and a sweep of settings beside its defaults, of which the best counts."""

    title: str
    prepare: Callable  # (points, **settings)
    sweep: tuple


METHODS = {
    "open3d_mls": Method("Open3D MLS", open3d_mls, tuple({"k": k} for k in (8, 30, 120, 480))),
    "open3d_laplacian": Method("Open3D Laplacian", open3d_laplacian, tuple({"iterations": i} for i in (1, 3, 30))),
    "open3d_taubin": Method("Open3D Taubin", open3d_taubin, tuple({"iterations": i} for i in (1, 3, 30))),
    "open3d_bilateral": Method("Open3D bilateral", open3d_bilateral,
                               tuple({"k": k, "width": width} for k in (30, 120) for width in (1, 3))),
    "pymeshlab_apss": Method("PyMeshLab APSS", functools.partial(pymeshlab_projection, "compute_mls_projection_apss"),
                             tuple({"scale": scale} for scale in (3, 5, 8))),
    "pymeshlab_rimls": Method("PyMeshLab RIMLS", functools.partial(pymeshlab_projection, "compute_mls_projection_rimls"),
                              tuple({"scale": scale} for scale in (3, 5, 8))),
}


def flags_of(settings):
    """Settings as the program takes them."""
    return tuple(word for name, value in settings.items() for word in (f"--{name}", str(value)))


PROPERTIES = ["property float x", "property float y", "property float z"]
HEADER = "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"


def read_ply(path):
    """What `pointfair noise` writes: binary, float x, y, z and nothing else."""
    import numpy as np
    data = Path(path).read_bytes()
    body = data.index(b"end_header\n") + 11
    lines = data[:body].decode().splitlines()
    if "format binary_little_endian 1.0" not in lines or [line for line in lines if line.startswith("property")] != PROPERTIES:
        sys.exit(f"{path}: not a binary little-endian PLY of float x, y, z only")
    return np.frombuffer(data, "<f4", offset=body).reshape(-1, 3)


def write_ply(path, points):
    import numpy as np
    Path(path).write_bytes(HEADER.format(len(points)).encode() + np.ascontiguousarray(points, "<f4").tobytes())


def morton_ordered(points):
    import numpy as np
    low, high = points.min(0), points.max(0)
    cells = ((points - low) / (high - low).max() * 1023).astype(np.uint64)
    keys = sum(((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis) for axis in range(3) for bit in range(10))
    return points[np.argsort(keys, kind="stable")]


def use_threads(count):
    """Before the packages are loaded. They ask in different ways, so the process gets as many processors, too."""
    os.environ["OMP_NUM_THREADS"] = str(count)
    mine = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, random.sample(mine, min(count, len(mine))))


def parse_options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("input", metavar="IN.ply")
    for name, kind in (("k", int), ("width", float), ("iterations", int), ("scale", float)):
        parser.add_argument(f"--{name}", type=kind, default=argparse.SUPPRESS)
    parser.add_argument("--method", choices=METHODS, default=Path(sys.argv[0]).name, help="default: the program's name")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--order", choices=("input", "morton"), default="input")
    parser.add_argument("--out")
    options = parser.parse_args()
    if options.method not in METHODS:
        parser.error("give --method")
    return options


def main():
    options = parse_options()
    use_threads(options.threads)
    points = read_ply(options.input)
    if options.order == "morton":
        points = morton_ordered(points)
    package = options.method.partition("_")[0]
    importlib.import_module(package)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    settings = {name: getattr(options, name) for name in ("k", "width", "iterations", "scale") if hasattr(options, name)}
    start = time.perf_counter()
    run = METHODS[options.method].prepare(points, **settings)
    preparation, times, moved = time.perf_counter() - start, [], None
    for _ in range(options.repeat):
        moved = None
        start = time.perf_counter()
        moved = run()
        times.append(time.perf_counter() - start)
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    print(json.dumps({"name": options.method, "library": f"{package} {importlib.metadata.version(package)}", "points": len(points), **settings,
                      "threads": options.threads, "order": options.order, "repeat": options.repeat, "seconds": statistics.median(times),
                      "preparation_seconds": preparation, "peak_bytes": grown}))
    if options.out:
        write_ply(options.out, moved)


if __name__ == "__main__":
    main()
