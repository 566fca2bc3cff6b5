# SPDX-License-Identifier: Apache-2.0
"""Single objects: meshes of the folder POINTFAIR_DATA/punet_train, if it is there, and shapes made up from random numbers."""
import functools
import os
import pathlib

import numpy as np

import cloud
from scene import Scene
from shapes import Mesh, box, finer, hull, joined, lathe, level_set, on_floor, pebble, pipe, rod, scaled, sheet, turned, unit

Random = np.random.Generator
KEPT_APART = ("egea", "joint", "bumpy_torus", "block", "nicolo", "screwdriver")     # shapes of other tests


def log_uniform(rng: Random, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


@functools.cache
def mesh_files() -> tuple[pathlib.Path, ...]:
    """The meshes of POINTFAIR_DATA/punet_train that no test uses; none if there is no such folder."""
    folder = pathlib.Path(os.environ.get("POINTFAIR_DATA", "")) / "punet_train"
    found = sorted(folder.glob("*_mesh.ply")) if "POINTFAIR_DATA" in os.environ else []
    return tuple(path for path in found if path.name.removesuffix("_mesh.ply") not in KEPT_APART)


@functools.lru_cache(maxsize=8)
def _mesh_of(path: pathlib.Path) -> Mesh:
    return cloud.read_mesh(path)


def solid(rng: Random, x: float, y: float, z: float, size: float) -> Mesh:
    """A box, rod, hull, pebble or lathe that stands at (x, y, z)."""
    kind = rng.integers(6)
    width, depth, height = size * np.exp(rng.uniform(np.log(.3), 0, 3))
    low, high = [x - width / 2, y - depth / 2, z], [x + width / 2, y + depth / 2, z + height]
    thinnest = min(width, depth, height)
    if kind == 0:
        return box(low, high, rng.uniform(0, 90), chamfer=rng.uniform(.02, .12) * thinnest * (rng.random() < .5))
    if kind == 1:
        return box(low, high, rng.uniform(0, 90), fillet=rng.uniform(.05, .3) * thinnest)
    if kind == 2:
        return rod(x, y, z, z + height, width / 2, 64)
    if kind == 3:
        corners = (rng.random((int(rng.integers(5, 16)), 3)) - .5) * [width, depth, height]
        return hull(np.array([x, y, z + height / 2]) + corners)
    if kind == 4:
        half = np.array([width, depth, height]) / 2
        return pebble(rng, np.array([x, y, z + height / 2]), half, rng.uniform(0, .15), 40)
    levels = np.sort(rng.random(int(rng.integers(3, 9)))) * height
    profile = [(rng.uniform(.25, 1) * width / 2, level) for level in levels]
    return lathe([(0, levels[0]), *profile, (0, levels[-1] + .02 * size)], (x, y, z))


def plate(rng: Random, x: float, y: float, z: float, size: float) -> Mesh:
    """A standing plate, .4 to 3 % of its width thick."""
    thickness = log_uniform(rng, .004, .03) * size
    return box([x - size / 2, y - thickness / 2, z], [x + size / 2, y + thickness / 2, z + size * rng.uniform(.4, 1.6)],
               rng.uniform(0, 180))


def supershape(rng: Random) -> Mesh:
    """Gielis' superformula in both angles."""
    def radius(angle, symmetry, n1, n2, n3):
        return (np.abs(np.cos(symmetry * angle / 4)) ** n2 + np.abs(np.sin(symmetry * angle / 4)) ** n3) ** (-1 / n1)

    longitude, latitude = np.meshgrid(np.linspace(-np.pi, np.pi, 181), np.linspace(-np.pi / 2, np.pi / 2, 91))
    exponents = np.exp(rng.uniform(np.log(.7), np.log(6), (2, 3)))
    exponents[:, 1:] *= exponents[:, :1] / exponents[:, :1].clip(1)
    around = np.clip(radius(longitude, 2 * rng.integers(1, 5), *exponents[0]), .3, 1.6)
    above = np.clip(radius(latitude, 2 * rng.integers(1, 4), *exponents[1]), .3, 1.6)
    x, y = around * np.cos(longitude) * above * np.cos(latitude), around * np.sin(longitude) * above * np.cos(latitude)
    return sheet(x, y, above * np.sin(latitude))


def gear(rng: Random) -> Mesh:
    """A toothed wheel with a bore."""
    teeth, inner = int(rng.integers(8, 30)), rng.uniform(.7, .9)
    angle = np.linspace(0, 2 * np.pi, 8 * teeth + 1)
    wave = np.cos(teeth * angle)
    radius = inner + (1 - inner) * np.clip(.5 + rng.uniform(.6, 2.5) * wave, 0, 1)
    bore, half = rng.uniform(.15, .5), rng.uniform(.08, .3)
    profile = [(bore, -half), (None, -half), (None, half), (bore, half), (bore, -half)]
    rings = [np.full(angle.shape, r) if r else radius for r, _ in profile]
    return sheet(np.stack([r * np.cos(angle) for r in rings]), np.stack([r * np.sin(angle) for r in rings]),
                 np.stack([np.full(angle.shape, z) for _, z in profile]))


def blob(rng: Random) -> Mesh:
    """A ball with bumps of several sizes."""
    vertices, triangles = pebble(rng, np.zeros(3), rng.uniform(.5, 1, 3), rng.uniform(.05, .25), 72)
    height = np.zeros(len(vertices))
    for octave in range(1, 4):
        for _ in range(5):
            wave = rng.normal(size=3) * 2.5 * 2 ** octave
            height += .04 / 2 ** octave * np.cos(vertices @ wave + rng.uniform(0, 2 * np.pi))
    return vertices * (1 + rng.uniform(.3, 1.5) * height[:, None]), triangles


def torus(rng: Random) -> Mesh:
    """A ring, round or knotted."""
    angle = np.linspace(0, 2 * np.pi, 241)
    twist, height = int(rng.choice([0, 3, 5])), rng.uniform(.2, .5)
    around = 1 + .35 * np.cos(twist * angle / 2 * 2) * (twist > 0)
    path = np.stack([around * np.cos(2 * angle if twist else angle), around * np.sin(2 * angle if twist else angle),
                     height * np.sin(twist * angle)], 1)
    return pipe(path, rng.uniform(.08, .18 if twist else .45), 48)


def machined(rng: Random) -> Mesh:
    """A plate with bosses, fins and ribs."""
    parts = [box([-1, -.7, 0], [1, .7, rng.uniform(.08, .3)], chamfer=.03 * (rng.random() < .5))]
    parts += [solid(rng, rng.uniform(-.8, .8), rng.uniform(-.5, .5), .05, log_uniform(rng, .15, .9))
              for _ in range(rng.integers(3, 9))]
    thickness = rng.uniform(.012, .04)
    parts += [box([.2, -.5 + .1 * k, .05], [.8, -.5 + .1 * k + thickness, .45]) for k in range(rng.integers(0, 8))]
    parts += [plate(rng, rng.uniform(-.6, .6), rng.uniform(-.4, .4), .05, .5) for _ in range(rng.integers(0, 3))]
    return joined(parts)


def vase(rng: Random) -> Mesh:
    """A lathe of a smooth or stepped profile with a wall."""
    height = np.linspace(0, 2, 40)
    radius = .5 + sum(rng.uniform(-.2, .2) * np.sin((k + 1) * height * 1.3 + rng.uniform(0, 6)) for k in range(4))
    radius = np.clip(radius if rng.random() < .6 else np.round(radius * 8) / 8, .12, None)
    wall = rng.uniform(.03, .1)
    outside = list(zip(radius, height))
    inside = [(max(r - wall, .03), z + wall) for r, z in reversed(outside[:-2])]
    return lathe([(0, 0), *outside, (radius[-1] - wall, 2), *inside, (0, wall)], sides=120)


def polyhedron(rng: Random) -> Mesh:
    """Few plane faces: a prism, an octahedron, an icosahedron or a hull of random points, at times with a pyramid on each
    triangle."""
    kind = rng.integers(4)
    if kind == 0:
        angle = np.linspace(0, 2 * np.pi, int(rng.integers(3, 13)), endpoint=False)
        ring, half = np.stack([np.cos(angle), np.sin(angle)], 1), rng.uniform(.2, 1.5)
        corners = np.concatenate([np.insert(ring, 2, half, axis=1), np.insert(ring * rng.uniform(.5, 1), 2, -half, axis=1)])
    elif kind == 1:
        corners = np.concatenate([np.eye(3), -np.eye(3)])
    elif kind == 2:
        golden, signs = (1 + 5 ** .5) / 2, np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
        corners = np.concatenate([np.roll(np.c_[np.zeros(4), signs * [1, golden]], k, axis=1) for k in range(3)])
    else:
        corners = rng.normal(size=(int(rng.integers(5, 30)), 3))
        corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    vertices, triangles = hull(corners * rng.uniform(.6, 1, 3))
    if rng.random() < .4:
        tips = vertices[triangles].mean(1) * rng.uniform(1.1, 2.2)
        tip = len(vertices) + np.arange(len(triangles))
        a, b, c = triangles.T
        triangles = np.concatenate([np.stack(side, 1) for side in ((a, b, tip), (b, c, tip), (c, a, tip))])
        vertices = np.concatenate([vertices, tips])
    return vertices, triangles


def limbed(rng: Random) -> Mesh:
    """Thick and thin limbs that grow out of each other with rounded joints, as of figures and castings; few or many, at
    times with an uneven skin or cut by planes."""
    count = int(rng.integers(3, 13))
    ends, thick = [rng.normal(size=3) * .2], [rng.uniform(.2, .45)]
    limbs = []
    for _ in range(count):
        base = rng.integers(len(ends))
        tip = ends[base] + rng.uniform(.3, 1) * unit(rng.normal(size=3))
        radius = thick[base] * rng.uniform(.35, 1)
        limbs.append((ends[base], tip, thick[base], max(radius, .05)))
        ends.append(tip)
        thick.append(max(radius, .05))
    spots = np.array(ends)
    margin = max(thick) + .15
    low, high = spots.min(0) - margin, spots.max(0) + margin
    step = (high - low).max() / rng.integers(60, 110)
    axes = [np.arange(a, b + step, step) for a, b in zip(low, high)]
    at = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    width, total = log_uniform(rng, .01, .12), 0.0
    for a, b, of_a, of_b in limbs:
        share = np.clip((at - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        off = at - a - share[..., None] * (b - a)
        distance = np.sqrt((off * off).sum(-1)) - of_a - share * (of_b - of_a)
        total = total + np.exp(np.clip(-distance / width, -60, 60))
    field = -width * np.log(np.maximum(total, 1e-26))
    if rng.random() < .5:
        for octave in range(2):
            for _ in range(4):
                wave = unit(rng.normal(size=3)) * rng.uniform(6, 14) * 2 ** octave
                field += .012 / 2 ** octave * np.cos(at @ wave + rng.uniform(0, 2 * np.pi))
    for _ in range(int(rng.integers(0, 3)) if rng.random() < .4 else 0):
        way = unit(rng.normal(size=3))
        heights = spots @ way
        field = np.maximum(field, at @ way - rng.uniform(np.median(heights), heights.max() + .1))
    return level_set(field, axes)


MADE = (supershape, gear, blob, torus, machined, vase, polyhedron, limbed, limbed)


def any_mesh(rng: Random, diagonal: float) -> Mesh:
    """A mesh file, turned over at random, or something made up."""
    files = mesh_files()
    if not files or rng.random() < .45:
        return scaled(MADE[rng.integers(len(MADE))](rng), diagonal)
    vertices, triangles = _mesh_of(files[rng.integers(len(files))])
    if rng.random() < .5:
        vertices = vertices[:, [0, 2, 1]] * [1, -1, 1]
    return scaled((vertices, triangles), diagonal)


def carved(rng: Random, mesh: Mesh, length: float, height: float) -> Mesh:
    """With detail of about this length and height: waves, ridges or scales in two octaves, at times in some places only. Space
    itself is bent, so that parts that touch stay together."""
    vertices, triangles = finer(mesh, length / 4)
    kind, shift = rng.integers(3), np.zeros_like(vertices)
    for octave in range(2):
        for _ in range(5):
            number = 2 * np.pi / (length * 2 ** octave) * rng.uniform(.7, 1.4)
            wave = np.sin(vertices @ (number * unit(rng.normal(size=3))) + rng.uniform(0, 2 * np.pi))
            if kind == 1:
                wave = 1.3 - 2 * np.abs(wave)                  # sharp ridges
            elif kind == 2:
                wave = np.tanh(4 * wave)                       # plateaus and steps
            shift += wave[:, None] * unit(rng.normal(size=3)) * rng.uniform(.5, 1)
    if rng.random() < .5:
        patches = np.sin(vertices @ (unit(rng.normal(size=3)) * rng.uniform(4, 12)) + rng.uniform(0, 2 * np.pi))
        shift *= np.clip(.5 + 2 * patches, 0, 1)[:, None]
    return vertices + .4 * height * shift, triangles


def faceted(rng: Random) -> Mesh:
    """A figure of some hundred plane triangles, as of low-polygon models and of cut stones."""
    vertices, triangles = (pebble(rng, np.zeros(3), rng.uniform(.4, 1, 3), rng.uniform(.1, .4), int(rng.integers(6, 17)))
                           if rng.random() < .5 else any_mesh(rng, 2.0))
    if len(triangles) > 1500:                                  # the vertices of each cell of a lattice become one
        cell = np.linalg.norm(np.ptp(vertices, axis=0)) / rng.uniform(10, 28)
        _, merged, count = np.unique(np.floor(vertices / cell), axis=0, return_inverse=True, return_counts=True)
        merged = merged.ravel()
        vertices = np.stack([np.bincount(merged, vertices[:, k]) / count for k in range(3)], 1)
        triangles = merged[triangles]
        first = (triangles.argmin(1)[:, None] + np.arange(3)) % 3
        triangles = np.unique(np.take_along_axis(triangles, first, 1), axis=0)
        a, b, c = triangles.T
        triangles = triangles[(a != b) & (b != c) & (a != c)]
    return vertices + .02 * rng.normal(size=vertices.shape) * rng.random(), triangles


def one_object(rng: Random) -> Scene:
    """An object of diagonal 1."""
    scene = Scene()
    scene.add("object", turned(any_mesh(rng, 1.0), rng.uniform(0, 360)))
    return scene.finish(diagonal=1.0)


def stands_on(rng: Random, size: float, x: float, y: float, z: float = 0.0) -> Mesh:
    """Any object on a floor or table."""
    return on_floor(any_mesh(rng, size), x, y, z, rng.uniform(0, 360))


