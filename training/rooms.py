# SPDX-License-Identifier: Apache-2.0
"""Random scenes indoors and on a bench, in metres; the floor is z = 0."""
import numpy as np

from objects import Random, log_uniform, plate, solid, stands_on
from scene import Scene
from shapes import bent, box, lathe, pipe, rod, sheet, stand, turned, windowed


def _shell(scene: Scene, rng: Random, width: float, depth: float, height: float) -> None:
    """Floor, ceiling, and walls with niches."""
    scene.add("wall", box([-.2, -.2, -.2], [width + .2, depth + .2, 0]))
    scene.add("wall", box([-.2, -.2, height], [width + .2, depth + .2, height + .1]))
    corners = [(0, 0), (0, depth), (width, depth), (width, 0), (0, 0)]
    for start, end in zip(corners, corners[1:]):
        length, niches, x = np.hypot(*np.subtract(end, start)), [], .4
        while rng.random() < .7 and x < length - 1.2:
            wide, low = rng.uniform(.5, 1.5), rng.uniform(0, 1.1)
            niches.append((x, low, min(wide, length - x - .2), rng.uniform(.7, min(1.6, height - low - .1))))
            x += wide + rng.uniform(.3, 1.5)
        scene.add("wall", stand(windowed(length, height, niches, rng.uniform(.04, .3)), start, end))


def _table(scene: Scene, rng: Random, x: float, y: float) -> None:
    width, depth, height = rng.uniform([.7, .5, .4], [1.8, 1.0, .9])
    degrees, thickness = rng.uniform(0, 90), rng.uniform(.015, .05)
    scene.add("table", box([x - width / 2, y - depth / 2, height - thickness], [x + width / 2, y + depth / 2, height],
                           degrees, chamfer=.004 * (rng.random() < .4)))
    radius = rng.uniform(.012, .04)
    for sx, sy in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        leg = rod(x + sx * (width / 2 - .06), y + sy * (depth / 2 - .06), 0, height - thickness, radius, 24)
        scene.add("table", turned(leg, degrees, (x, y)))
    for _ in range(rng.integers(0, 5)):
        scene.add("thing", solid(rng, x + rng.uniform(-.3, .3), y + rng.uniform(-.2, .2), height, log_uniform(rng, .06, .35)))


def _shelves(scene: Scene, rng: Random, x: float, y: float, top: float) -> None:
    """Boards of 12 to 30 mm with folders on them."""
    length, depth, thickness = rng.uniform([.8, .2, .012], [2.0, .45, .03])
    degrees, z = rng.uniform(0, 180), .05
    while z < top:
        scene.add("shelf", box([x - length / 2, y - depth / 2, z], [x + length / 2, y + depth / 2, z + thickness], degrees))
        gap, at = rng.uniform(.25, .45), x - length / 2 + .02
        while at < x + length / 2 - .1 and rng.random() < .97:
            wide = rng.uniform(.015, .08)
            folder = box([at, y - depth / 2 + rng.uniform(0, .08), z + thickness],
                         [at + wide, y + depth / 2 - .02, z + thickness + rng.uniform(.5, .9) * gap])
            scene.add("folder", turned(folder, degrees, (x, y)))
            at += wide + (.002 if rng.random() < .8 else rng.uniform(.05, .3))
        z += gap


def _corrugated(scene: Scene, rng: Random, x: float, y: float, top: float) -> None:
    u, z = np.meshgrid(np.linspace(0, rng.uniform(.6, 1.8), 240), [.1, rng.uniform(1, top)])
    angle = rng.uniform(0, 2 * np.pi)
    off = rng.uniform(.01, .05) * np.sin(2 * np.pi * u / rng.uniform(.06, .3))
    scene.add("sheet", sheet(x + u * np.cos(angle) - off * np.sin(angle), y + u * np.sin(angle) + off * np.cos(angle), z))


def _stairs(scene: Scene, rng: Random, x: float, y: float) -> None:
    degrees, count = rng.uniform(0, 360), int(rng.integers(4, 12))
    rise, tread, width = rng.uniform([.15, .22, .7], [.19, .32, 1.2])
    for k in range(count):
        step = box([x + tread * k, y - width / 2, 0], [x + tread * count, y + width / 2, rise * (k + 1)])
        scene.add("stairs", turned(step, degrees, (x, y)))


def _furnish(scene: Scene, rng: Random, count: int) -> None:
    width, depth, height = scene.size
    for _ in range(count):
        x, y, kind = rng.uniform(.5, width - .5), rng.uniform(.5, depth - .5), rng.integers(9)
        if kind <= 1:
            scene.add("thing", solid(rng, x, y, 0, log_uniform(rng, .2, 1.6)))
        elif kind == 2:
            _table(scene, rng, x, y)
        elif kind == 3:
            _shelves(scene, rng, x, y, min(2, height - .3))
        elif kind == 4:
            scene.add("thing", stands_on(rng, log_uniform(rng, .3, 1.2), x, y))
        elif kind == 5:
            scene.add("column", rod(x, y, 0, height, log_uniform(rng, .01, .3), 64))
        elif kind == 6:
            scene.add("panel", plate(rng, x, y, 0, rng.uniform(.4, 1.5)))
        elif kind == 7:
            _corrugated(scene, rng, x, y, height - .2)
        else:
            _stairs(scene, rng, x, y)


def room(rng: Random) -> Scene:
    """An office or flat."""
    scene = Scene()
    scene.size = tuple(rng.uniform([3.5, 3.2, 2.3], [9, 7, 3.8]))
    width, depth, height = scene.size
    _shell(scene, rng, *scene.size)
    _furnish(scene, rng, int(rng.integers(6, 15)))
    for _ in range(rng.integers(0, 7)):
        z, y, end, radius = *rng.uniform([.3, .3, 1], [height - .2, depth - .3, width - .3]), log_uniform(rng, .006, .09)
        down = .05 if rng.random() < .5 else height - .05
        scene.add("pipe", pipe(bent([[.02, y, z], [end, y, z], [end, y, down]], min(3 * radius, .15)), radius))
    return scene.finish()


def _pipe_run(scene: Scene, rng: Random) -> None:
    """A pipe with one bend and, if it is thick, a pair of flanges."""
    width, depth, height = scene.size
    radius = log_uniform(rng, .008, .14)
    start, y, z, end = rng.uniform([0, .4, .6], [2, depth - .3, height - .6]).tolist() + [rng.uniform(2.6, width - .4)]
    aside = [end, y + rng.choice([-1, 1]) * rng.uniform(.6, 1.5), z]
    down = [end, y, .05 if rng.random() < .5 else height - .05]
    path = np.array([[start, y, z], [end, y, z], aside if rng.random() < .4 else down])
    if rng.random() < .5:
        path = path[:, [1, 0, 2]] * [width / depth * .98, depth / width * .98, 1]
    scene.add("pipe", pipe(bent(path, min(3 * radius, .25)), radius, 32))
    if radius > .03:
        along = (path[1] - path[0]) / np.linalg.norm(path[1] - path[0])
        for share in rng.random(2) * .8:
            at = path[0] + share * (path[1] - path[0])
            scene.add("flange", pipe([at, at + .02 * along], radius + .035, 48))


def works(rng: Random) -> Scene:
    """A plant room: pipes, beams, tanks, a ladder, a grating."""
    scene = Scene()
    scene.size = tuple(rng.uniform([5, 4, 3], [11, 8, 4.5]))
    width, depth, height = scene.size
    _shell(scene, rng, *scene.size)
    _furnish(scene, rng, int(rng.integers(2, 6)))
    for _ in range(rng.integers(8, 22)):
        _pipe_run(scene, rng)
    for _ in range(rng.integers(2, 6)):
        x, y, degrees, w, t = rng.uniform([.5, .5, 0, .04, .005], [width - .5, depth - .5, 90, .1, .012])
        for low, high in (((x - w, y - t / 2), (x + w, y + t / 2)), ((x - w, y - w), (x - w + t, y + w)),
                          ((x + w - t, y - w), (x + w, y + w))):
            scene.add("beam", turned(box([*low, 0], [*high, height - .1]), degrees, (x, y)))
    for _ in range(rng.integers(1, 4)):
        radius, top = rng.uniform(.3, .9), rng.uniform(1, min(2.4, height - .8))
        head = [(radius * np.cos(t), top + radius * .4 * np.sin(t)) for t in np.linspace(.1, np.pi / 2, 10)]
        at = (rng.uniform(1, width - 1), rng.uniform(1, depth - 1), 0)
        scene.add("tank", lathe([(0, .3), (radius * .8, .35), (radius, .6), (radius, top), *head], at, 96))
    x, y = rng.uniform(.5, width - 1), rng.uniform(.5, depth - .5)
    for z in np.arange(.3, height - .4, .28):
        scene.add("ladder", pipe([[x, y, z], [x + .42, y, z]], .012, 16))
    for k in range(20):
        scene.add("grating", box([1 + .12 * k, depth / 2, .3], [1.004 + .12 * k, depth / 2 + 1, .34]))
    return scene.finish()


def bench(rng: Random) -> Scene:
    """Objects on a table before a wall; nothing to stand in."""
    scene = Scene()
    scene.size = None
    scene.add("wall", box([-3, .9, -1.2], [3, 1.0, 2.4]))
    scene.add("wall", box([-3, -3, -1.1], [3, 1.0, -.8]))
    scene.add("table", box([-1, -.6, -.04], [1, .55, 0], chamfer=.005))
    for _ in range(rng.integers(5, 13)):
        x, y, kind = rng.uniform(-.7, .7), rng.uniform(-.4, .4), rng.integers(5)
        if kind <= 1:
            scene.add("object", stands_on(rng, rng.uniform(.15, .5), x, y))
        elif kind == 4:
            scene.add("panel", plate(rng, x, y, 0, rng.uniform(.1, .3)))
        else:
            scene.add("thing", solid(rng, x, y, 0, log_uniform(rng, .05, .4)))
    t = np.linspace(0, 1, 60)
    scene.add("cable", pipe(np.stack([-.65 + 1.2 * t, .3 - .62 * t + .06 * np.sin(9 * t), .0035 + 0 * t], 1), .0035, 14))
    return scene.finish()
