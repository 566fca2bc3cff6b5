# SPDX-License-Identifier: Apache-2.0
"""A scene: meshes with a name for each part, and the sharp edges between their triangles."""
import numpy as np

import rays
from shapes import Mesh, turned

SHARP_DEGREES = 30.0                              # an edge is sharp where the surface turns by more
LEAF = "leaf"                                     # parts of this name are cast but count as no surface


class Scene:
    """Collects meshes; finish() before use."""

    def __init__(self):
        self.names: list[str] = []
        self._vertices, self._triangles, self._parts, self._count = [], [], [], 0
        self.size = (1.0, 1.0, 1.0)               # of the room or ground in which sensors may stand

    def add(self, name: str, mesh: Mesh) -> None:
        vertices, triangles = mesh
        if name not in self.names:
            self.names.append(name)
        self._vertices.append(np.asarray(vertices, float))
        self._triangles.append(np.asarray(triangles, int) + self._count)
        self._parts.append(np.full(len(triangles), self.names.index(name), np.int16))
        self._count += len(vertices)

    def finish(self, diagonal: float | None = None) -> "Scene":
        """Joins the parts; diagonal: scales the bounding box to it, centred at the origin."""
        vertices, self.triangles, self.part = map(np.concatenate, (self._vertices, self._triangles, self._parts))
        if diagonal:
            vertices = vertices - (vertices.min(0) + vertices.max(0)) / 2
            vertices = vertices * (diagonal / np.linalg.norm(np.ptp(vertices, axis=0)))
        self.vertices = vertices
        self.caster = rays.Caster(vertices, self.triangles)
        return self

    def is_leaf(self, part: np.ndarray) -> np.ndarray:
        return part == self.names.index(LEAF) if LEAF in self.names else np.zeros(len(part), bool)

    def edge_samples(self, step: float) -> np.ndarray:
        """Points along the sharp edges of all but leaves, at most `step` apart."""
        p, q = sharp_edges(self.vertices, self.triangles[~self.is_leaf(self.part)])
        count = np.minimum(np.ceil(np.linalg.norm(q - p, axis=1) / step), 2000).astype(int) + 1
        which = np.repeat(np.arange(len(p)), count)
        place = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        return p[which] + (place / np.maximum(count[which] - 1, 1))[:, None] * (q - p)[which]

    def is_free(self, place, distance: float = .35) -> bool:
        """Whether nothing is nearer to this place than `distance`."""
        return float(self.caster.distance(np.array([place], float))[0]) > distance

    def turned(self, degrees: float, points: np.ndarray) -> np.ndarray:
        return turned((points, None), degrees)[0]


def sharp_edges(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of the edges that two triangles share (equal places are one vertex) and where the surface turns."""
    whole = np.round(vertices * 1e6).astype(np.int64)
    key = whole @ np.array([73856093, 19349663, 83492791], np.int64)              # equal places, equal keys
    _, first, join = np.unique(key, return_index=True, return_inverse=True)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    real = area > 0
    normal = normal[real] / area[real, None]
    corner = join.ravel()[triangles[real]].astype(np.int64)
    ends = np.sort(np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]]), axis=1)
    face = np.tile(np.arange(len(corner)), 3)
    key = ends[:, 0] * len(vertices) + ends[:, 1]
    order = np.argsort(key, kind="stable")
    key, ends, face = key[order], ends[order], face[order]
    pair = np.flatnonzero(key[1:] == key[:-1])
    bend = (normal[face[pair]] * normal[face[pair + 1]]).sum(1) < np.cos(np.radians(SHARP_DEGREES))
    ends = ends[pair[bend]]
    return vertices[first[ends[:, 0]]], vertices[first[ends[:, 1]]]
