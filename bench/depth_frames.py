#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Frames of a depth camera whose truth is known: time and error of the default run, of k = 16 once and of denoise_depth.

    build/python/tests/whole/bin/python bench/depth_frames.py

The camera sees a floor, two walls, a box and two balls in 448 x 336 pixels. Its disparity is off by what is alike in a window
of 11 x 11 pixels and a little independent noise, in whole eighths of a pixel, as that of stereo and structured light; by
independent noise alone; or not at all. Errors are mean distances to the true surfaces in mm, of all pixels and of those
within 3 pixels of a jump."""
import statistics
import time

import numpy as np

import pointfair as pf

WIDTH, HEIGHT, FOCAL, BASE = 448, 336, 600.0, 0.075  # pixels, metres
EYE, TARGET = np.array([0.3, -1.3, 0.85]), np.array([0.05, 0.3, 0.15])
PLANES = [((0, 0, 1), 0.0), ((0, -1, 0), -0.9), ((1, 0, 0), -0.9)]  # normal, offset
BALLS = [((-0.25, 0.2, 0.18), 0.18), ((0.3, 0.1, 0.1), 0.1)]
BOX = np.array([[-0.05, 0.35, 0], [0.3, 0.65, 0.4]])


def distances(points):
    """To the nearest true surface."""
    found = [np.abs(points @ np.array(normal, float) - offset) for normal, offset in PLANES]
    found += [np.abs(np.linalg.norm(points - centre, axis=-1) - radius) for centre, radius in BALLS]
    off = np.abs(points - BOX.mean(axis=0)) - (BOX[1] - BOX[0]) / 2
    found.append(np.abs(np.linalg.norm(np.maximum(off, 0), axis=-1) + np.minimum(off.max(axis=-1), 0)))
    return np.min(found, axis=0)


def camera():
    """Rays of the pixels whose component along the axis is 1, and the rotation to the camera's coordinates."""
    forward = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    v, u = np.indices((HEIGHT, WIDTH)) - np.array([HEIGHT / 2, WIDTH / 2])[:, None, None]
    return np.stack([u / FOCAL, v / FOCAL, np.ones_like(u)], -1), rotation


def true_depths(rays):
    """Of rays in the coordinates of the scene."""
    with np.errstate(all="ignore"):
        hits = [(offset - EYE @ np.array(normal, float)) / (rays @ np.array(normal, float)) for normal, offset in PLANES]
        for centre, radius in BALLS:
            to, square = EYE - centre, (rays**2).sum(axis=-1)
            half = rays @ to
            hits.append((-half - np.sqrt(half**2 - square * (to @ to - radius**2))) / square)
        sides = np.sort((BOX[:, None, None] - EYE) / rays, axis=0)
        enter, leave = sides[0].max(axis=-1), sides[1].min(axis=-1)
        hits.append(np.where(enter < leave, enter, np.nan))
        return np.nanmin([np.where(hit > 0.1, hit, np.nan) for hit in hits], axis=0)


def windowed(rng, window):
    """Of deviation 1, the mean over a window."""
    padded = np.pad(rng.normal(size=(HEIGHT, WIDTH)), window // 2, mode="wrap").cumsum(axis=0).cumsum(axis=1)
    padded = np.pad(padded, ((1, 0), (1, 0)))
    sums = padded[window:, window:] - padded[window:, :-window] - padded[:-window, window:] + padded[:-window, :-window]
    return sums / window


def near_jumps(depth):
    jump = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        steps = np.abs(np.diff(np.log(depth), axis=axis)) > 0.02
        where = np.argwhere(steps)
        for by in range(-2, 4):
            at = where.copy()
            at[:, axis] = np.clip(at[:, axis] + by, 0, depth.shape[axis] - 1)
            jump[tuple(at.T)] = True
    return jump


def in_turns(ways, frame, rounds=5):
    """The median of each way's milliseconds and its result."""
    times, results = {name: [] for name in ways}, {}
    for _ in range(rounds):
        for name, way in ways.items():
            start = time.perf_counter()
            results[name] = way(frame)
            times[name].append(1e3 * (time.perf_counter() - start))
    return {name: (statistics.median(times[name]), results[name]) for name in ways}


def main():
    rays, rotation = camera()
    depth = true_depths(rays @ rotation)
    jumps = near_jumps(depth)
    rng = np.random.default_rng(1)
    exact = FOCAL * BASE / depth
    disparities = {"windowed": np.round(8 * (exact + 0.12 * windowed(rng, 11) + 0.03 * rng.normal(size=depth.shape))) / 8,
                   "independent": exact + 0.12 * rng.normal(size=depth.shape), "no": exact}
    pipeline = pf.Pipeline("cpu")

    def run(**parameters):
        def way(frame):
            pipeline.load(frame)
            return pipeline.run(**parameters)
        return way

    ways = {"default run": run(), "k = 16, once": run(k=16, iterations=1), "denoise_depth": pf.denoise_depth}
    for name, disparity in disparities.items():
        frame = ((FOCAL * BASE / disparity)[..., None] * rays).astype(np.float32)

        def errors(points):
            off = 1e3 * distances(points.astype(float) @ rotation + EYE)
            return f"{off.mean():6.2f} {off[jumps].mean():6.2f}"

        print(f"{name + ' noise':28} {errors(frame)} mm")
        for way, (milliseconds, result) in in_turns(ways, frame).items():
            print(f"  {way:26} {errors(result)} mm {milliseconds:8.1f} ms")


if __name__ == "__main__":
    main()
