# SPDX-License-Identifier: Apache-2.0
"""Sensors that see images: structured light, stereo, time of flight, photogrammetry, range images of an object from all
sides. Lengths in metres unless said."""
import numpy as np
from scipy.ndimage import binary_dilation, map_coordinates
from scipy.spatial import cKDTree

from errors import Random, blurred, waves, window_matched
from scene import Scene
from shapes import unit
from views import Rows, around, beam, camera, cross_turn, jumps, kept, together


def image_size(scene: Scene, origin, target, focal_share: float, count: int, reach: float) -> tuple[tuple[int, int], float]:
    """Columns and rows of a 4:3 image that sees about `count` points, and its focal length in pixels, given in widths."""
    depth = scene.caster.cast(np.asarray(origin, float), camera(origin, target, (40, 30), 40 * focal_share))[0]
    share = max(float((depth < reach).mean()), .05)
    width = int(np.sqrt(count / share * 4 / 3))
    return (width, width * 3 // 4), width * focal_share


def stereo(scene: Scene, rng: Random, origin, target, count: int, base: float, focal: float = 1.25, steps: float = 8.0,
           smooth: float = .1, window: int = 9, passes: int = 1, white: float = .03, blur: float | None = None,
           reach: float = 6.0) -> Rows:
    """A camera and a projector or second camera `base` apart. The disparity is off by a field of spread `smooth` pixels, alike
    over a window of pixels (or blurred, if `blur` is given), and by white noise; it comes in whole 1/steps pixels (0: as it is).
    The borders of things wobble by half a pixel. focal: in image widths."""
    origin = np.asarray(origin, float)
    size, focal_pixels = image_size(scene, origin, target, focal, count, reach)
    ray = camera(origin, target, size, focal_pixels)
    depth, normal, triangle = scene.caster.cast(origin, ray)
    valid = (depth < reach) & (np.abs((normal * unit(ray)).sum(-1)) > .15)
    depth = np.where(valid, depth, np.nan)
    exact = origin + depth[..., None] * ray
    near = jumps(exact, normal, valid, np.nan_to_num(depth / focal_pixels, nan=1))
    row, column = np.indices(depth.shape)
    at = [np.clip(np.round(index + .6 * blurred(rng, depth.shape, 1.3)), 0, length - 1)
          for index, length in ((row, size[1]), (column, size[0]))]
    seen = map_coordinates(np.nan_to_num(depth, nan=0), at, order=0)
    seen = np.where(binary_dilation(near, iterations=1) & (seen > 0), seen, depth)
    field = blurred(rng, depth.shape, blur) if blur is not None else window_matched(rng, depth.shape, window, passes)
    scale = 640 * focal * base                                      # disparities are those of an image of 640 columns
    disparity = scale / seen + smooth * field + white * rng.normal(size=depth.shape)
    if steps:
        disparity = np.round(steps * disparity) / steps
    with np.errstate(divide="ignore"):
        got = np.where(disparity > 0, scale / disparity, np.nan)
    points = origin + got[..., None] * ray
    keep = valid & np.isfinite(got) & (got < 1.5 * reach)
    spread = np.maximum(smooth, .1) * seen ** 2 / scale
    mixed = near[keep] & (scene.caster.distance(points[keep]) > 8 * spread[keep])
    other = keep & near & (np.abs(seen - depth) > .001)             # these see another surface than their ray's
    if other.any():
        exact[other], triangle[other] = scene.caster.closest(origin + seen[other][:, None] * ray[other])
        facing = scene.caster.normals[triangle[other]]
        normal[other] = np.where((facing * ray[other]).sum(-1, keepdims=True) > 0, -facing, facing)
    return kept(scene, keep, points, exact, normal, origin, triangle, mixed, near)


def time_of_flight(scene: Scene, rng: Random, origin, target, count: int, sigma: float, growth: float, wiggle: float,
                   period: float, focal: float = .85, reach: float = 7.0) -> Rows:
    """A phase camera: noise sigma + growth * range^2, more where light comes back weakly; a periodic error of `wiggle` over
    `period` that no filter can know; pixels on a border lie between both surfaces."""
    origin = np.asarray(origin, float)
    size, focal_pixels = image_size(scene, origin, target, focal, count, reach)
    ray = unit(camera(origin, target, size, focal_pixels))
    ranges, normal, triangle = scene.caster.cast(origin, ray)
    valid = ranges < reach
    ranges = np.where(valid, ranges, np.nan)
    exact = origin + ranges[..., None] * ray
    sine = np.abs((normal * ray).sum(-1))
    mean, wide = beam(scene.caster, origin, ray, ranges, 0.0, .5 / focal_pixels, 3.0)
    spread = (sigma + growth * ranges ** 2) / np.sqrt(np.maximum(sine, .1))
    measured = mean + wiggle * np.sin(2 * np.pi * mean / period) + spread * rng.normal(size=ranges.shape)
    points = origin + measured[..., None] * ray
    near = jumps(exact, normal, valid, np.nan_to_num(ranges / focal_pixels, nan=1))
    keep = valid & (sine > .1)
    mixed = (wide > 8 * spread)[keep]
    mixed[mixed] = scene.caster.distance(points[keep][mixed]) > 5 * spread[keep][mixed]
    return kept(scene, keep, points, exact, normal, origin, triangle, mixed, near)


def surface_points(scene: Scene, rng: Random, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points spread by area, and their triangles."""
    a, b, c = (scene.vertices[scene.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    triangle = np.searchsorted(np.cumsum(area), rng.random(count) * area.sum()).clip(0, len(area) - 1)
    u, v = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    return (1 - u) * a[triangle] + u * (1 - v) * b[triangle] + u * v * c[triangle], triangle


def photogrammetry(scene: Scene, rng: Random, count: int, eyes: np.ndarray, smooth: float, white: float, length: float) -> Rows:
    """Dense matching: points that two of the cameras at `eyes` see, off along the normal by a field correlated over `length`
    spacings and by white noise, both in spacings."""
    points, triangle = surface_points(scene, rng, 3 * count)
    normal = scene.caster.normals[triangle]
    seen, eye = np.zeros(len(points), int), np.zeros(points.shape)
    for place in np.asarray(eyes, float):
        open_ = np.flatnonzero(seen < 2)
        way = points[open_] - place
        sees = open_[np.abs((unit(way) * normal[open_]).sum(1)) > .2]
        sees = sees[scene.caster.cast(place, points[sees] - place)[0] > 1 - 1e-4]
        eye[sees] = place
        seen[sees] += 1
    keep = np.flatnonzero(seen > 1)[:count]
    if len(keep) < 200:
        raise ValueError("the cameras see too little")
    clean, normal, eye, triangle = points[keep], normal[keep], eye[keep], triangle[keep]
    normal = np.where((normal * (eye - clean)).sum(1, keepdims=True) < 0, -normal, normal)
    spacing = np.median(cKDTree(clean).query(clean[::4], 2)[0][:, 1]) * 2     # of random points half the even spacing is nearest
    error = smooth * waves(rng, clean, length * spacing) + white * rng.normal(size=len(clean))
    measured = clean + normal * (spacing * error)[:, None] + .2 * spacing * rng.normal(size=clean.shape)
    nothing = np.zeros(len(clean), bool)
    return Rows(measured, clean, normal, eye, scene.part[triangle], nothing, nothing)


def multiview(scene: Scene, rng: Random, count: int, noise: float, register: float, views: int, clean: bool = False) -> Rows:
    """Range images of an object from all sides: noise along the ray and errors of registration, in diagonals (turns: radians)."""
    diagonal = np.linalg.norm(np.ptp(scene.vertices, axis=0))
    places, gathered = around(views, 2.5 * diagonal), []
    share = np.mean([np.isfinite(scene.caster.cast(place, camera(place, np.zeros(3), (40, 40), 84))[0]).mean()
                     for place in places[::3]])
    width = max(4, int(np.sqrt(count / views / max(share, .02))))
    for place in places:
        ray = camera(place, np.zeros(3), (width, width), 2.1 * width)
        along = unit(ray)
        depth, normal, triangle = scene.caster.cast(place, ray)
        keep = np.isfinite(depth) & (np.abs((normal * along).sum(-1)) > .25)
        exact = place + np.where(keep, depth, np.nan)[..., None] * ray
        near = jumps(exact, normal, keep, np.full(depth.shape, 2.5 * diagonal / (2.1 * width)))
        points = exact
        if not clean:
            points = exact + noise * diagonal * rng.normal(size=depth.shape)[..., None] * along
            points = points + cross_turn(register * rng.normal(size=3), points)
            points = points + register * diagonal / np.sqrt(3) * rng.normal(size=3)
        gathered.append(kept(scene, keep, points, exact, normal, place, triangle, np.zeros(keep.sum(), bool), near))
    return together(gathered)
