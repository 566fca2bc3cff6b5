# SPDX-License-Identifier: Apache-2.0
"""Fields of random numbers of variance 1: what the errors of sensors and objects are made of."""
import numpy as np
from scipy.ndimage import gaussian_filter, uniform_filter
from scipy.spatial import cKDTree

Random = np.random.Generator


def blurred(rng: Random, shape: tuple[int, int], pixels: float) -> np.ndarray:
    """On a grid, blurred with a Gaussian of this width; .5 and less is white."""
    field = gaussian_filter(rng.normal(size=shape), pixels, mode="wrap")
    return field / field.std()


def window_matched(rng: Random, shape: tuple[int, int], window: int, passes: int = 1) -> np.ndarray:
    """On a grid, averaged over a square window of pixels, as block matching does; each further pass makes neighbours more
    alike (by 1 - 1 / window after one)."""
    field = rng.normal(size=shape)
    for _ in range(passes):
        field = uniform_filter(field, window, mode="wrap")
    return field / field.std()


def waves(rng: Random, points: np.ndarray, length: float, count: int = 120) -> np.ndarray:
    """In space, correlated over about `length`: a sum of waves with a Gaussian spectrum."""
    number, phase = rng.normal(size=(count, 3)) / length, rng.uniform(0, 2 * np.pi, count)
    points, number, phase = (array.astype(np.float32) for array in (points - points.mean(0), number, phase))
    field = np.zeros(len(points), np.float32)
    for wave, start in zip(number, phase):
        field += np.cos(points @ wave + start)
    return field.astype(float) * np.sqrt(2 / count)


def neighbour_averaged(rng: Random, points: np.ndarray, rounds: int, columns: int = 3, neighbours: int = 16) -> np.ndarray:
    """On points, (n, columns), averaged with that of the nearest points so many times."""
    field = rng.normal(size=(len(points), columns))
    near = cKDTree(points).query(points, neighbours + 1)[1][:, 1:]
    for _ in range(rounds):
        field = (field[near].mean(1) + field) / 2
    return field / field.std()


def heavy_tailed(rng: Random, shape: tuple[int, ...]) -> np.ndarray:
    """Normal numbers, each row with a spread of its own (Laplace in each column)."""
    return rng.normal(size=shape) * np.sqrt(-np.log(np.maximum(rng.random((shape[0], *[1] * (len(shape) - 1))), 1e-6)))


def direction(rng: Random) -> np.ndarray:
    """Of length 1."""
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)
