# SPDX-License-Identifier: Apache-2.0
"""Shapes as triangle meshes, pairs (vertices (n, 3), triangles (m, 3)), lengths in metres where they stand in a scene."""
import numpy as np
from scipy.spatial import ConvexHull

Mesh = tuple[np.ndarray, np.ndarray]


def unit(vectors: np.ndarray) -> np.ndarray:
    """Each vector divided by its length."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def joined(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
    return (np.concatenate([vertices for vertices, _ in meshes]),
            np.concatenate([triangles + start for (_, triangles), start in zip(meshes, starts)]))


def turned(mesh: Mesh, degrees: float, about=(0.0, 0.0)) -> Mesh:
    """Turned about the vertical through `about`."""
    vertices, triangles = mesh
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    middle = np.array([*about, 0.0])
    return (np.asarray(vertices) - middle) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + middle, triangles


def moved(mesh: Mesh, by) -> Mesh:
    return mesh[0] + np.asarray(by, float), mesh[1]


def on_floor(mesh: Mesh, x: float, y: float, z: float = 0.0, degrees: float = 0.0) -> Mesh:
    """Turned, with its lowest vertex at height z."""
    vertices, triangles = turned(mesh, degrees)
    return vertices + [x, y, z - vertices[:, 2].min()], triangles


def scaled(mesh: Mesh, diagonal: float) -> Mesh:
    """Centred at the origin, the bounding box of this diagonal."""
    vertices, triangles = mesh
    vertices = vertices - (vertices.min(0) + vertices.max(0)) / 2
    return vertices * (diagonal / np.linalg.norm(np.ptp(vertices, axis=0))), triangles


def finer(mesh: Mesh, longest: float, most: int = 300_000) -> Mesh:
    """The same surface with the longest edge of each triangle halved until it is at most this long, or until there are so many
    triangles."""
    vertices, triangles = mesh
    done = []
    while len(triangles):
        corners = vertices[triangles]
        edge = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2)
        worst = edge.argmax(1)
        long = edge.max(1) > longest
        if sum(map(len, done)) + len(triangles) + long.sum() > most:
            long[:] = False
        done.append(triangles[~long])
        row = np.arange(3)[None] + worst[long, None]
        a, b, c = np.take_along_axis(triangles[long], row % 3, 1).T          # a to b is the longest
        ends, middle = np.unique(np.sort(np.stack([a, b], 1), axis=1), axis=0, return_inverse=True)
        middle = len(vertices) + middle.ravel()
        vertices = np.concatenate([vertices, vertices[ends].mean(1)])
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return vertices, np.concatenate(done)


def hull(points) -> Mesh:
    """The convex hull, faces outwards."""
    points = np.asarray(points, float)
    found = ConvexHull(points)
    triangles = found.simplices.copy()
    a, b, c = (points[triangles[:, k]] for k in range(3))
    wrong = (np.cross(b - a, c - a) * found.equations[:, :3]).sum(1) < 0
    triangles[wrong] = triangles[wrong][:, ::-1]
    return points, triangles


def box(low, high, degrees: float = 0.0, chamfer: float = 0.0, fillet: float = 0.0) -> Mesh:
    """Turned about its middle, with chamfered or rounded edges if asked."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    corners = np.stack(np.meshgrid(*zip(low, high), indexing="ij"), -1).reshape(-1, 3)
    inwards = np.sign((low + high) / 2 - corners)
    if chamfer:
        corners = np.concatenate([corners + inwards * chamfer * (1 - np.eye(3)[k]) for k in range(3)])
    elif fillet:
        t, u = np.meshgrid(np.linspace(0, np.pi / 2, 9), np.linspace(0, np.pi / 2, 9))
        ball = fillet * np.stack([np.sin(t) * np.cos(u), np.sin(t) * np.sin(u), np.cos(t)], -1).reshape(-1, 3)
        corners = np.concatenate([corner + side * (fillet - ball) for corner, side in zip(corners, inwards)])
    return turned(hull(np.unique(np.round(corners, 9), axis=0)), degrees, (low + high)[:2] / 2)


def sheet(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Mesh:
    """A surface over three equal two-dimensional arrays."""
    height, width = x.shape
    index = np.arange(height * width).reshape(height, width)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    return (np.stack([x.ravel(), y.ravel(), z.ravel()], 1),
            np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def _tube(rings: int, sides: int) -> list[np.ndarray]:
    """Triangles between successive rings of vertices."""
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    between = []
    for start in range(0, (rings - 1) * sides, sides):
        between.append(np.stack([start + i, start + j, start + sides + j], 1))
        between.append(np.stack([start + i, start + sides + j, start + sides + i], 1))
    return between


def pipe(path, radius: float, sides: int = 24) -> Mesh:
    """A round pipe along a polyline, closed at both ends; its frame follows the path without twist."""
    path = np.asarray(path, float)
    ways = unit(np.gradient(path, axis=0))
    u = np.cross(ways[0], np.eye(3)[np.argmin(np.abs(ways[0]))])
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)[:, None]
    rings = []
    for point, way in zip(path, ways):
        u = unit(u - (u @ way) * way)
        rings.append(point + radius * (np.cos(angle) * u + np.sin(angle) * np.cross(way, u)))
    count = len(path) * sides
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    ends = [np.stack([j, i, np.full(sides, count)], 1),
            np.stack([count - sides + i, count - sides + j, np.full(sides, count + 1)], 1)]
    return np.concatenate([*rings, path[:1], path[-1:]]), np.concatenate(_tube(len(path), sides) + ends)


def bent(corners, radius: float, steps: int = 8) -> np.ndarray:
    """A polyline with its corners rounded."""
    corners = np.asarray(corners, float)
    path = [corners[0]]
    for a, b, c in zip(corners, corners[1:], corners[2:]):
        p, q = b + radius * unit(a - b), b + radius * unit(c - b)
        t = np.linspace(0, 1, steps)[:, None]
        path.extend((1 - t) ** 2 * p + 2 * t * (1 - t) * b + t ** 2 * q)
    return np.array([*path, corners[-1]])


def lathe(profile, centre=(0.0, 0.0, 0.0), sides: int = 72) -> Mesh:
    """Revolves a polyline (radius, z) about the vertical; from below upwards on the outside."""
    profile = np.asarray(profile, float)
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    vertices = np.stack([profile[:, :1] * np.cos(angle), profile[:, :1] * np.sin(angle),
                         np.repeat(profile[:, 1:], sides, 1)], -1)
    return vertices.reshape(-1, 3) + centre, np.concatenate(_tube(len(profile), sides))


def rod(x: float, y: float, bottom: float, top: float, radius: float, sides: int = 32) -> Mesh:
    return lathe([(0, bottom), (radius, bottom), (radius, top), (0, top)], (x, y, 0), sides)


def ball(rings: int = 24) -> Mesh:
    """Of radius 1."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    return lathe(np.stack([np.cos(angle), np.sin(angle)], 1), sides=2 * rings)


def pebble(rng: np.random.Generator, centre, half, bumps: float = .08, rings: int = 24) -> Mesh:
    """A ball, squeezed to these half axes and uneven."""
    vertices, triangles = ball(rings)
    radius = np.ones(len(vertices))
    for _ in range(12):
        radius += bumps / 3 * np.cos(2.5 * (vertices @ rng.normal(size=3)) + rng.uniform(0, 2 * np.pi))
    return vertices * radius[:, None] * half + centre, triangles


def level_set(field: np.ndarray, axes) -> Mesh:
    """The surface where a field over a lattice is 0, faces towards larger values: each cell is six tetrahedra, and in each
    the field is linear. `axes` are the coordinates of the lattice; triangles do not share vertices."""
    shape = np.array(field.shape)
    value = field.ravel()
    value = np.where(value == 0, 1e-12, value)
    start = np.stack(np.meshgrid(*[np.arange(n - 1) for n in shape], indexing="ij"), -1).reshape(-1, 3)
    stride = np.array([shape[1] * shape[2], shape[2], 1])
    corner = (start @ stride)[:, None] + [stride @ [k >> 2, k >> 1 & 1, k & 1] for k in range(8)]
    inside = value[corner] < 0
    corner = corner[inside.any(1) & ~inside.all(1)]
    ways = ((4, 6), (4, 5), (2, 6), (2, 3), (1, 5), (1, 3))
    tetrahedra = np.concatenate([corner[:, [0, first, second, 7]] for first, second in ways])
    order = np.argsort(value[tetrahedra], axis=1)              # those inside come first
    tetrahedra = np.take_along_axis(tetrahedra, order, 1)
    count = (value[tetrahedra] < 0).sum(1)
    faces = []
    for below, pairs in ((1, ((0, 1), (0, 2), (0, 3))), (3, ((0, 3), (1, 3), (2, 3))), (2, ((0, 2), (0, 3), (1, 3), (1, 2)))):
        these = tetrahedra[count == below]
        ends = these[:, np.array(pairs)]                       # (n, edges, 2)
        places = np.stack([axes[k][ends // stride[k] % shape[k]] for k in range(3)], -1)
        f = value[ends]
        share = f[..., 0] / (f[..., 0] - f[..., 1])
        crossing = places[:, :, 0] + share[..., None] * (places[:, :, 1] - places[:, :, 0])
        spots = np.stack([axes[k][these // stride[k] % shape[k]] for k in range(3)], -1)
        out = spots[:, below:].mean(1) - spots[:, :below].mean(1)
        for three in ((0, 1, 2), (0, 2, 3))[:len(pairs) - 2]:
            faces.append((crossing[:, three], out))
    corners, out = (np.concatenate(parts) for parts in zip(*faces))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    back = (normal * out).sum(1) < 0
    corners[back] = corners[back][:, ::-1]
    corners = corners[(normal * normal).sum(1) > 0]
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def leaves(rng: np.random.Generator, centre, radius: float, count: int, size: float) -> Mesh:
    """Loose triangles within a ball."""
    at = np.asarray(centre) + radius * unit(rng.normal(size=(count, 3))) * rng.uniform(.3, 1, (count, 1))
    a, b = rng.normal(size=(2, count, 3)) * size
    return np.stack([at, at + a, at + b], 1).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


class _Quads:
    """Collects quadrilaterals as pairs of triangles."""

    def __init__(self):
        self.vertices: list = []
        self.triangles: list = []

    def add(self, *corners):
        n = len(self.vertices)
        self.vertices.extend(corners)
        self.triangles.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]])

    def mesh(self) -> Mesh:
        return np.array(self.vertices, float), np.array(self.triangles)


def arcade(length: float, top: float, arches, depth: float) -> Mesh:
    """A wall in the plane y = 0 from x = 0 to length with arches (middle, half width, springing height); behind each a vault
    and a back wall."""
    quads = _Quads()

    def column(x0, x1, z0, z1):
        quads.add((x0, 0, z0), (x1, 0, z1), (x1, 0, top), (x0, 0, top))

    x = 0.0
    for middle, half, spring in arches:
        column(x, middle - half, 0, 0)
        around = [(middle + half * np.cos(a), spring + half * np.sin(a)) for a in np.linspace(np.pi, 0, 25)]
        curve = [(middle - half, 0), *around, (middle + half, 0)]
        for (xa, za), (xb, zb) in zip(curve, curve[1:]):
            quads.add((xa, 0, za), (xb, 0, zb), (xb, depth, zb), (xa, depth, za))
            if xb > xa:
                column(xa, xb, za, zb)
                quads.add((xa, depth, 0), (xb, depth, 0), (xb, depth, zb), (xa, depth, za))
        x = middle + half
    column(x, length, 0, 0)
    return quads.mesh()


def windowed(length: float, top: float, windows, depth: float) -> Mesh:
    """A wall in the plane y = 0 with panes `depth` behind rectangular openings (x, z, width, height)."""
    xs = sorted({0, length, *[w[0] for w in windows], *[w[0] + w[2] for w in windows]})
    zs = sorted({0, top, *[w[1] for w in windows], *[w[1] + w[3] for w in windows]})
    quads = _Quads()
    for xa, xb in zip(xs, xs[1:]):
        for za, zb in zip(zs, zs[1:]):
            x, z = (xa + xb) / 2, (za + zb) / 2
            y = depth if any(w[0] < x < w[0] + w[2] and w[1] < z < w[1] + w[3] for w in windows) else 0.0
            quads.add((xa, y, za), (xb, y, za), (xb, y, zb), (xa, y, zb))
    for x0, z0, width, height in windows:
        x1, z1, d = x0 + width, z0 + height, depth
        quads.add((x0, 0, z0), (x0, d, z0), (x0, d, z1), (x0, 0, z1))
        quads.add((x1, d, z0), (x1, 0, z0), (x1, 0, z1), (x1, d, z1))
        quads.add((x0, 0, z0), (x1, 0, z0), (x1, d, z0), (x0, d, z0))
        quads.add((x0, d, z1), (x1, d, z1), (x1, 0, z1), (x0, 0, z1))
    return quads.mesh()


def stand(wall: Mesh, start, end) -> Mesh:
    """Puts a wall made along x from one point of the ground to another; its front is on the right."""
    vertices, triangles = wall
    x = unit(np.subtract(end, start).astype(float))
    y = np.array([-x[1], x[0]])
    return np.column_stack([start + vertices[:, :1] * x + vertices[:, 1:2] * y, vertices[:, 2]]), triangles


class Relief:
    """Natural ground: waves of random directions, each octave half as long and `decay` times lower."""

    def __init__(self, rng: np.random.Generator, octaves: int, size: float, height: float, decay: float = 2.0):
        octave = np.repeat(np.arange(octaves), 6)
        angle, self.phase = rng.uniform(0, 2 * np.pi, (2, len(octave)))
        number = 2 * np.pi * 2.0 ** octave / size * rng.uniform(.7, 1.4, len(octave))
        self.wave = number * np.array([np.cos(angle), np.sin(angle)])
        self.height = height / decay ** octave / 2.4

    def __call__(self, x, y) -> np.ndarray:
        x, y = np.asarray(x, float), np.asarray(y, float)
        z = np.zeros(np.broadcast(x, y).shape)
        for height, kx, ky, phase in zip(self.height, *self.wave, self.phase):
            z += height * np.cos(kx * x + ky * y + phase)
        return z
