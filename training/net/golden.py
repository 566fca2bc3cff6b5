# SPDX-License-Identifier: Apache-2.0
"""Writes the clouds by which tests/test_learned.cpp compares the program with the integer reference.

    python golden.py WEIGHTS FOLDER

A file is: the number of points (uint32), the corner (3 floats), then for each point 13 floats: measured, classical,
normal, noise, refined.
"""
import struct
import sys
from pathlib import Path

import numpy as np

import reference


def sphere(rng):
    clean = rng.normal(size=(900, 3))
    clean /= np.linalg.norm(clean, axis=1, keepdims=True)
    return clean, clean, 0.05 * (1.2 + clean[:, 0])


def edge(rng):
    """Two planes that meet; so few points that coarse scales lack neighbours."""
    clean = rng.uniform(-1, 1, (300, 3))
    left = clean[:, 0] < 0
    clean[left, 0], clean[~left, 1] = 0, 0
    normal = np.where(left[:, None], [1.0, 0, 0], [0, 1.0, 0])
    return clean, normal, np.full(300, 0.03)


def waves(rng):
    """Uneven, far from the origin, in small units; some points have no normal."""
    x, y = rng.uniform(-1, 1, (2, 1300)) ** 3
    slope = 1.5 * np.cos(5 * x)
    normal = np.stack([-slope, 0 * x, 1 + 0 * x], 1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal[::97] = 0
    return np.stack([x, y, 0.3 * np.sin(5 * x)], 1) + [30.0, -20, 7], normal, 0.004 + 0.02 * np.abs(y)


def write(path, weights, seed, shape):
    rng = np.random.default_rng(seed)
    clean, normal, noise = shape(rng)
    measured = clean + noise[:, None] * rng.normal(size=clean.shape)
    classical = clean + (0.3 * noise)[:, None] * rng.normal(size=clean.shape)
    normal = normal * rng.choice([-1.0, 1.0], (len(clean), 1))
    rows = [a.astype(np.float32) for a in (measured, classical, normal, noise)]
    corner = rows[0].min(0)
    refined = reference.refine(weights, *rows, corner)
    moved = np.linalg.norm(refined - rows[1], axis=1) / rows[3]
    with open(path, "wb") as file:
        file.write(struct.pack("<I3f", len(clean), *corner))
        file.write(np.concatenate([*rows[:3], rows[3][:, None], refined], 1).astype("<f4").tobytes())
    print(f"{path}: {len(clean)} points, moved by {moved.mean():.3f} noises, at most {moved.max():.3f}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder = Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for number, shape in enumerate((sphere, edge, waves)):
        write(folder / f"{shape.__name__}.bin", reference.Weights(sys.argv[1]), number + 1, shape)
