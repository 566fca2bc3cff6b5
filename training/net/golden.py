# SPDX-License-Identifier: Apache-2.0
"""Writes the clouds by which tests compare the program with the integer reference, to FOLDER/clouds.bin.

    python golden.py WEIGHTS FOLDER

The file has cloud after cloud: the number of points (uint32), the corner (3 floats), then for each point 13 floats:
measured, classical, normal, noise, refined. Coordinates are rounded to 2^-12 in every third cloud, so that distances
tie.
"""
import struct
import sys
from pathlib import Path

import numpy as np

import reference


def sphere(rng, points):
    clean = rng.normal(size=(points, 3))
    clean /= np.linalg.norm(clean, axis=1, keepdims=True)
    return clean, clean, 0.05 * (1.2 + clean[:, 0])


def edge(rng, points):
    """Two planes that meet; so few points that coarse scales lack neighbours."""
    clean = rng.uniform(-1, 1, (points, 3))
    left = clean[:, 0] < 0
    clean[left, 0], clean[~left, 1] = 0, 0
    normal = np.where(left[:, None], [1.0, 0, 0], [0, 1.0, 0])
    return clean, normal, np.full(points, 0.03)


def waves(rng, points):
    """Uneven, far from the origin, in small units; some points have no normal."""
    x, y = rng.uniform(-1, 1, (2, points)) ** 3
    slope = 1.5 * np.cos(5 * x)
    normal = np.stack([-slope, 0 * x, 1 + 0 * x], 1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal[::97] = 0
    return np.stack([x, y, 0.3 * np.sin(5 * x)], 1) + [30.0, -20, 7], normal, 0.004 + 0.02 * np.abs(y)


def grid(rng, points):
    """A lattice: most distances tie, and its noise is nearly 0 in places."""
    side = int(points**0.5)
    x, y = np.divmod(np.arange(side * side), side)
    clean = np.stack([x / 8, y / 8, 0 * x], 1).astype(float)
    return clean, np.tile([0.0, 0, 1], (side * side, 1)), np.where(x % 5 == 0, 1e-6, 0.01)


# The first has points enough for a list of each scale, the last for one list.
CLOUDS = [(sphere, 1400), (waves, 700), (edge, 300), (grid, 400), (sphere, 500), (waves, 350), (edge, 90), (grid, 150)]
CLOUDS += [(shape, count) for count in (200, 70, 33) for shape in (sphere, edge, waves, grid)][:11] + [(sphere, 17)]


def cloud(weights, number, shape, points):
    rng = np.random.default_rng(number + 1)
    clean, normal, noise = shape(rng, points)
    measured = clean + noise[:, None] * rng.normal(size=clean.shape)
    classical = clean + (0.3 * noise)[:, None] * rng.normal(size=clean.shape)
    if number % 3 == 2:
        measured, classical = np.round(measured * 4096) / 4096, np.round(classical * 4096) / 4096
    normal = normal * rng.choice([-1.0, 1.0], (len(clean), 1))
    rows = [a.astype(np.float32) for a in (measured, classical, normal, noise)]
    rows, corner = [a[np.unique(rows[1], axis=0, return_index=True)[1]] for a in rows], rows[0].min(0)
    refined = reference.refine(weights, *rows, corner)
    moved = np.linalg.norm(refined - rows[1], axis=1) / rows[3]
    print(f"{shape.__name__}: {len(refined)} points, moved by {moved.mean():.3f} noises, at most {moved.max():.3f}")
    columns = np.concatenate([*rows[:3], rows[3][:, None], refined], 1)
    return struct.pack("<I3f", len(refined), *corner) + columns.astype("<f4").tobytes()


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder = Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    its = reference.Weights(sys.argv[1])
    with open(folder / "clouds.bin", "wb") as file:
        for number, (shape, points) in enumerate(CLOUDS):
            file.write(cloud(its, number, shape, points))
