# SPDX-License-Identifier: Apache-2.0
"""Casts rays into a triangle mesh and finds closest points on it.

The work is done by rays.cpp, which is compiled with g++ when it is first needed into build/training (python
training/rays.py does it beforehand; the library can be carried to a machine without a compiler)."""
import ctypes
import hashlib
import os
import pathlib
import subprocess

import numpy as np

SOURCE = pathlib.Path(__file__).resolve().with_name("rays.cpp")
FOLDER = SOURCE.parent.parent / "build/training"


def library_path() -> pathlib.Path:
    """Where the compiled library of this source is or will be."""
    return FOLDER / f"librays-{hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:12]}.so"


def build() -> pathlib.Path:
    """Compiles rays.cpp if that has not been done."""
    path = library_path()
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(f".{os.getpid()}")
        subprocess.run(["g++", "-std=c++17", "-O3", "-shared", "-fPIC", str(SOURCE), "-o", str(unfinished)], check=True)
        unfinished.replace(path)                                   # two processes may build at once
    return path


_library = None


def _load():
    global _library
    if _library is None:
        _library = ctypes.CDLL(str(build()))
        _library.rays_mesh.restype = ctypes.c_void_p
        _library.rays_free.argtypes = [ctypes.c_void_p]
    return _library


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


class Caster:
    """A mesh, vertices (n, 3) and triangles (m, 3), that can be asked."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray):
        vertices = np.ascontiguousarray(vertices, np.float64)
        triangles = np.ascontiguousarray(triangles, np.int32)
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        self.normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        library = _load()
        self._free = library.rays_free
        self._mesh = library.rays_mesh(_pointer(vertices), _pointer(triangles), ctypes.c_int64(len(triangles)))

    def __del__(self):
        if getattr(self, "_mesh", None):
            self._free(self._mesh)

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ranges in lengths of the directions (infinite where nothing is hit), normals towards the origin and triangles
        (-1: none). Directions (..., 3); one origin may serve all."""
        shape = directions.shape[:-1]
        directions = np.ascontiguousarray(directions, np.float64).reshape(-1, 3)
        origins = np.ascontiguousarray(np.broadcast_to(origins, (*shape, 3)), np.float64).reshape(-1, 3)
        ranges, ids = np.empty(len(directions)), np.empty(len(directions), np.int32)
        _library.rays_cast(ctypes.c_void_p(self._mesh), _pointer(origins), _pointer(directions),
                           ctypes.c_int64(len(directions)), _pointer(ranges), _pointer(ids))
        normals = self.normals[ids]
        normals = np.where((normals * directions).sum(1, keepdims=True) > 0, -normals, normals)
        return ranges.reshape(shape), normals.reshape(*shape, 3), ids.reshape(shape)

    def closest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The closest points of the surface and their triangles."""
        points = np.ascontiguousarray(points, np.float64)
        nearest, ids = np.empty_like(points), np.empty(len(points), np.int32)
        _library.rays_closest(ctypes.c_void_p(self._mesh), _pointer(points), ctypes.c_int64(len(points)),
                              _pointer(nearest), _pointer(ids))
        return nearest, ids

    def distance(self, points: np.ndarray) -> np.ndarray:
        """From each point to the surface, unsigned."""
        return np.linalg.norm(self.closest(points)[0] - points, axis=1)


def spread(points: np.ndarray, distance: float) -> np.ndarray:
    """Which points to keep, in order, so that no two are nearer than `distance` (Poisson-disk sampling of candidates)."""
    points = np.ascontiguousarray(points, np.float64)
    keep = np.empty(len(points), np.uint8)
    _load().rays_spread(_pointer(points), ctypes.c_int64(len(points)), ctypes.c_double(distance), _pointer(keep))
    return keep.astype(bool)


if __name__ == "__main__":
    print(build())
