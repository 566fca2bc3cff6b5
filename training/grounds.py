# SPDX-License-Identifier: Apache-2.0
"""Random scenes outdoors, in metres."""
import numpy as np

from objects import Random, log_uniform, solid
from scene import LEAF, Scene
from shapes import (Relief, arcade, box, hull, lathe, leaves, moved, pebble, pipe, rod, sheet, stand, turned, windowed)


def _facade(rng: Random, length: float):
    """An arcade or rows of windows."""
    top = rng.uniform(6, 12)
    if rng.random() < .4:
        pitch = rng.uniform(2.6, 4.5)
        arches = [(pitch * (k + .5), pitch * rng.uniform(.25, .4), rng.uniform(1.8, 3)) for k in range(int(length / pitch))]
        return arcade(length, top, arches, rng.uniform(.5, 2.2))
    pitch, (width, height) = rng.uniform(1.9, 3.5), rng.uniform([.8, 1.1], [1.4, 1.9])
    rows = np.arange(rng.uniform(.8, 2), top - 2, 3.0)
    windows = [(.6 + pitch * k, z, width, height) for k in range(int((length - 1) / pitch)) for z in rows]
    return windowed(length, top, windows, rng.uniform(.08, .35))


def _street_ground(rng: Random, length: float, width: float):
    """Sloped, perhaps cobbled, perhaps with kerbs."""
    x, y = np.meshgrid(np.linspace(-2, length + 2, 280), np.linspace(-2, width + 2, 160))
    z = rng.uniform(-.03, .03) * (x - length / 2) + Relief(rng, 3, 20, rng.uniform(0, .1))(x, y)
    if rng.random() < .4:
        pitch = rng.uniform(.14, .3)
        stones = np.abs(np.sin(np.pi * x / pitch)) ** .5 * np.abs(np.sin(np.pi * y / pitch)) ** .5
        z = z + rng.uniform(.003, .015) * stones
    if rng.random() < .6:
        pavement = rng.uniform(2, 4)
        z = z + rng.uniform(.05, .16) * ((y < pavement) | (y > width - pavement))
    return sheet(x, y, z)


def _street_things(scene: Scene, rng: Random, length: float, width: float) -> None:
    def somewhere(margin: float):
        return rng.uniform(margin, length - margin), rng.uniform(margin, width - margin)

    for _ in range(rng.integers(3, 9)):
        x, y = somewhere(1)
        scene.add("post", rod(x, y, -.5, rng.uniform(1, 6), rng.uniform(.02, .12), 24))
        scene.add("sign", box([x - .3, y - .15, 1.9], [x + .3, y - .146, rng.uniform(2.2, 2.9)], rng.uniform(0, 180)))
    for _ in range(rng.integers(2, 8)):
        (x, y), degrees = somewhere(3), rng.uniform(-15, 15)
        bonnet, end, roof = rng.uniform([.9, .8, 1.5], [1.3, 2, 2.1])
        scene.add("van", box([x - 2.2, y - .85, .3], [x + 2.2, y + .85, bonnet], degrees, fillet=.2))
        scene.add("van", box([x - 1.3, y - .75, 1.1], [x + end, y + .75, roof], degrees, fillet=.18))
    for _ in range(rng.integers(1, 5)):
        x, y = somewhere(2)
        scene.add("trunk", rod(x, y, -.5, 3.5, rng.uniform(.08, .25), 24))
        scene.add(LEAF, leaves(rng, np.array([x, y, 4.6]), rng.uniform(1.2, 2), 1500, .07))
    for _ in range(rng.integers(1, 5)):
        x, y = somewhere(3)
        scene.add("thing", solid(rng, x, y, -.05, log_uniform(rng, .5, 2.5)))
    x, y = rng.uniform(2, length / 2), rng.uniform(2, width - 2)
    scene.add("railing", pipe([[x, y, 1.0], [x + 8, y, 1.0]], rng.uniform(.015, .03)))
    for k in range(57):
        scene.add("railing", rod(x + .14 * k, y, -.3, 1.0, .008, 12))
    for k in range(rng.integers(3, 9)):
        scene.add("steps", box([length * .6 + .32 * k, width - 3, -.3], [length * .6 + 3.2, width, .16 * (k + 1)]))


def hanging_wire(rng: Random, length: float, width: float, radius: float):
    """Across a street, sagging."""
    t = np.linspace(0, 1, 40)
    y, aside, z = rng.uniform([2, -2, 4.5], [width - 2, 2, 7])
    return pipe(np.stack([length * t, y + aside * t, z - 2.5 * t * (1 - t)], 1), radius, 10)


def street(rng: Random) -> Scene:
    """Facades around a street or yard with vans, posts, trees, a railing, steps, wires."""
    scene = Scene()
    length, width = rng.uniform([22, 12], [50, 24])
    scene.size = (length, width, 0.0)
    scene.add("ground", _street_ground(rng, length, width))
    corners = [(0, width), (length, width), (length, 0), (0, 0), (0, width)]
    for k, (start, end) in enumerate(zip(corners, corners[1:])):
        if k % 2 and rng.random() < .5:
            continue
        wall = _facade(rng, float(np.hypot(*np.subtract(end, start))))
        scene.add("facade", moved(stand(wall, start, end), [0, 0, -.8]))
    if rng.random() < .6:
        z, proud = rng.uniform([3, .03], [6, .15])
        scene.add("cornice", box([0, width - proud, z], [length, width, z + .2]))
    _street_things(scene, rng, length, width)
    for _ in range(3):
        scene.add("wire", hanging_wire(rng, length, width, rng.uniform(.005, .015)))
    return scene.finish()


def _house(scene: Scene, rng: Random, place, pitch: float) -> None:
    """With a gable, hipped, lean-to or flat roof, chimneys, sheds."""
    w, l, h, rise = rng.uniform([3, 4.5, 2.5, 1], [6, 9, 8, 4])
    degrees, kind, e = rng.uniform(0, 180), rng.integers(4), rng.uniform(0, .7)

    def put(name, mesh):
        scene.add(name, moved(turned(mesh, degrees), place))

    put("house", box([-w, -l, 0], [w, l, h]))
    eaves = [[-w - e, -l - e, h], [w + e, -l - e, h], [-w - e, l + e, h], [w + e, l + e, h]]
    if kind == 0:
        put("roof", hull([*eaves, [0, -l - e, h + rise], [0, l + e, h + rise]]))
    elif kind == 1:
        ridge = max(l - w * .8, .5)
        put("roof", hull([*eaves, [0, -ridge, h + rise], [0, ridge, h + rise]]))
    elif kind == 2:
        put("roof", hull([*eaves, [w + e, -l - e, h + .2], [w + e, l + e, h + .2], [-w - e, -l - e, h + rise * .6],
                          [-w - e, l + e, h + rise * .6]]))
    else:
        for low, high in (((-w, -l), (-w + .3, l)), ((w - .3, -l), (w, l)), ((-w, -l), (w, -l + .3)), ((-w, l - .3), (w, l))):
            put("parapet", box([*low, h], [*high, h + rng.uniform(.3, .9)]))
        put("house", box([-1.4, -1.2, h], [1.3, 1.4, h + 2.2]))
    if kind < 3:
        for _ in range(2):
            x, y = rng.uniform(-.7, .7, 2) * [w, l]
            put("chimney", box([x - .35, y - .35, h], [x + .35, y + .35, h + rise + .6]))
        if rng.random() < .5:
            put("roof", box([w * .3, -1.2, h], [w * .9, 1.2, h + rise * .7]))
    if rng.random() < .5:
        put("shed", box([w + .2, -l, 0], [w + 3.4, -l + 4, 2.7]))
    scene.add(LEAF, leaves(rng, np.asarray(place) + [pitch / 2, pitch / 2.2, 5], 2.4, 500, .24))


def village(rng: Random) -> Scene:
    """120 x 120 m of houses on gentle ground."""
    scene = Scene()
    scene.size = None
    ground = Relief(rng, 4, rng.uniform(50, 90), rng.uniform(.3, 2.5))
    x, y = np.meshgrid(np.linspace(-60, 60, 201), np.linspace(-60, 60, 201))
    z = ground(x, y)
    if rng.random() < .5:
        slant, middle, half = rng.uniform([-.4, -30, 3], [.4, 30, 6])
        z = z + rng.uniform(1, 3) * np.clip(1.6 - np.abs(y + slant * x - middle) / half, 0, 1)
    scene.add("ground", sheet(x, y, z))
    pitch = rng.uniform(14, 24)
    for i in range(-2, 3):
        for j in range(-2, 3):
            if rng.random() < .8:
                at = pitch * np.array([i, j]) + rng.uniform(-3, 3, 2)
                _house(scene, rng, (*at, float(ground(*at)) - .8), pitch)
    scene.add("garden", box([-50, -12.2, -4], [50, -12.2 + rng.uniform(.2, .4), 2.8], rng.uniform(-4, 4)))
    return scene.finish()


def terrain(rng: Random) -> Scene:
    """Natural ground, 112 x 112 m: terraces, furrows, or boulders and trees."""
    scene = Scene()
    scene.size = None
    ground = Relief(rng, int(rng.integers(3, 8)), rng.uniform(45, 90), rng.uniform(1, 4.5), rng.uniform(1.7, 2.4))
    x, y = np.meshgrid(np.linspace(-56, 56, 300), np.linspace(-56, 56, 300))
    z, kind = ground(x, y), rng.integers(3)
    if kind == 0:
        height, steep = rng.uniform([.6, .15], [2, .5])
        rest = z / height % 1
        z = height * (np.floor(z / height) + np.clip((rest - 1 + steep) / steep, 0, 1)) + .15 * rest
    if kind == 1 or rng.random() < .3:
        angle = rng.uniform(0, np.pi)
        z = z + rng.uniform(.02, .1) * np.cos(2 * np.pi * (x * np.cos(angle) + y * np.sin(angle)) / rng.uniform(1, 3))
    scene.add("ground", sheet(x, y, z))
    if kind == 2:
        for px, py in rng.uniform(-45, 45, (80, 2)):
            radius = .3 + 2.4 * rng.random() ** 4
            centre = np.array([px, py, float(ground(px, py)) + .2 * radius])
            stone = pebble(rng, centre, radius * rng.uniform([.8, .6, .4], [1.2, 1, .9]), .12, 16)
            scene.add("boulder", turned(stone, rng.uniform(0, 180), (px, py)))
        for px, py in rng.uniform(-45, 45, (30, 2)):
            z0 = float(ground(px, py))
            scene.add("trunk", lathe([(.28, z0 - .4), (.18, z0 + .6), (.12, z0 + 10)], (px, py, 0), 20))
            scene.add(LEAF, leaves(rng, np.array([px, py, z0 + 9.5]), 2.4, 220, .18))
    return scene.finish()


def forest(rng: Random) -> Scene:
    """Gentle ground, 60 x 60 m, under crowns of loose leaves and trunks."""
    scene = Scene()
    scene.size = None
    ground = Relief(rng, int(rng.integers(2, 5)), rng.uniform(30, 60), rng.uniform(.3, 2))
    x, y = np.meshgrid(np.linspace(-34, 34, 200), np.linspace(-34, 34, 200))
    scene.add("ground", sheet(x, y, ground(x, y)))
    for px, py in rng.uniform(-30, 30, (rng.integers(30, 120), 2)):
        z0, height, radius = float(ground(px, py)), *rng.uniform([4, 1.5], [16, 3.5])
        scene.add("trunk", lathe([(.26, z0 - .4), (.15, z0 + .6), (.08, z0 + height)], (px, py, 0), 16))
        scene.add(LEAF, leaves(rng, np.array([px, py, z0 + height]), radius, int(rng.integers(100, 600)), .25))
    return scene.finish()
