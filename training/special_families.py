# SPDX-License-Identifier: Apache-2.0
"""Families of what goes wrong outside of the usual scans: copies, grids, crowns, wires, plates, relief, blurred noise."""
import numpy as np
from scipy.spatial import cKDTree

import cameras
import objects
from errors import Random, blurred
from registry import Drawn, family
from object_families import even_points, plain_rows, sampled
from objects import log_uniform
from scan_families import camera_place, airborne_village, terrestrial, typical_noise, usual_count
from scene import Scene
from shapes import Mesh, Relief, box, hull, moved, pipe, sheet, unit
from views import Rows


def plain(scene: Scene, clean: np.ndarray, triangle: np.ndarray, error: np.ndarray, settings: dict, **more) -> Drawn:
    """Points of a mesh with these errors (n, 3), seen by no sensor."""
    return Drawn(scene, plain_rows(scene, clean, triangle, clean + error), settings, has_sensor=False, **more)


def scene_of(name: str, mesh: Mesh) -> Scene:
    scene = Scene()
    scene.add(name, mesh)
    return scene.finish()


def spacing_over(scene: Scene, count: int) -> float:
    """The spacing of so many points spread evenly over a mesh."""
    a, b, c = (scene.vertices[scene.triangles[:, k]] for k in range(3))
    return float(np.sqrt(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 / count))


# ------------------------------------------------------------------------------------------------------------------- copies


@family("special", correlated=True)
def near_duplicates(rng: Random) -> Drawn:
    """A phone's lidar: each measured point is given out 3 to 10 times, within .1 of the spacing, with one error."""
    scene, place, target = camera_place(rng)
    settings = dict(base=rng.uniform(.05, .08), smooth=rng.uniform(.02, .08), blur=rng.uniform(.3, 1.2),
                    white=rng.uniform(.03, .12), steps=0.0)
    rows = cameras.stereo(scene, rng, place, target, int(usual_count(rng) / 5), **settings)
    times = rng.integers(3, 11, len(rows.points))
    same = np.repeat(np.arange(len(rows.points)), times)
    spacing = cKDTree(rows.clean).query(rows.clean, 7)[0][:, 1:].mean(1)
    given = rows.take(same)
    error = given.points - given.clean
    aside = .1 * spacing[same, None] * unit(rng.normal(size=error.shape)) * rng.random((len(same), 1))
    given.clean, triangle = scene.caster.closest(given.clean + aside)
    facing = scene.caster.normals[triangle]
    away = (facing * (given.clean - given.sensor)).sum(1, keepdims=True) > 0
    given.normal, given.part = np.where(away, -facing, facing), scene.part[triangle]
    given.points = given.clean + error
    return Drawn(scene, given, settings, same=same)


def _any_scan(rng: Random) -> Drawn:
    """A scan or an object with independent noise, a fifth of the usual size."""
    if rng.random() < .5:
        drawn = (terrestrial if rng.random() < .5 else airborne_village)(rng)
        drawn.rows = drawn.rows.take(np.sort(rng.permutation(len(drawn.rows.points))[:len(drawn.rows.points) // 3]))
        return drawn
    scene = objects.one_object(rng)
    clean, triangle = sampled(scene, rng, int(log_uniform(rng, 4_000, 15_000)))
    sigma = log_uniform(rng, .001, .01)
    return plain(scene, clean, triangle, sigma * rng.normal(size=clean.shape), {"sigma": sigma})


@family("special")
def copies_exact(rng: Random) -> Drawn:
    """Every point 2, 5 or 10 times."""
    drawn, times = _any_scan(rng), int(rng.choice([2, 5, 10]))
    same = np.tile(np.arange(len(drawn.rows.points)), times)
    same = same[rng.permutation(len(same))] if rng.random() < .5 else same
    return Drawn(drawn.scene, drawn.rows.take(same), drawn.settings | {"times": times}, same, has_sensor=drawn.has_sensor)


@family("special")
def copies_rounded(rng: Random) -> Drawn:
    """Every point 2, 5 or 10 times, the copies apart by what single precision rounds away (1e-6 of the extent)."""
    drawn = copies_exact(rng)
    points = drawn.rows.points
    drawn.rows.points = points + 1e-6 * np.ptp(points, axis=0).max() * rng.uniform(-1, 1, points.shape)
    return drawn


@family("special")
def copies_of_part(rng: Random) -> Drawn:
    """Two tiles that overlap: what lies in both, 5 to 45 % of the points, is there twice, in half of the clouds in feet and back."""
    drawn = _any_scan(rng)
    points = drawn.rows.points
    across = points @ unit(np.append(rng.normal(size=2), 0))
    width, begin = rng.uniform(.05, .45), rng.uniform(0, .5)
    twice = np.flatnonzero((across >= np.quantile(across, begin)) & (across <= np.quantile(across, begin + width)))
    same = np.concatenate([np.arange(len(points)), twice])
    rows = drawn.rows.take(same)
    if rng.random() < .5:
        foot = np.float32(.3048)
        rows.points[len(points):] = rows.points[len(points):].astype(np.float32) / foot * foot
    return Drawn(drawn.scene, rows, drawn.settings | {"width": width}, same, has_sensor=drawn.has_sensor, keep_axes=True)


@family("special")
def two_roundings(rng: Random) -> Drawn:
    """One scan exported twice, rounded to two steps below its noise."""
    drawn = _any_scan(rng)
    noise, count = typical_noise(drawn.rows), len(drawn.rows.points)
    rows = drawn.rows.take(np.tile(np.arange(count), 2))
    steps = noise * np.array([log_uniform(rng, .001, .1), log_uniform(rng, .01, .3)])
    for half, step in zip((slice(count), slice(count, None)), steps):
        rows.points[half] = np.round(rows.points[half] / step) * step
    return Drawn(drawn.scene, rows, drawn.settings | {"steps_to_noise": (steps / noise).tolist()}, np.tile(np.arange(count), 2),
                 has_sensor=drawn.has_sensor, keep_axes=True)


def _vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, triangles[:, k], np.cross(b - a, c - a))
    return unit(normals)


@family("special")
def triangle_soup(rng: Random) -> Drawn:
    """A noisy mesh whose triangles share no vertices: each position some six times."""
    mesh = (objects.supershape, objects.blob, objects.torus)[rng.integers(3)](rng)
    scene = Scene()
    scene.add("object", mesh)
    scene.finish(diagonal=1.0)
    whole = np.round(scene.vertices * 1e7).astype(np.int64) @ np.array([73856093, 19349663, 83492791])
    _, first, join = np.unique(whole, return_index=True, return_inverse=True)
    welded = join.ravel()[scene.triangles]
    vertices = scene.vertices[first]
    sigma = log_uniform(rng, .05, .6) * spacing_over(scene, len(vertices))
    noisy = vertices + sigma * rng.normal(size=vertices.shape)
    normals, corner = _vertex_normals(vertices, welded), welded.ravel()
    nothing = np.zeros(len(corner), bool)
    rows = Rows(noisy[corner], vertices[corner], normals[corner], np.zeros((len(corner), 3)),
                np.zeros(len(corner), np.int16), nothing, nothing)
    return Drawn(scene, rows, {"sigma": sigma}, same=corner, has_sensor=False)


# -------------------------------------------------------------------------------------------------------------------- grids


def _height_field(rng: Random, side: int) -> Mesh:
    """Over a grid of unit cells: a plane, waves, or steps."""
    x, y = np.meshgrid(np.arange(side, dtype=float), np.arange(side, dtype=float))
    kind = rng.integers(3)
    z = rng.uniform(-.4, .4) * x + rng.uniform(-.4, .4) * y
    if kind == 1:
        z = Relief(rng, 3, side * rng.uniform(.3, 1), side * rng.uniform(.02, .1))(x, y)
    elif kind == 2:
        z = rng.uniform(.5, 8) * (np.floor(x / side * rng.integers(2, 6)) % 2 + (y > side / 2))
    return sheet(x, y, z)


def _vertex_drawn(scene: Scene, error: np.ndarray, settings: dict, normal: np.ndarray | None = None) -> Drawn:
    """The vertices of a mesh, off by these errors."""
    normals = _vertex_normals(scene.vertices, scene.triangles) if normal is None else normal
    count = len(scene.vertices)
    nothing = np.zeros(count, bool)
    rows = Rows(scene.vertices + error, scene.vertices, normals, np.zeros((count, 3)), np.zeros(count, np.int16), nothing, nothing)
    return Drawn(scene, rows, settings, has_sensor=False, keep_axes=True)


@family("special")
def grid_noisy(rng: Random) -> Drawn:
    """A regular grid over a height field, white noise along z or in all directions."""
    side = int(rng.integers(100, 220))
    scene = scene_of("field", _height_field(rng, side))
    sigma = log_uniform(rng, .02, .8)
    error = sigma * rng.normal(size=scene.vertices.shape)
    if rng.random() < .5:
        error[:, :2] = 0
    return _vertex_drawn(scene, error, {"sigma": sigma})


@family("special")
def grid_waves(rng: Random) -> Drawn:
    """A regular grid, as of a terrain model, over ground whose least waves are some cells long and as high as the noise, which is
    white along z or in all directions."""
    side = int(rng.integers(100, 260))
    x, y = np.meshgrid(np.arange(side, dtype=float), np.arange(side, dtype=float) * log_uniform(rng, .6, 1.7))
    longest = side * log_uniform(rng, .1, .6)
    octaves = int(rng.integers(1, 2 + int(np.log2(longest / 8))))  # the shortest waves are 8 cells long, some of them 6
    ground = Relief(rng, octaves, longest, longest * log_uniform(rng, .002, .1), rng.uniform(1.5, 2.4))
    scene = scene_of("ground", sheet(x, y, ground(x, y)))
    sigma = log_uniform(rng, .02, .8)
    error = sigma * rng.normal(size=scene.vertices.shape) * ([0, 0, 1] if rng.random() < .7 else 1)
    return _vertex_drawn(scene, error, {"sigma": sigma})


def grid_cube(cells: int, size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Points of a box meshed by a regular grid, each once, and the outward normals (those of edges lie between)."""
    axis = np.arange(cells + 1)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    outer = grid[((grid == 0) | (grid == cells)).any(1)]
    return (outer / cells - .5) * size, unit((outer == cells).astype(float) - (outer == 0))


@family("clean")
def grid_clean(rng: Random) -> Drawn:
    """A box or a height field meshed by a regular grid, no noise."""
    if rng.random() < .5:
        scene = scene_of("field", _height_field(rng, int(rng.integers(60, 200))))
        return _vertex_drawn(scene, np.zeros_like(scene.vertices), {})
    size = tuple(rng.uniform(.6, 1.4, 3)) if rng.random() < .5 else (1.0, 1.0, 1.0)
    points, normal = grid_cube(int(rng.integers(16, 70)), size)
    half = np.array(size) / 2
    scene = scene_of("box", box(-half, half))
    nothing = np.zeros(len(points), bool)
    rows = Rows(points, points, normal, np.zeros_like(points), np.zeros(len(points), np.int16), nothing, nothing)
    return Drawn(scene, rows, has_sensor=False, keep_axes=rng.random() < .5)


@family("special", correlated=True)
def blurred_plane(rng: Random) -> Drawn:
    """A grid over a height field with noise of .1 to .8 cells, blurred over .6 to 4 cells."""
    side = int(rng.integers(120, 240))
    scene = scene_of("field", _height_field(rng, side))
    settings = dict(sigma=log_uniform(rng, .1, .8), blur=log_uniform(rng, .6, 4))
    error = np.zeros_like(scene.vertices)
    error[:, 2] = settings["sigma"] * blurred(rng, (side, side), settings["blur"]).ravel()
    return _vertex_drawn(scene, error, settings)


@family("special")
def loud_side(rng: Random) -> Drawn:
    """Random points of a height field or an object whose noise is 3 to 60 times as large on one side."""
    if rng.random() < .5:
        side = int(rng.integers(60, 200))
        scene = scene_of("field", _height_field(rng, side))
    else:
        scene = objects.one_object(rng)
    clean, triangle = sampled(scene, rng, usual_count(rng))
    spacing = spacing_over(scene, len(clean))
    quiet, times = log_uniform(rng, .01, .1) * spacing, log_uniform(rng, 3, 60)
    across = clean @ unit(rng.normal(size=3) * [1, 1, .3])
    place = (across - np.quantile(across, rng.uniform(.3, .8))) / (np.ptp(across) * log_uniform(rng, .01, .2))
    sigma = np.minimum(quiet * times ** (1 / (1 + np.exp(-place))), .8 * spacing)
    return plain(scene, clean, triangle, sigma[:, None] * rng.normal(size=clean.shape), {"quiet": quiet, "times": times})


@family("special")
def much_noise(rng: Random) -> Drawn:
    """Random points of a height field or an object with noise of 1.5 to 6 spacings."""
    scene = scene_of("field", _height_field(rng, int(rng.integers(60, 200)))) if rng.random() < .5 else objects.one_object(rng)
    clean, triangle = sampled(scene, rng, 2 * usual_count(rng))
    sigma = log_uniform(rng, 1.5, 6) * spacing_over(scene, len(clean))
    return plain(scene, clean, triangle, sigma * rng.normal(size=clean.shape), {"sigma": sigma})


@family("special")
def much_noise_along(rng: Random) -> Drawn:
    """Random points of a height field or an object with noise of 1 to 6 spacings along one direction, and less across."""
    scene = scene_of("field", _height_field(rng, int(rng.integers(60, 200)))) if rng.random() < .5 else objects.one_object(rng)
    clean, triangle = sampled(scene, rng, usual_count(rng))
    sigma = log_uniform(rng, 1, 6) * spacing_over(scene, len(clean))
    error = rng.normal(size=(len(clean), 1)) * unit(rng.normal(size=3)) + rng.uniform(.05, .4) * rng.normal(size=clean.shape)
    return plain(scene, clean, triangle, sigma * error, {"sigma": sigma})


@family("clean")
def clean_field(rng: Random) -> Drawn:
    """Random points of a height field, no noise."""
    scene = scene_of("field", _height_field(rng, int(rng.integers(60, 200))))
    clean, triangle = sampled(scene, rng, usual_count(rng))
    return plain(scene, clean, triangle, np.zeros_like(clean), {})


# ------------------------------------------------------------------------------------------------ crowns, thin things, relief


def crowns(rng: Random, centres: np.ndarray, radius: np.ndarray, count: int) -> np.ndarray:
    """Points within ellipsoids, on no surface."""
    which = rng.choice(len(centres), count, p=radius ** 2 / (radius ** 2).sum())
    inside = unit(rng.normal(size=(count, 3))) * rng.random((count, 1)) ** (1 / 2.5)
    return centres[which] + inside * radius[which, None] * [1, 1, 1.3]


@family("special")
def sparse_forest(rng: Random) -> Drawn:
    """A few points of the ground under 3 to 15 times as many of crowns, which are no surface."""
    half = rng.uniform(12, 40)
    ground = Relief(rng, int(rng.integers(1, 4)), rng.uniform(1, 3) * half, rng.uniform(.1, 2))
    x, y = np.meshgrid(*[np.linspace(-half - 2, half + 2, 160)] * 2)
    scene = scene_of("ground", sheet(x, y, ground(x, y)))
    scene.names.append("leaf")
    count, sigma = int(log_uniform(rng, 300, 6_000)), rng.uniform(.02, .1)
    above = np.c_[rng.uniform(-half, half, (count, 2)), np.full(count, 1e3)]
    ranges, normal, _ = scene.caster.cast(above, np.broadcast_to([0, 0, -1.0], above.shape))
    clean = above - ranges[:, None] * [0, 0, 1]
    trees = rng.uniform(-half, half, (max(3, int(half * half * 4 / log_uniform(rng, 25, 150))), 2))
    radius = rng.uniform(1.2, 4, len(trees))
    centres = np.c_[trees, ground(*trees.T) + radius * 1.3 + rng.uniform(1, 14, len(trees))]
    crown = crowns(rng, centres, radius, int(count * log_uniform(rng, 3, 15)))
    crown = crown[:80_000]
    crown_on, crown_triangle = scene.caster.closest(crown)
    points = np.concatenate([clean + sigma * rng.normal(size=(count, 1)) * [0, 0, 1], crown])
    part = np.concatenate([np.zeros(count, np.int16), np.ones(len(crown), np.int16)])
    nothing = np.zeros(len(points), bool)
    rows = Rows(points, np.concatenate([clean, crown_on]), np.concatenate([normal, scene.caster.normals[crown_triangle]]),
                np.zeros_like(points), part, nothing, nothing)
    rows = rows.take(rng.permutation(len(points)))
    return Drawn(scene, rows, {"sigma": sigma, "ground_share": count / len(points)}, has_sensor=False)


@family("special")
def wires(rng: Random) -> Drawn:
    """Wires and rods, some 20 to 2 noise thick, before a wall."""
    scene = Scene()
    scene.add("wall", box([-1, .35, -.6], [1, .4, .6]))
    radius = log_uniform(rng, .003, .02)
    for _ in range(rng.integers(4, 12)):
        a, b = rng.uniform([-.9, -.3, -.5], [.9, .25, .5], (2, 3))
        t = np.linspace(0, 1, 30)[:, None]
        sag = .1 * rng.uniform(-1, 1, 3) * 4 * t * (1 - t)
        scene.add("wire", pipe(a + t * (b - a) + sag, radius * rng.uniform(.6, 1.5), 16))
    scene.finish()
    clean, triangle = (even_points if rng.random() < .5 else cameras.surface_points)(scene, rng, usual_count(rng))
    sigma = radius * log_uniform(rng, .05, 1)
    return plain(scene, clean, triangle, sigma * rng.normal(size=clean.shape), {"radius": radius, "sigma": sigma})


@family("special")
def bristles(rng: Random) -> Drawn:
    """Tubes about as thick as their points are apart, as those of fences, brushes, rebars, side by side or anyhow."""
    scene, radius = Scene(), log_uniform(rng, .002, .02)
    count, spacing = usual_count(rng), radius * log_uniform(rng, .4, 1.4)
    tubes, side_by_side = int(rng.integers(20, 60)), rng.random() < .5
    length = count * spacing ** 2 / (2 * np.pi * radius * tubes)
    for k in range(tubes):
        along = np.array([0, 0, 1.0]) if side_by_side else unit(rng.normal(size=3))
        middle = np.array([k * radius * 8, 0, 0]) if side_by_side else rng.uniform(-.5, .5, 3) * max(length, 60 * radius)
        scene.add("bristle", pipe(middle + np.linspace(-.5, .5, 12)[:, None] * length * along, radius, 24))
    scene.finish()
    clean, triangle = cameras.surface_points(scene, rng, count)
    sigma = radius * log_uniform(rng, .02, .3)
    error = scene.caster.normals[triangle] * sigma * rng.normal(size=(len(clean), 1))
    return plain(scene, clean, triangle, error, {"radius": radius, "spacing": spacing, "sigma": sigma})


@family("special")
def sparse_beside_dense(rng: Random) -> Drawn:
    """Ground of which a patch has 16 to 2,000 times the density of the rest, noise of a fifth of the own spacing or alike."""
    side, times = 120, log_uniform(rng, 4, 45)
    scene = scene_of("field", _height_field(rng, side))
    count, share = usual_count(rng), rng.uniform(.3, .7)
    width = side * np.sqrt(share / (1 - share)) / times
    corner = rng.uniform(0, side - 1 - width, 2)
    sparse, _ = cameras.surface_points(scene, rng, int(count * (1 - share)))
    dense = np.column_stack([corner + width * rng.random((int(count * share), 2)), np.zeros(int(count * share))])
    dense, _ = scene.caster.closest(dense + [0, 0, 0])
    clean, triangle = scene.caster.closest(np.concatenate([sparse, dense]))
    spacing = np.repeat([side / np.sqrt(len(sparse)), width / np.sqrt(len(dense))], [len(sparse), len(dense)])
    sigma = .2 * spacing if rng.random() < .5 else .2 * spacing.min()
    error = np.reshape(sigma * np.ones(len(clean)), (-1, 1)) * rng.normal(size=(len(clean), 1))
    return plain(scene, clean, triangle, scene.caster.normals[triangle] * error, {"times": times, "share": share})


@family("special")
def thin_plates(rng: Random) -> Drawn:
    """Plates seen from both sides, 2 to 5 noise thick."""
    scene, sigma = Scene(), log_uniform(rng, .001, .01)
    thickness = sigma * rng.uniform(2, 5)
    for k in range(rng.integers(1, 5)):
        low = np.array([*rng.uniform(-.2, .2, 2), k * .5])
        plate = box(low, low + [*rng.uniform(.5, 1.2, 2), thickness], rng.uniform(0, 90))
        scene.add("plate", plate if rng.random() < .6 else moved((plate[0][:, [2, 0, 1]], plate[1]), [k, 0, 0]))
    scene.finish()
    clean, triangle = (even_points if rng.random() < .5 else cameras.surface_points)(scene, rng, usual_count(rng))
    along_normal = scene.caster.normals[triangle] * sigma * rng.normal(size=(len(clean), 1))
    error = along_normal if rng.random() < .5 else sigma * rng.normal(size=clean.shape)
    return plain(scene, clean, triangle, error, {"sigma": sigma, "thickness_to_noise": thickness / sigma})


@family("special")
def fine_relief(rng: Random) -> Drawn:
    """A surface with relief of 4 to 14 spacings in length and 1 to 8 noise in height: shape, not noise."""
    count = usual_count(rng)
    spacing = 1 / np.sqrt(count)
    sigma, length = spacing * log_uniform(rng, .03, .6), spacing * rng.uniform(4, 14)
    x, y = np.meshgrid(*[np.linspace(0, 1, min(int(6 / length), 420))] * 2)
    z = Relief(rng, 1, length, sigma * rng.uniform(1, 8))(x, y)
    if rng.random() < .3:
        z = np.where(z > 0, z.max() / 2, z.min() / 2)
    scene = scene_of("relief", sheet(x, y, z + rng.uniform(0, .1) * np.cos(3 * x)))
    clean, triangle = (even_points if rng.random() < .5 else cameras.surface_points)(scene, rng, count)
    return plain(scene, clean, triangle, sigma * rng.normal(size=clean.shape), {"sigma": sigma, "length": length})


@family("special")
def crystals(rng: Random) -> Drawn:
    """Many small convex bodies with sharp edges, a few spacings wide."""
    scene = Scene()
    for at in rng.uniform(-.5, .5, (int(rng.integers(30, 120)), 3)) * [1, 1, .3]:
        scene.add("crystal", hull(at + rng.uniform(.02, .12) * rng.normal(size=(8, 3))))
    scene.finish()
    clean, triangle = cameras.surface_points(scene, rng, usual_count(rng))
    sigma = spacing_over(scene, len(clean)) * log_uniform(rng, .05, .5)
    return plain(scene, clean, triangle, sigma * rng.normal(size=clean.shape), {"sigma": sigma})
