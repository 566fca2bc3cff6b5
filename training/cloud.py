# SPDX-License-Identifier: Apache-2.0
"""A cloud with its truth, its files, and the true noise of its places. Lengths are in the cloud's own unit."""
import json
import pathlib
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

import rays

PLACE_POINTS = 64                                 # the noise of a place is that of so many nearest points
_ARRAYS = ("points", "clean", "normal", "surface", "edge", "part", "spacing", "sensor", "vertices", "triangles")
_PLY_KINDS = {"float": "<f4", "double": "<f8", "uchar": "u1", "char": "i1", "ushort": "<u2", "short": "<i2", "uint": "<u4",
              "int": "<i4"}


@dataclass
class Cloud:
    """n points as measured and what is true of them."""
    family: str
    seed: int
    points: np.ndarray                            # (n, 3) float32, as measured, around a local origin
    clean: np.ndarray                             # (n, 3) float32, the true surface point of each
    normal: np.ndarray                            # (n, 3) float32, true, towards the sensor or outwards
    surface: np.ndarray                           # (n,) bool: measured on a surface, neither leaf nor mixed pixel
    edge: np.ndarray                              # (n,) bool: within two spacings of a sharp edge or of a jump in depth
    part: np.ndarray                              # (n,) int16, index into names
    spacing: np.ndarray                           # (n,) float32, mean distance to the six nearest other clean points
    vertices: np.ndarray                          # (v, 3) float32, the true surface
    triangles: np.ndarray                         # (t, 3) int32
    names: list[str] = field(default_factory=lambda: ["object"])
    sensor: np.ndarray | None = None              # (n, 3) float32, where the sensor stood for each point
    settings: dict = field(default_factory=dict)  # what was drawn, for people

    def signed_error(self, points: np.ndarray | None = None) -> np.ndarray:
        """Along the true normals, of the points as measured or of these."""
        points = self.points if points is None else points
        return ((points.astype(float) - self.clean) * self.normal).sum(1)

    @property
    def sigma(self) -> float:
        """The noise of a typical surface point."""
        error = self.signed_error()[self.surface]
        return float(np.median(np.abs(error)) / .6745) if len(error) else 0.0

    @property
    def typical_spacing(self) -> float:
        return float(np.median(self.spacing[self.surface])) if self.surface.any() else float(np.median(self.spacing))

    def caster(self) -> rays.Caster:
        return rays.Caster(self.vertices, self.triangles)

    def local_noise(self, places: np.ndarray) -> np.ndarray:
        """True noise at these points (indices): rms of the signed errors of the 64 nearest surface points."""
        index = np.flatnonzero(self.surface)
        error2 = self.signed_error()[index] ** 2
        count = min(PLACE_POINTS, len(index))
        near = cKDTree(self.clean[index]).query(self.clean[places], count)[1].reshape(len(places), count)
        return np.sqrt(error2[near].mean(1))

    def save(self, path: pathlib.Path) -> None:
        """As path.npz and, for the program, path.ply (positions only)."""
        arrays = {name: getattr(self, name) for name in _ARRAYS if getattr(self, name) is not None}
        told = {"family": self.family, "seed": self.seed, "names": self.names, "settings": self.settings}
        write_ply(path.with_suffix(".ply"), self.points)
        unfinished = path.with_suffix(".unfinished.npz")
        np.savez(unfinished, told=json.dumps(told, default=float), **arrays)
        unfinished.replace(path.with_suffix(".npz"))


def load(path: pathlib.Path) -> Cloud:
    """What save wrote."""
    with np.load(path.with_suffix(".npz")) as data:
        arrays = {name: data[name] for name in _ARRAYS if name in data}
        return Cloud(**json.loads(str(data["told"])), **arrays)


def write_ply(path: pathlib.Path, points: np.ndarray) -> None:
    """Binary, float32."""
    head = ("ply\nformat binary_little_endian 1.0\n"
            f"element vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\nend_header\n")
    pathlib.Path(path).write_bytes(head.encode() + np.asarray(points, "<f4").tobytes())


def read_ply(path: pathlib.Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Positions and the other attributes of a binary little-endian PLY that has vertices only."""
    data = pathlib.Path(path).read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    words = [line.split() for line in data[:end].decode().splitlines()]
    count = next(int(word[2]) for word in words if word[:2] == ["element", "vertex"])
    row = np.dtype([(word[2], _PLY_KINDS[word[1]]) for word in words if word[0] == "property"])
    rows = np.frombuffer(data, row, count, end)
    return np.stack([rows["x"], rows["y"], rows["z"]], 1), {name: rows[name] for name in rows.dtype.names[3:]}


def read_mesh(path: pathlib.Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a binary little-endian PLY whose faces are all triangles, with equal vertices joined."""
    data = pathlib.Path(path).read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    words = [line.split() for line in data[:end].decode().splitlines()]
    counts = {word[1]: int(word[2]) for word in words if word[0] == "element"}
    row = np.dtype([(word[2], _PLY_KINDS[word[1]]) for word in words if word[0] == "property" and word[1] != "list"])
    rows = np.frombuffer(data, row, counts["vertex"], end)
    vertices = np.stack([rows[axis] for axis in "xyz"], 1).astype(float)
    face = np.dtype([("count", "u1"), ("corner", "<i4", 3)])
    triangles = np.frombuffer(data, face, counts["face"], end + rows.nbytes)["corner"].astype(int)
    vertices, join = np.unique(vertices, axis=0, return_inverse=True)
    return vertices, join.ravel()[triangles]
