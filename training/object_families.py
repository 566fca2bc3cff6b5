# SPDX-License-Identifier: Apache-2.0
"""Families of objects: points spread over a mesh of radius 1, with noise of .1 to 3 % of the radius."""
import numpy as np

import cameras
import objects
import rays
from errors import Random, direction, heavy_tailed, neighbour_averaged, waves
from registry import Drawn, family
from objects import log_uniform
from scene import Scene
from views import Rows


def plain_rows(scene: Scene, clean: np.ndarray, triangle: np.ndarray, points: np.ndarray) -> Rows:
    """Rows without a sensor; normals as the mesh has them."""
    nothing = np.zeros(len(clean), bool)
    return Rows(points, clean, scene.caster.normals[triangle], np.zeros_like(clean), scene.part[triangle], nothing, nothing)


def even_points(scene: Scene, rng: Random, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Poisson-disk samples, about so many, and their triangles."""
    points, triangle = cameras.surface_points(scene, rng, 8 * count)
    a, b, c = (scene.vertices[scene.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    keep = np.flatnonzero(rays.spread(points, .79 * np.sqrt(area / count)))[:count]
    return points[keep], triangle[keep]


def sampled(scene: Scene, rng: Random, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Poisson-disk or by area, at times thinner towards one side."""
    points, triangle = (even_points if rng.random() < .6 else cameras.surface_points)(scene, rng, count)
    if rng.random() < .2:
        height = points @ direction(rng)
        keep = rng.random(len(points)) < .2 + .8 * (height - height.min()) / np.ptp(height)
        points, triangle = points[keep], triangle[keep]
    return points, triangle


def usual_count(rng: Random) -> int:
    return int(log_uniform(rng, 8_000, 60_000))


def sigma_of_radius(rng: Random) -> float:
    """Noise of .1 to 3 % of the radius; objects have the diagonal 1, so about half of that."""
    return log_uniform(rng, .001, .03) / 2


def white(scene: Scene, rng: Random, clean: np.ndarray, triangle: np.ndarray, sigma: float) -> Drawn:
    """Isotropic Gaussian noise on points of a mesh."""
    rows = plain_rows(scene, clean, triangle, clean + sigma * rng.normal(size=clean.shape))
    return Drawn(scene, rows, {"sigma": sigma}, has_sensor=False)


def with_error(rng: Random, error_of) -> Drawn:
    """An object whose points are off by sigma times error_of(clean points, sigma)."""
    scene = objects.one_object(rng)
    clean, triangle = sampled(scene, rng, usual_count(rng))
    sigma = sigma_of_radius(rng)
    rows = plain_rows(scene, clean, triangle, clean + sigma * error_of(clean, sigma))
    return Drawn(scene, rows, {"sigma": sigma}, has_sensor=False)


@family("objects")
def object_white(rng: Random) -> Drawn:
    """Isotropic Gaussian noise."""
    return with_error(rng, lambda clean, sigma: rng.normal(size=clean.shape))


def in_sight(scene: Scene, rng: Random, clean: np.ndarray) -> np.ndarray:
    """Which points see out in one of sixteen directions: parts that run into each other hide some of their surface."""
    seen = np.zeros(len(clean), bool)
    for _ in range(16):
        left, way = np.flatnonzero(~seen), direction(rng)
        seen[left] = ~np.isfinite(scene.caster.cast(clean[left] + 1e-5 * way, np.broadcast_to(way, (len(left), 3)))[0])
    return seen


def full_points(scene: Scene, rng: Random, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Poisson-disk samples with hardly room for another, about so many, and their triangles."""
    points, triangle = cameras.surface_points(scene, rng, 24 * count)
    a, b, c = (scene.vertices[scene.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    keep = rays.spread(points, .82 * np.sqrt(area / count))
    return points[keep], triangle[keep]


@family("objects")
def object_even(rng: Random) -> Drawn:
    """Very even points on the outside of an object, isotropic noise of .8 to 3.2 % of the bounding radius."""
    scene = objects.one_object(rng)
    clean, triangle = full_points(scene, rng, int(log_uniform(rng, 9_000, 60_000)))
    keep = in_sight(scene, rng, clean)
    clean, triangle = clean[keep], triangle[keep]
    radius = np.linalg.norm(clean - (clean.min(0) + clean.max(0)) / 2, axis=1).max()
    return white(scene, rng, clean, triangle, rng.uniform(.008, .032) * radius)


@family("objects")
def object_anisotropic(rng: Random) -> Drawn:
    """Noise along one direction mostly, at times in steps, or growing towards one side."""
    def error(clean, sigma):
        way, kind = direction(rng), rng.random()
        if kind < .3:
            height = clean @ way
            return rng.normal(size=clean.shape) * (.15 + 1.2 * (height - height.min()) / np.ptp(height))[:, None]
        noise = rng.normal(size=clean.shape) * rng.uniform(.05, .25) + rng.normal(size=(len(clean), 1)) * way
        if kind > .75:
            step = rng.uniform(2, 3.5)
            at = ((clean / sigma + noise) @ way)[:, None]
            noise = noise + (np.round(at / step) * step - at) * way
        return noise
    return with_error(rng, error)


@family("objects")
def object_heavy_tailed(rng: Random) -> Drawn:
    """Laplace noise, at times with half a percent of outliers."""
    drawn = with_error(rng, lambda clean, sigma: heavy_tailed(rng, clean.shape))
    if rng.random() < .5:
        rows = drawn.rows
        far = rng.random(len(rows.points)) < .005
        extent = 8 * np.sqrt(.5 / len(rows.points))
        rows.points[far] += extent * rng.normal(size=(int(far.sum()), 3))
        rows.mixed = far
    return drawn


@family("objects", correlated=True)
def object_correlated(rng: Random) -> Drawn:
    """A part of the noise is alike among the nearest points."""
    def error(clean, sigma):
        share = rng.uniform(.3, .8)
        alike = neighbour_averaged(rng, clean, int(rng.integers(2, 7)))
        return np.sqrt(1 - share ** 2) * rng.normal(size=clean.shape) + share * alike
    return with_error(rng, error)


@family("objects", correlated=True)
def object_blurred(rng: Random) -> Drawn:
    """All of the noise is one field, correlated over .7 to 4 spacings."""
    def error(clean, sigma):
        spacing = np.sqrt(.7 / len(clean))
        length = spacing * rng.uniform(.7, 4)
        return np.stack([waves(rng, clean, length) for _ in range(3)], 1)
    return with_error(rng, error)


def scene_of_object(mesh) -> Scene:
    scene = Scene()
    scene.add("object", objects.scaled(mesh, 1.0))
    return scene.finish(diagonal=1.0)


@family("objects")
def object_carved(rng: Random) -> Drawn:
    """Detail of 5 to 20 spacings in length and 1 to 10 noises in height, noise of .05 to .7 spacings."""
    count = usual_count(rng)
    mesh = objects.any_mesh(rng, 1.0)
    spacing = np.sqrt(.6 / count)
    sigma, length = spacing * log_uniform(rng, .05, .7), spacing * rng.uniform(5, 20)
    scene = scene_of_object(objects.carved(rng, mesh, length, min(sigma * log_uniform(rng, 1, 10), .2 * length)))
    clean, triangle = sampled(scene, rng, count)
    return white(scene, rng, clean, triangle, sigma)


@family("objects")
def object_faceted(rng: Random) -> Drawn:
    """Some hundred plane facets of 8 to 200 points, noise of .05 to 1 spacing."""
    scene = scene_of_object(objects.faceted(rng))
    count = int(np.clip(len(scene.triangles) * log_uniform(rng, 8, 200), 5_000, 60_000))
    clean, triangle = sampled(scene, rng, count)
    return white(scene, rng, clean, triangle, np.sqrt(.6 / count) * log_uniform(rng, .05, 1))


@family("objects")
def small_cloud(rng: Random) -> Drawn:
    """300 to 5,000 points of an object."""
    scene = objects.one_object(rng)
    clean, triangle = sampled(scene, rng, int(log_uniform(rng, 400, 5_000)))
    return white(scene, rng, clean, triangle, log_uniform(rng, .002, .02))


@family("objects")
def large_cloud(rng: Random) -> Drawn:
    """100,000 to 300,000 points of an object."""
    scene = objects.one_object(rng)
    clean, triangle = cameras.surface_points(scene, rng, int(log_uniform(rng, 100_000, 300_000)))
    return white(scene, rng, clean, triangle, log_uniform(rng, .0005, .01))


@family("clean")
def clean_object(rng: Random) -> Drawn:
    """Points of an object, no noise."""
    scene = objects.one_object(rng)
    clean, triangle = sampled(scene, rng, usual_count(rng))
    return Drawn(scene, plain_rows(scene, clean, triangle, clean.copy()), has_sensor=False)
