# SPDX-License-Identifier: Apache-2.0
"""Meshes with known truth, and noise on their vertices: what bench/meshes.py measures with."""
import numpy as np


# A mesh: vertices, faces, and a function that gives the distance and the normal of the truth at places.
def grid(rows, columns, wrap_rows=False, wrap_columns=False, quads=False):
    """Faces over rows x columns vertices, row after row."""
    i, j = np.meshgrid(np.arange(rows - (not wrap_rows)), np.arange(columns - (not wrap_columns)), indexing="ij")
    a = i * columns + j
    b = i * columns + (j + 1) % columns
    c = (i + 1) % rows * columns + (j + 1) % columns
    d = (i + 1) % rows * columns + j
    quad = np.stack([a, b, c, d], -1).reshape(-1, 4)
    return quad if quads else np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])


def triangles_of(faces):
    return faces if faces.shape[1] == 3 else np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])


def cube_surface(n):
    """A cube of [-1, 1]^3 with n x n quads a side, each cut in two; vertices welded."""
    t = np.linspace(-1, 1, n + 1)
    u, v = (m.ravel() for m in np.meshgrid(t, t, indexing="ij"))
    points, faces = [], []
    for axis in range(3):
        for side in (-1, 1):
            p = np.empty((len(u), 3))
            p[:, axis], p[:, (axis + 1) % 3], p[:, (axis + 2) % 3] = side, u, v
            f = grid(n + 1, n + 1)
            faces.append((f[:, ::-1] if side > 0 else f) + len(points) * len(u))
            points.append(p)
    points, faces = np.concatenate(points), np.concatenate(faces)
    _, first, inverse = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    return points[first], inverse.reshape(-1)[faces]


def sphere():
    points, faces = cube_surface(40)
    points = np.tan(points * np.pi / 4)
    points /= np.linalg.norm(points, axis=1)[:, None]
    return points, faces, lambda p: (np.linalg.norm(p, axis=1) - 1, p / np.linalg.norm(p, axis=1)[:, None])


def torus():
    u, v = np.meshgrid(np.arange(200) * 2 * np.pi / 200, np.arange(80) * 2 * np.pi / 80, indexing="ij")
    ring = 1 + 0.4 * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), 0.4 * np.sin(v)], -1).reshape(-1, 3)

    def truth(p):
        radius = np.linalg.norm(p[:, :2], axis=1)
        middle = np.c_[p[:, :2] / radius[:, None], np.zeros(len(p))]
        offset = p - middle
        length = np.linalg.norm(offset, axis=1)
        return length - 0.4, offset / length[:, None]
    return points, grid(200, 80, True, True)[:, ::-1], truth


def box_truth(half, radius):
    """A box rounded by `radius`; `half` is that of the box without it."""
    def truth(p):
        q = np.abs(p) - half
        outside = np.maximum(q, 0)
        length = np.linalg.norm(outside, axis=1)
        inner = np.minimum(q.max(axis=1), 0)
        axis = np.eye(3)[np.argmax(q, axis=1)]
        normal = np.where((length > 1e-9)[:, None], outside / np.maximum(length, 1e-9)[:, None], axis) * np.sign(p)
        return length + inner - radius, normal
    return truth


def rounded_box():
    points, faces = cube_surface(48)
    half, radius = np.array([0.8, 0.5, 0.3]), 0.15
    points = points * (half + radius)
    inner = np.clip(points, -half, half)
    offset = points - inner
    return inner + radius * offset / np.linalg.norm(offset, axis=1)[:, None], faces, box_truth(half, radius)


def sharp_box():
    points, faces = cube_surface(40)
    half = np.array([1.0, 0.8, 0.6])
    return points * half, faces, box_truth(half, 0)


def two_sheets():
    """Two open sheets, 1.5 edges apart, of one file."""
    t = np.linspace(-1, 1, 70)
    u, v = (m.ravel() for m in np.meshgrid(t, t, indexing="ij"))
    gap = 1.5 * (t[1] - t[0])
    lower, upper = np.c_[u, v, np.zeros(len(u))], np.c_[u, v, np.full(len(u), gap)]
    f = grid(70, 70)[:, ::-1]

    def truth(p):
        half = len(p) // 2  # vertices, then faces, come in the order of the sheets
        z = np.r_[np.zeros(half), np.full(len(p) - half, gap)]
        return p[:, 2] - z, np.tile([0.0, 0.0, 1.0], (len(p), 1))
    return np.concatenate([lower, upper]), np.concatenate([f, f + len(u)]), truth


def height(x, y):
    return 0.12 * np.sin(3 * x) * np.cos(4 * y) + 0.03 * np.sin(11 * x + 5 * y)


def relief():
    """A grid of quads."""
    t = np.linspace(-1, 1, 110)
    u, v = (m.ravel() for m in np.meshgrid(t, t, indexing="ij"))

    def truth(p):
        x, y = p[:, 0], p[:, 1]
        dx = 0.36 * np.cos(3 * x) * np.cos(4 * y) + 0.33 * np.cos(11 * x + 5 * y)
        dy = -0.48 * np.sin(3 * x) * np.sin(4 * y) + 0.15 * np.cos(11 * x + 5 * y)
        normal = np.c_[-dx, -dy, np.ones(len(x))]
        length = np.linalg.norm(normal, axis=1)
        return (p[:, 2] - height(x, y)) / length, normal / length[:, None]
    return np.c_[u, v, height(u, v)], grid(110, 110, quads=True)[:, ::-1], truth


def open_sheet():
    """A part of a cylinder, triangles."""
    angle, z = (m.ravel() for m in np.meshgrid(np.linspace(-1.2, 1.2, 120), np.linspace(-1, 1, 100), indexing="ij"))

    def truth(p):
        radius = np.linalg.norm(p[:, :2], axis=1)
        return radius - 1, np.c_[p[:, :2] / radius[:, None], np.zeros(len(p))]
    return np.c_[np.cos(angle), np.sin(angle), z], grid(120, 100)[:, ::-1], truth


def uneven_sphere():
    """Vertices three times as dense at one pole as at the other."""
    points, faces, truth = sphere()
    height = points[:, 2]
    moved = np.c_[points[:, :2], height + 0.45 * (1 - height**2)]
    return moved / np.linalg.norm(moved, axis=1)[:, None], faces, truth


def torus_of_quads():
    points, _, truth = torus()
    return points, grid(200, 80, True, True, quads=True)[:, ::-1], truth


def wedge():
    """The sides of a prism over a hexagon that is not convex: sharp edges, flat faces, steps of two lengths."""
    corners = np.array([[0, 0], [2.0, 0], [2.0, 0.7], [0.8, 0.7], [0.8, 1.6], [0, 1.6]])
    side = np.concatenate([a + (b - a) * np.linspace(0, 1, int(30 * np.linalg.norm(b - a)), endpoint=False)[:, None]
                           for a, b in zip(corners, np.roll(corners, -1, 0))])
    levels = np.concatenate([np.linspace(0, 0.3, 14, endpoint=False), np.linspace(0.3, 1.2, 21)])
    points = np.concatenate([np.c_[side, np.full(len(side), z)] for z in levels])
    faces = grid(len(levels), len(side), wrap_columns=True)

    def truth(p):
        best, normal = np.full(len(p), np.inf), np.zeros((len(p), 3))
        for a, b in zip(corners, np.roll(corners, -1, 0)):
            t = np.clip(((p[:, :2] - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
            offset = p[:, :2] - (a + t[:, None] * (b - a))
            length = np.linalg.norm(offset, axis=1)
            nearer = length < best
            best[nearer] = length[nearer]
            out = np.array([(b - a)[1], -(b - a)[0], 0]) / np.linalg.norm(b - a)
            normal[nearer] = out
        return best, normal
    return points, faces, truth


def relief_with_holes():
    """Triangles, of which those in nine discs are missing."""
    points, faces, truth = relief()
    faces = triangles_of(faces)
    middle = points[faces].mean(axis=1)
    holes = [(x, y) for x in (-0.6, 0, 0.6) for y in (-0.6, 0, 0.6)]
    kept = np.all([np.hypot(middle[:, 0] - x, middle[:, 1] - y) > 0.12 for x, y in holes], axis=0)
    used, number = np.unique(faces[kept], return_inverse=True)
    return points[used], number.reshape(-1, 3), truth


def photogrammetry():
    """Irregular triangles over the relief, in charts of a texture: vertices are repeated along their seams."""
    n, random = 100, np.random.default_rng(7)
    t = np.linspace(-1, 1, n)
    u, v = (m.ravel() for m in np.meshgrid(t, t, indexing="ij"))
    inside = (np.abs(u) < 1) & (np.abs(v) < 1)
    u, v = u + inside * random.uniform(-0.22, 0.22, len(u)) * 2 / n, v + inside * random.uniform(-0.22, 0.22, len(v)) * 2 / n
    quads = grid(n, n, quads=True)[:, ::-1]
    turned = random.random(len(quads)) < 0.5
    faces = np.concatenate([quads[turned][:, [0, 1, 2]], quads[turned][:, [0, 2, 3]], quads[~turned][:, [0, 1, 3]],
                            quads[~turned][:, [1, 2, 3]]])
    points = np.c_[u, v, height(u, v)]
    middle = points[faces].mean(axis=1)
    chart = np.floor(2 * (middle[:, 0] + 1)) * 4 + np.floor(2 * (middle[:, 1] + 1))
    own, number = np.unique(faces + len(points) * chart[:, None].astype(int), return_inverse=True)
    return points[own % len(points)], number.reshape(-1, 3), relief()[2]


MESHES = {"sphere": sphere, "torus": torus, "rounded box": rounded_box, "sharp box": sharp_box, "relief, quads": relief,
          "open sheet": open_sheet, "two sheets": two_sheets, "uneven sphere": uneven_sphere, "torus, quads": torus_of_quads,
          "wedge": wedge, "relief with holes": relief_with_holes, "photogrammetry": photogrammetry}


def noise_of(points, faces, sigma, kind):
    """Points at one place have the same."""
    places, vertex = np.unique(points, axis=0, return_inverse=True)
    vertex = vertex.reshape(-1)
    random = np.random.default_rng(1)
    if kind == "white":
        return random.normal(0, sigma, points.shape)[np.unique(vertex, return_index=True)[1]][vertex]
    noise = random.normal(0, 1, places.shape)
    sides = np.stack([faces, np.roll(faces, 1, 1)], -1).reshape(-1, 2)
    sides = vertex[np.concatenate([sides, sides[:, ::-1]])]
    count = np.bincount(sides[:, 0], minlength=len(places)) + 1.0
    for _ in range(4):
        noise = np.stack([(noise[:, axis] + np.bincount(sides[:, 0], noise[sides[:, 1], axis], len(places))) / count
                          for axis in range(3)], -1)
    return (sigma * noise / noise.std())[vertex]
