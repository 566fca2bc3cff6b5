# SPDX-License-Identifier: Apache-2.0
"""The clouds of cases.py: files of known surfaces, and variants made here. Each maker takes the folder of the files (or
None) and gives pairs (label, cloud)."""
import pathlib
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

import cloud as clouds
import families
import lasers
import objects
from errors import blurred
from rays import Caster
from scene import LEAF, Scene
from shapes import Mesh, box, leaves, pipe, rod, sheet, unit
from special_families import grid_cube

Files = pathlib.Path | None


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=float))))


def spacing_of(points: np.ndarray) -> float:
    """Median distance to the nearest other position."""
    once = np.unique(np.asarray(points, np.float32), axis=0)
    return float(np.median(cKDTree(once).query(once, 2)[0][:, 1]))


def write(path: pathlib.Path, source) -> None:
    """A PLY of points, or of points with classes."""
    if isinstance(source, np.ndarray):
        clouds.write_ply(path, source)
        return
    points, classes = source
    row = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("classification", "u1")])
    rows = np.empty(len(points), row)
    rows["x"], rows["y"], rows["z"], rows["classification"] = *points.T, classes
    head = ("ply\nformat binary_little_endian 1.0\n" f"element vertex {len(points)}\n"
            "property float x\nproperty float y\nproperty float z\nproperty uchar classification\nend_header\n")
    path.write_bytes(head.encode() + rows.tobytes())


def read(files: pathlib.Path, name: str) -> np.ndarray:
    return clouds.read_ply(files / f"{name}.ply")[0]


class Known:
    """Points whose true surface is a function (points to distances) or a mesh; limit: of rms after over before."""

    def __init__(self, points: np.ndarray, distance=None, mesh: Mesh | None = None, noise: float | None = None, normals=None,
                 limit: float = .4):
        self.points, self.limit = np.asarray(points, np.float32), limit
        self.distance = distance or Caster(*mesh).distance
        self.noise = noise or rms(self.distance(self.points.astype(float)))
        self.normals = normals

    def error(self, points: np.ndarray) -> float:
        return rms(self.distance(points.astype(float)))

    def most_moved(self, points: np.ndarray) -> float:
        """In spacings."""
        return float(np.linalg.norm(points.astype(float) - self.points, axis=1).max() / spacing_of(self.points))

    def consistent(self, attributes: dict) -> float:
        """Share of normals on the side of the majority."""
        given = np.stack([attributes[name] for name in ("nx", "ny", "nz")], 1)
        side = (given * self.normals).sum(1) > 0
        return float(max(side.mean(), 1 - side.mean()))


def plane_distance(points: np.ndarray) -> np.ndarray:
    return np.abs(points[:, 2])


# ------------------------------------------------------------------------------------------------------------------- forests


@dataclass
class Forest:
    """Ground and crowns; source is what the program reads."""
    source: object
    points: np.ndarray
    ground: np.ndarray
    distance: object

    def ground_error(self, points: np.ndarray | None) -> float:
        return rms(self.distance((self.points if points is None else points)[self.ground].astype(float)))

    def crowns_moved(self, points: np.ndarray) -> float:
        """Share of the crown points that moved by more than a tenth of their spacing."""
        crown = self.points[~self.ground].astype(float)
        spacing = cKDTree(crown).query(crown, 7)[0][:, 1:].mean(1)
        return float((np.linalg.norm(points[~self.ground] - crown, axis=1) > .1 * spacing).mean())


def read_las(path: pathlib.Path) -> tuple[np.ndarray, np.ndarray]:
    """Positions and classes of an uncompressed LAS of point formats 0 to 5."""
    data = path.read_bytes()
    start, = np.frombuffer(data, "<u4", 1, 96)
    length, count = int(np.frombuffer(data, "<u2", 1, 105)[0]), int(np.frombuffer(data, "<u4", 1, 107)[0])
    scale, offset = np.frombuffer(data, "<f8", 6, 131).reshape(2, 3)
    rows = np.frombuffer(data, "u1", count * length, start).reshape(count, length)
    return rows[:, :12].copy().view("<i4") * scale + offset, rows[:, 15] & 31


def plane_through(points: np.ndarray):
    """Heights over the least squares plane through points, as a function."""
    def columns(p):
        return np.c_[np.ones(len(p)), p[:, :2]]

    fit = np.linalg.lstsq(columns(points), points[:, 2], rcond=None)[0]
    return lambda p: p[:, 2] - columns(p) @ fit


def forests(files: Files) -> Iterator[tuple[str, Forest]]:
    if files:
        points, classes = read_las(files / "sparse_forest.las")
        ground = classes == 2
        yield "file", Forest(files / "sparse_forest.las", points, ground, plane_through(points[ground]))
    for seed in (101, 102, 103):
        drawn = families.draw("sparse_forest", seed)
        classes = np.where(drawn.surface, 2, 5)
        yield f"made {seed}", Forest((drawn.points, classes), drawn.points, drawn.surface, drawn.caster().distance)


# -------------------------------------------------------------------------------------------------------------------- copies


@dataclass
class Repeated:
    """Positions of which each stands for several points."""
    once: np.ndarray                              # each measurement one time
    points: np.ndarray
    same: np.ndarray                              # which of `once` a point is
    distance: object
    one_copy: np.ndarray = field(init=False)

    def __post_init__(self):
        self.one_copy = np.arange(len(self.once))

    @property
    def noise(self) -> float:
        return rms(self.distance(self.once.astype(float)))

    def error(self, points: np.ndarray, same: np.ndarray) -> float:
        """Rms over the measurements, by one point of each."""
        _, first = np.unique(same, return_index=True)
        return rms(self.distance(points[first].astype(float)))

    def apart(self, points: np.ndarray) -> float:
        """Largest distance of a copy from the first one, beyond what it was before, in spacings."""
        _, first, back = np.unique(self.same, return_index=True, return_inverse=True)
        far, was = (np.linalg.norm((p - p[first][back.ravel()]).astype(float), axis=1) for p in (points, self.points))
        return float((far - was).max() / spacing_of(self.once))


def of_repeats(points: np.ndarray, distance) -> Repeated:
    once, same = np.unique(points, axis=0, return_inverse=True)
    return Repeated(once, points, same.ravel(), distance)


def repeated(files: Files) -> Iterator[tuple[str, Repeated]]:
    if files:
        yield "file", of_repeats(read(files, "repeated_points_plane"), plane_distance)
    rng = np.random.default_rng(201)
    once = np.c_[rng.random((3000, 2)), .005 * rng.normal(size=3000)].astype(np.float32)
    for times, off in ((2, 0), (5, 0), (10, 0), (2, 1e-6), (5, 1e-6)):
        same = rng.permutation(np.tile(np.arange(len(once)), times))
        points = (once[same] + off * rng.uniform(-1, 1, (len(same), 3))).astype(np.float32)
        yield f"plane x{times}" + (", off by 1e-6" if off else ""), Repeated(once, points, same, plane_distance)
    drawn = families.draw("multiview_object", 202)
    once = drawn.points[rng.permutation(len(drawn.points))[:8000]]
    same = np.tile(np.arange(len(once)), 3)
    yield "object x3", Repeated(once, once[same], same, drawn.caster().distance)


def soups(files: Files) -> Iterator[tuple[str, Repeated]]:
    if files:
        yield "file", of_repeats(read(files, "unwelded_sphere"), lambda p: np.linalg.norm(p, axis=1) - 1)
    for seed in (211, 212):
        drawn = families.draw("triangle_soup", seed)
        yield f"made {seed}", of_repeats(drawn.points, drawn.caster().distance)


def pairs(points: np.ndarray, distance) -> Repeated:
    """Of points that each have their other copy as the nearest one."""
    partner = cKDTree(points).query(points, 2)[1][:, 1]
    first, same = np.unique(np.minimum(np.arange(len(points)), partner), return_inverse=True)
    return Repeated(points[first], points, same.ravel(), distance)


def two_exports(files: Files) -> Iterator[tuple[str, Repeated]]:
    if files:
        yield "file", pairs(read(files, "same_scan_two_roundings"), plane_distance)
    rng = np.random.default_rng(221)
    for label, count, steps in (("plane, .001 and .0001", 4000, (.001, .0001)), ("plane, .003 and .0004", 8000, (.003, .0004))):
        once = np.c_[rng.random((count, 2)), .01 * rng.normal(size=count)]
        both = np.concatenate([np.round(once / step) * step for step in steps]).astype(np.float32)
        order = rng.permutation(len(both))
        yield label, Repeated(both[:count], both[order], np.tile(np.arange(count), 2)[order], plane_distance)
    drawn = families.draw("two_roundings", 222)
    half = len(drawn.points) // 2
    yield "made 222", Repeated(drawn.points[:half], drawn.points, np.tile(np.arange(half), 2), drawn.caster().distance)


# ------------------------------------------------------------------------------------------------------------ steps and grids


def stepped_image(side: int, slope: float, units: float, cell: float, white: float = 0.0) -> Known:
    """A depth image of a surface that recedes along the columns, depth 1 + slope * column; 1 / depth comes in whole 1 / units.
    cell: of a column, at depth 1."""
    column, row = np.meshgrid(np.arange(side), np.arange(side))

    def placed(depth):
        return (column - side / 2) * cell * depth, (row - side / 2) * cell * depth, depth

    true = 1 + slope * column
    shaken = true + white * np.random.default_rng(231).normal(size=true.shape)
    points = np.stack([axis.ravel() for axis in placed(units / np.round(units / shaken))], 1)
    return Known(points, mesh=sheet(*placed(true.astype(float))))


def stepped(files: Files) -> Iterator[tuple[str, Known]]:
    if files:
        yield "file", Known(read(files, "disparity_steps"), stepped_image(60, .006, 400, .004).distance)
    yield "40,000 points", stepped_image(200, .0018, 400, .0012)
    yield "10,000 points, some white noise", stepped_image(100, .003, 300, .0024, white=.0005)
    yield "wide steps", stepped_image(150, .0007, 300, .0016)


def clean_grids(files: Files) -> Iterator[tuple[str, Known]]:
    unit_box = box([0, 0, 0], [1, 1, 1])
    if files:
        yield "file", Known(read(files, "clean_grid_cube"), mesh=unit_box)
    yield "cube of 40 cells", Known(grid_cube(40, (1, 1, 1))[0], mesh=box([-.5] * 3, [.5] * 3))
    yield "box of 25 cells", Known(grid_cube(25, (1, .7, .4))[0], mesh=box([-.5, -.35, -.2], [.5, .35, .2]))
    x, y = np.meshgrid(np.arange(80.0), np.arange(80.0))
    field_ = sheet(x, y, 6 * (x // 20 % 2) + 4 * (y > 37))
    yield "steps over a grid", Known(field_[0], mesh=field_)


# ---------------------------------------------------------------------------------------------------- normals, noise, plates


def torus_distance(large: float, small: float):
    """To a ring around z, signed, as a function of points."""
    return lambda p: np.hypot(np.hypot(p[:, 0], p[:, 1]) - large, p[:, 2]) - small


def torus_points(rng: np.random.Generator, count: int, large: float, small: float, noise: float) -> Known:
    a, b = rng.uniform(0, 2 * np.pi, (2, count))
    normals = np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], 1)
    points = large * np.stack([np.cos(a), np.sin(a), 0 * a], 1) + small * normals + noise * rng.normal(size=(count, 3))
    return Known(points, torus_distance(large, small), normals=normals)


def with_normals(files: Files) -> Iterator[tuple[str, Known]]:
    if files:
        points = read(files, "torus_normals").astype(float)
        ring = np.c_[2 * unit(points[:, :2]), np.zeros(len(points))]
        yield "file", Known(points, torus_distance(2, .5), normals=unit(points - ring))
    rng = np.random.default_rng(241)
    yield "torus 3 : 1", torus_points(rng, 8000, 1.5, .5, .01)
    yield "torus 8 : 1", torus_points(rng, 6000, 2, .25, .01)
    mesh = objects.blob(rng)
    clean = mesh[0][rng.permutation(len(mesh[0]))[:6000]]
    yield "blob", Known(clean + .005 * rng.normal(size=clean.shape), mesh=mesh, normals=unit(clean))


def blurred_planes(files: Files) -> Iterator[tuple[str, Known]]:
    x, y = np.meshgrid(np.arange(200.0), np.arange(200.0))
    for seed, sigma, blur, limit in ((251, .5, .8, .4), (252, .3, 1.2, .55), (253, .8, .8, .4)):
        z = sigma * blurred(np.random.default_rng(seed), x.shape, blur)
        yield f"noise {sigma}, blur {blur}", Known(np.stack([x.ravel(), y.ravel(), z.ravel()], 1), plane_distance, limit=limit)


class Plate(Known):
    """A plate around z = 0."""

    def __init__(self, points: np.ndarray, upper: np.ndarray, thickness: float, size: float, noise: float):
        half = np.array([size, size, thickness]) / 2
        super().__init__(points, mesh=box(-half, half), noise=noise)
        self.upper, self.true = upper, thickness
        self.inner = (np.abs(points[:, :2]) < size / 2 - 10 * noise).all(1)

    def thickness(self, points: np.ndarray) -> float:
        """Between the mean heights of both sides, over the true one."""
        z = points[:, 2]
        return float((z[self.upper & self.inner].mean() - z[~self.upper & self.inner].mean()) / self.true)


def plates(files: Files) -> Iterator[tuple[str, Plate]]:
    for seed, thickness, noise, count in ((261, 2.0, .6, 40_000), (262, 2.0, .5, 30_000), (263, 3.0, .75, 20_000)):
        rng = np.random.default_rng(seed)
        upper = rng.random(count) < .5
        z = np.where(upper, .5, -.5) * thickness
        points = np.c_[rng.uniform(-50, 50, (count, 2)), z] + noise * rng.normal(size=(count, 3))
        yield f"{thickness} thick, noise {noise}", Plate(points, upper, thickness, 100.0, noise)


@dataclass
class Walls:
    points: np.ndarray
    mixed: np.ndarray


def between_walls(files: Files) -> Iterator[tuple[str, Walls]]:
    """Depth images of two walls; at the border a pixel in each row lies between them."""
    for seed, near, far, noise in ((271, 1.0, 2.0, .001), (272, 1.5, 2.2, .003), (273, .8, 1.1, .001)):
        rng = np.random.default_rng(seed)
        column, row = np.meshgrid(np.arange(200), np.arange(300))
        depth = np.where(column < 100, near, far) + noise * rng.normal(size=column.shape)
        mixed = column == 100
        share = rng.uniform(.15, .85, column.shape)
        depth = np.where(mixed, near + share * (far - near), depth)
        points = np.stack([(column - 100) * .004 * depth, (row - 150) * .004 * depth, depth], -1).reshape(-1, 3)
        yield f"{near} and {far} m, noise {noise}", Walls(points.astype(np.float32), mixed.ravel())


@dataclass
class Garden:
    points: np.ndarray
    mixed: np.ndarray
    part: np.ndarray                              # names
    place: np.ndarray                             # of the sensor


def garden(seed: int) -> Garden:
    """A terrestrial scan of one or two trees of loose leaves, three wires, a board and a post before a wall; trees of even
    seeds are large."""
    rng, scene = np.random.default_rng(seed), Scene()
    scene.add("wall", box([-6, 8, 0], [6, 8.2, 5]))
    scene.add("ground", box([-8, .3, -.2], [8, 8.2, 0]))
    scene.add("board", box([-2.5 + rng.uniform(-.5, .5), 5, .5], [-.8, 5.04, 2.2]))
    scene.add("post", rod(1.0, 5.5 + rng.uniform(-.5, .5), 0, 3, .06))
    for _ in range(3):
        a, b = [np.array([x, rng.uniform(3.5, 7.5), rng.uniform(2.2, 4)]) for x in (-5, 5)]
        t = np.linspace(0, 1, 60)[:, None]
        scene.add("wire", pipe(a + t * (b - a) - [0, 0, .3] * (4 * t * (1 - t)), rng.uniform(.006, .02), 12))
    large = seed % 2 == 0
    for k in range(int(rng.integers(1, 3)) if large else 1):
        centre = np.array([rng.uniform(1.6, 3.5) - 5.5 * k, rng.uniform(3.5, 6.5), rng.uniform(1.8, 2.8)])
        radius = rng.uniform(.9, 1.5) if large else rng.uniform(.4, .8)
        count = int(rng.integers(600, 2000) if large else rng.integers(100, 500))
        scene.add(LEAF, leaves(rng, centre, radius, count, rng.uniform(.03, .08)))
        scene.add("trunk", rod(centre[0], centre[1], 0, centre[2], .08))
    scene.finish()
    place = np.array([rng.uniform(-1, 1), rng.uniform(-2, 1), 1.6])
    sigma, count = float(np.exp(rng.uniform(np.log(.0006), np.log(.004)))), int(rng.integers(30_000, 60_000))
    rows = lasers.terrestrial(scene, rng, [lasers.Station(tuple(place), (40, 140), (-35, 30))], count, sigma, 1e-5,
                              radius=rng.uniform(.002, .005), divergence=rng.uniform(.0003, .0012))
    return Garden(rows.points.astype(np.float32), rows.mixed, np.array(scene.names)[rows.part], place)


def gardens(files: Files) -> Iterator[tuple[str, list[Garden]]]:
    yield "twelve gardens", [garden(seed) for seed in range(20, 32)]
