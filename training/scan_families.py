# SPDX-License-Identifier: Apache-2.0
"""Families of scans: a random scene, a random place and settings of a sensor. Lengths in metres."""
import numpy as np

import cameras
import grounds
import lasers
import objects
import rooms
from errors import Random
from registry import Drawn, Useless, family
from lasers import Station
from objects import log_uniform
from scene import Scene
from views import Rows, around


def usual_count(rng: Random) -> int:
    return int(log_uniform(rng, 20_000, 60_000))


def free_place(rng: Random, scene: Scene, low, high) -> np.ndarray:
    """Between two corners, with air around."""
    for _ in range(40):
        place = rng.uniform(low, high)
        if scene.is_free(place):
            return place
    raise Useless


def inside(rng: Random, scene: Scene) -> np.ndarray:
    """A place in a room for a sensor on a tripod."""
    width, depth, _ = scene.size
    return free_place(rng, scene, [.8, .8, 1.1], [width - .8, depth - .8, 1.9])


def indoors(rng: Random) -> Scene:
    return rooms.room(rng) if rng.random() < .55 else rooms.works(rng)


def station(rng: Random, scene: Scene) -> Station:
    start = rng.uniform(0, 360)
    return Station(tuple(inside(rng, scene)), (start, start + rng.uniform(80, 130)), (-rng.uniform(30, 50), rng.uniform(20, 38)))


def street_station(rng: Random, scene: Scene) -> Station:
    length, width, _ = scene.size
    start = rng.uniform(0, 360)
    place = free_place(rng, scene, [3, 2, 1.6], [length - 3, width - 2, 2.0])
    return Station(tuple(place), (start, start + rng.uniform(90, 150)), (-rng.uniform(22, 32), rng.uniform(25, 38)))


def typical_noise(rows: Rows) -> float:
    """Median error along the normal over all but mixed pixels, as a standard deviation."""
    error = ((rows.points - rows.clean) * rows.normal).sum(1)[~rows.mixed]
    return float(np.median(np.abs(error)) / .6745) if len(error) else 0.0


def laser_settings(rng: Random) -> dict:
    return dict(sigma=log_uniform(rng, .0006, .005), per_metre=rng.uniform(5e-6, 3e-5), jitter=rng.uniform(.001, .004),
                divergence=rng.uniform(.0002, .0005))


@family("scans")
def terrestrial(rng: Random) -> Drawn:
    """A tripod in a room."""
    scene, settings = indoors(rng), laser_settings(rng)
    return Drawn(scene, lasers.terrestrial(scene, rng, [station(rng, scene)], usual_count(rng), **settings), settings)


@family("scans")
def terrestrial_two(rng: Random) -> Drawn:
    """Two stations that do not quite agree."""
    scene, settings = indoors(rng), laser_settings(rng)
    settings["register"] = log_uniform(rng, .0005, .003)
    stations = [station(rng, scene), station(rng, scene)]
    return Drawn(scene, lasers.terrestrial(scene, rng, stations, usual_count(rng), **settings), settings)


@family("scans")
def terrestrial_street(rng: Random) -> Drawn:
    """A tripod outdoors: spacing from 1 to 20 cm."""
    scene, settings = grounds.street(rng), laser_settings(rng)
    settings["sigma"] = log_uniform(rng, .001, .006)
    return Drawn(scene, lasers.terrestrial(scene, rng, [street_station(rng, scene)], usual_count(rng), **settings), settings)


@family("scans")
def grazing(rng: Random) -> Drawn:
    """A low tripod on a street; only rays that meet a surface at 2 to 15 degrees."""
    scene, settings = grounds.street(rng), laser_settings(rng)
    seen = street_station(rng, scene)
    low = Station((*seen.place[:2], rng.uniform(.6, 1.2)), seen.azimuths, (-20, 4))
    rows = lasers.terrestrial(scene, rng, [low], 3 * usual_count(rng), grazing=.035, reach=40, **settings)
    sine = np.abs((rows.normal * (rows.clean - rows.sensor)).sum(1)) / np.linalg.norm(rows.clean - rows.sensor, axis=1)
    return Drawn(scene, rows.take(sine < .26), settings)


@family("scans")
def thinned(rng: Random) -> Drawn:
    """A scan of which a 30th to a third is left, at random or by cells."""
    drawn = (terrestrial if rng.random() < .5 else airborne_village)(rng)
    count = len(drawn.rows.points)
    share = log_uniform(rng, .03, .3)
    if rng.random() < .5:
        keep = rng.random(count) < share
    else:
        extent = np.linalg.norm(np.ptp(drawn.rows.points, axis=0))
        cells = np.floor(drawn.rows.points / (extent / np.sqrt(count * share) * .5)).astype(np.int64)
        _, keep = np.unique(cells @ np.array([73856093, 19349663, 83492791]), return_index=True)
        keep = np.sort(keep)
    return Drawn(drawn.scene, drawn.rows.take(keep), drawn.settings | {"share": share})


def _beams(rng: Random, count: int) -> np.ndarray:
    """Elevations, evenly or denser around the horizon."""
    low, high = -rng.uniform(18, 30), rng.uniform(2, 20)
    if rng.random() < .5:
        return np.linspace(low, high, count)
    return np.concatenate([np.linspace(low, -8, count // 2), np.linspace(-7.5, high, count - count // 2)])


def _drive(rng: Random, scene: Scene, sweeps: int) -> dict:
    """A car along a street."""
    length, width, _ = scene.size
    start = free_place(rng, scene, [2, 3, 1.5], [6, width - 3, 2.0])
    return dict(start=start, move=(min(1.0, (length - 8) / sweeps), rng.uniform(-.1, .1), .01), sweeps=sweeps)


@family("scans", correlated=True)
def spinning_accumulated(rng: Random) -> Drawn:
    """Several sweeps from a moving car, each with an error of pose of centimetres."""
    scene, sweeps = grounds.street(rng), int(rng.integers(6, 18))
    settings = dict(sigma=log_uniform(rng, .008, .03), quantum=log_uniform(rng, .001, .006), pose=rng.uniform(.005, .03),
                    pose_degrees=rng.uniform(.02, .1))
    beams = np.linspace(-rng.uniform(20, 30), rng.uniform(3, 15), int(rng.integers(16, 70)))
    rows = lasers.spinning(scene, rng, **_drive(rng, scene, sweeps), elevations=beams, count=usual_count(rng), **settings)
    return Drawn(scene, rows, settings | {"sweeps": sweeps, "beams": len(beams)})


@family("scans")
def spinning_single(rng: Random) -> Drawn:
    """One sweep: dense along lines, sparse across."""
    scene = grounds.street(rng) if rng.random() < .75 else rooms.room(rng)
    place = street_station(rng, scene).place if scene.size[2] == 0 else inside(rng, scene)
    settings = dict(sigma=log_uniform(rng, .004, .03), quantum=log_uniform(rng, .001, .006))
    beams = _beams(rng, int(rng.choice([32, 64, 64, 128])))
    rows = lasers.spinning(scene, rng, place, (0, 0, 0), 1, beams, usual_count(rng), **settings)
    return Drawn(scene, rows, settings | {"beams": len(beams)})


@family("scans", correlated=True)
def spinning_offset(rng: Random) -> Drawn:
    """Rings off by a constant of several millimetres each, neighbours along a ring nearly alike; one to three sweeps that
    are off from each other too; a part of the turn, so that rings are denser along than across."""
    scene, sweeps = grounds.street(rng) if rng.random() < .7 else indoors(rng), int(rng.integers(1, 4))
    start, width = rng.uniform(0, 360), rng.uniform(90, 200)
    settings = dict(sigma=log_uniform(rng, .0008, .003), quantum=0.0, ring=log_uniform(rng, .006, .015),
                    pose=rng.uniform(0, .008), pose_degrees=rng.uniform(0, .03))
    if scene.size[2] == 0:
        way = _drive(rng, scene, sweeps)
    else:
        way = dict(start=inside(rng, scene), move=(.02, .02, 0), sweeps=sweeps)
    beams = _beams(rng, int(rng.choice([16, 32, 64])))
    rows = lasers.spinning(scene, rng, **way, elevations=beams, count=usual_count(rng), azimuths=(start, start + width),
                           **settings)
    return Drawn(scene, rows, settings | {"sweeps": sweeps})


def camera_place(rng: Random) -> tuple[Scene, np.ndarray, np.ndarray]:
    """A scene, where the camera is and where it looks."""
    if rng.random() < .5:
        scene, distance, angle = rooms.bench(rng), log_uniform(rng, .6, 1.7), rng.uniform(-.9, .9)
        place = np.array([distance * np.sin(angle), -distance * np.cos(angle) - .1, rng.uniform(.3, .6) * distance + .15])
        return scene, place, np.array([rng.uniform(-.2, .2), .1, .1])
    scene = indoors(rng)
    place, angle = inside(rng, scene), rng.uniform(0, 2 * np.pi)
    return scene, place, np.array([place[0] + 2 * np.cos(angle), place[1] + 2 * np.sin(angle), rng.uniform(.3, 1.5)])


@family("scans", correlated=True)
def structured_light(rng: Random) -> Drawn:
    """Disparity noise alike over a few pixels, steps too fine to see."""
    scene, place, target = camera_place(rng)
    settings = dict(base=rng.uniform(.06, .1), smooth=log_uniform(rng, .03, .15), blur=rng.uniform(.6, 2.2),
                    white=log_uniform(rng, .005, .03), steps=float(rng.choice([0, 32, 64])))
    return Drawn(scene, cameras.stereo(scene, rng, place, target, usual_count(rng), **settings), settings)


@family("scans", correlated=True)
def structured_light_steps(rng: Random) -> Drawn:
    """The same with steps of disparity that show, as wide as the noise and more."""
    scene, place, target = camera_place(rng)
    settings = dict(base=rng.uniform(.05, .1), smooth=rng.uniform(.03, .12), window=int(rng.integers(5, 14)),
                    white=rng.uniform(.01, .06), steps=float(rng.choice([2, 4, 8, 8])))
    return Drawn(scene, cameras.stereo(scene, rng, place, target, usual_count(rng), **settings), settings)


@family("scans", correlated=True)
def stereo_windows(rng: Random) -> Drawn:
    """Projected-texture stereo: errors of neighbours alike to .97 and more, over 10 pixels and more."""
    scene, place, target = camera_place(rng)
    settings = dict(base=rng.uniform(.05, .12), smooth=rng.uniform(.05, .2), window=int(rng.integers(9, 22)), passes=2,
                    white=log_uniform(rng, .002, .02), steps=float(rng.choice([0, 16, 32])))
    return Drawn(scene, cameras.stereo(scene, rng, place, target, usual_count(rng), **settings), settings)


@family("scans")
def time_of_flight(rng: Random) -> Drawn:
    """A phase camera with flying pixels and a periodic error."""
    scene, place, target = camera_place(rng)
    settings = dict(sigma=log_uniform(rng, .002, .006), growth=log_uniform(rng, .0004, .0015), wiggle=rng.uniform(0, .005),
                    period=rng.uniform(.5, 1.2))
    return Drawn(scene, cameras.time_of_flight(scene, rng, place, target, usual_count(rng), **settings), settings)


def _strips(rng: Random, scene: Scene, lines: int, clean: bool = False) -> Drawn:
    count = usual_count(rng)
    half = min(46, np.sqrt(count / log_uniform(rng, 5, 22)) / 2)
    settings = dict(sigma=log_uniform(rng, .012, .06), pointing=rng.uniform(.002, .006), strip=rng.uniform(.01, .05))
    rows = lasers.airborne(scene, rng, rng.uniform(-60, 60, lines), half, rng.uniform(280, 700), count, clean=clean, **settings)
    return Drawn(scene, rows, settings | {"lines": lines})


@family("scans")
def airborne_village(rng: Random) -> Drawn:
    """Roofs, chimneys, parapets; one to three strips."""
    return _strips(rng, grounds.village(rng), int(rng.integers(1, 4)))


@family("scans")
def airborne_terrain(rng: Random) -> Drawn:
    """Natural ground with relief down to a few spacings."""
    return _strips(rng, grounds.terrain(rng), int(rng.integers(1, 4)))


def _fans(rng: Random, half: float, height: float, angle: float, sigma: float, **settings) -> Drawn:
    """Natural ground under a line scanner, lines a third to three times as far apart as beams."""
    count = usual_count(rng)
    half = min(half, height * np.tan(np.radians(angle)))
    lines = int(np.clip(np.sqrt(count) * log_uniform(rng, .6, 1.7), 60, count // 60))
    settings |= dict(angle=float(np.degrees(np.arctan(half / height))), lines=lines, beams=count // lines, sigma=sigma)
    return Drawn(scene := grounds.terrain(rng), lasers.fans(scene, rng, half, height, **settings), settings)


@family("scans")
def airborne_lines(rng: Random) -> Drawn:
    """Natural ground under a turning mirror: even lines of even beams, or lines to and fro."""
    spread = log_uniform(rng, .01, .2)
    return _fans(rng, log_uniform(rng, 12, 50), rng.uniform(280, 700), 30, spread, jitter=log_uniform(rng, .0001, .004), swing=rng.random() < .4)


@family("scans", correlated=True)
def sonar_fans(rng: Random) -> Drawn:
    """Ground under the fans of a boat, whose heave and roll are not quite known."""
    height = rng.uniform(10, 40)
    sigma = height * log_uniform(rng, .0005, .004)
    return _fans(rng, 50, height, rng.uniform(45, 62), sigma, jitter=log_uniform(rng, .002, .05),
                 heave=sigma * log_uniform(rng, .1, 2), roll=log_uniform(rng, .01, .15), memory=rng.uniform(2, 40))


@family("scans")
def airborne_forest(rng: Random) -> Drawn:
    """Ground and trunks under crowns of leaves."""
    return _strips(rng, grounds.forest(rng), int(rng.integers(1, 3)))


def _match(rng: Random, scene: Scene, eyes: np.ndarray) -> Drawn:
    settings = dict(smooth=rng.uniform(.2, .8), white=rng.uniform(.15, .5), length=rng.uniform(3, 8))
    try:
        return Drawn(scene, cameras.photogrammetry(scene, rng, usual_count(rng), eyes, **settings), settings)
    except ValueError as too_little:
        raise Useless from too_little


@family("scans", correlated=True)
def photogrammetry_object(rng: Random) -> Drawn:
    """Dense matching of an object."""
    return _match(rng, objects.one_object(rng), around(int(rng.integers(30, 60)), 2.1))


@family("scans", correlated=True)
def photogrammetry_scene(rng: Random) -> Drawn:
    """Dense matching of a room or street."""
    if rng.random() < .5:
        scene = grounds.street(rng)
        length, width, _ = scene.size
        return _match(rng, scene, rng.uniform([2, 2, 1.7], [length - 2, width - 2, 7], (24, 3)))
    scene = rooms.room(rng)
    width, depth, height = scene.size
    return _match(rng, scene, rng.uniform([.5, .5, .8], [width - .5, depth - .5, height - .3], (24, 3)))


@family("scans")
def multiview_object(rng: Random) -> Drawn:
    """An object from 8 to 16 sides with errors of registration."""
    scene = objects.one_object(rng)
    settings = dict(noise=log_uniform(rng, .0006, .009), register=log_uniform(rng, .0003, .003), views=int(rng.integers(8, 17)))
    return Drawn(scene, cameras.multiview(scene, rng, usual_count(rng), **settings), settings)


@family("scans")
def rounded(rng: Random) -> Drawn:
    """A scan whose coordinates are rounded to .8 to 6 of its noise."""
    drawn = (terrestrial, multiview_object, airborne_village)[rng.integers(3)](rng)
    factor = rng.uniform(.8, 6)
    drawn.rounding = factor * typical_noise(drawn.rows)
    drawn.settings |= {"rounded_to_noise": factor}
    return drawn


@family("scans")
def terrestrial_close(rng: Random) -> Drawn:
    """A tripod that looks at a small part of a room: points nearer to each other than the noise is large."""
    scene = indoors(rng)
    start, low, wide = rng.uniform(0, 360), rng.uniform(-40, 20), rng.uniform(5, 20)
    field = Station(tuple(inside(rng, scene)), (start, start + wide), (low, low + wide * rng.uniform(.5, 1)))
    settings = laser_settings(rng) | dict(sigma=log_uniform(rng, .002, .015))
    return Drawn(scene, lasers.terrestrial(scene, rng, [field], usual_count(rng), **settings), settings)


@family("scans")
def rosette(rng: Random) -> Drawn:
    """A lidar whose beam draws a rosette, for a second or so, with noise of up to some spacings."""
    scene = indoors(rng) if rng.random() < .6 else grounds.street(rng)
    origin = inside(rng, scene) if scene.size[2] > 0 else np.asarray(street_station(rng, scene).place)
    count = usual_count(rng)
    settings = dict(sigma=log_uniform(rng, .002, .02), drift=rng.uniform(0, .8), ripple=rng.uniform(0, .6), jitter=rng.uniform(.002, .02))
    rows = lasers.rosette(scene, rng, origin, rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(19, 38)), rng.uniform(1.6, 5.3),
                          int(count / rng.uniform(90, 220)), count, **settings)
    return Drawn(scene, rows, settings)


@family("scans")
def profiles(rng: Random) -> Drawn:
    """A scanner that is driven past, whose beam turns in a plane across the way."""
    scene = grounds.street(rng)
    length, width, _ = scene.size
    start = free_place(rng, scene, [2, 3, 1.5], [6, width - 3, 2.5])
    settings = dict(sigma=log_uniform(rng, .003, .06), wobble=float(rng.choice([0, rng.uniform(0, .05)])))
    count = usual_count(rng)
    lines = int(np.sqrt(count) * log_uniform(rng, .3, 1.5))
    rows = lasers.profiles(scene, rng, start, rng.uniform(3, min(15, length - 8)), lines, count, **settings)
    return Drawn(scene, rows, settings | {"lines": lines})


@family("clean")
def clean_terrestrial(rng: Random) -> Drawn:
    """A tripod in a room, no noise."""
    scene = indoors(rng)
    rows = lasers.terrestrial(scene, rng, [station(rng, scene)], usual_count(rng), 0.0, 0.0, clean=True)
    return Drawn(scene, rows)


@family("clean")
def clean_airborne(rng: Random) -> Drawn:
    """Village or natural ground, no noise."""
    return _strips(rng, grounds.village(rng) if rng.random() < .5 else grounds.terrain(rng), 1, clean=True)


@family("clean")
def clean_multiview(rng: Random) -> Drawn:
    """An object from several sides, no noise."""
    scene = objects.one_object(rng)
    return Drawn(scene, cameras.multiview(scene, rng, usual_count(rng), 0.0, 0.0, int(rng.integers(8, 17)), clean=True))
