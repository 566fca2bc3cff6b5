# SPDX-License-Identifier: Apache-2.0
"""A method of one's own in NumPy, in place of the step that moves points."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable

import numpy as np

from . import _native
from ._arrays import Layout, as_mask, as_numpy, check_positions, rows
from ._cloud import Cloud
from ._errors import UsageError
from ._params import Params
from ._runs import borrowed
from ._values import kind_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Step = Callable[[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]], Any]

_NEIGHBORS = 24  # where k is "auto"


def nearest_neighbors(points: Any, k: int) -> NDArray[np.int64]:
    """The `k` nearest other points of each point, (N, k) row numbers, nearest first; -1 where there are fewer. A point
    that is not finite has no neighbours and is nobody's. Raises UsageError where float64 points are too far from each
    other for 32-bit floats around their middle. O(N log N).

    Examples:
        >>> nearest_neighbors(np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0]]), 2).tolist()
        [[1, 2], [0, 2], [1, 0]]
    """
    array = as_numpy(points)
    check_positions(array)
    if isinstance(k, (bool, np.bool_)) or not isinstance(k, (int, np.integer)) or not 1 <= k <= 512:
        raise UsageError(f"k cannot be {k!r}: give a whole number from 1 to 512")
    found = np.empty((len(array), int(k)), np.int64)
    positions = rows(array)
    in_float = _in_float(positions)
    _native.nearest_neighbors(in_float, found)
    _refuse_coarse(positions, in_float, found[:, 0])
    return found


def _refuse_coarse(positions: NDArray[Any], in_float: NDArray[np.float32], nearest: NDArray[np.int64]) -> None:
    """Raises UsageError where doubles lie so far from their middle that floats do not tell them apart; a few may."""
    if in_float is positions or not (nearest >= 0).any():
        return
    known = nearest >= 0
    apart = np.median(np.linalg.norm(positions[known] - positions[nearest[known]], axis=1))
    step = np.spacing(np.quantile(np.abs(in_float[known]).max(axis=1), 0.99).astype(np.float32))
    if 8 * step > apart > 0:
        raise UsageError(f"points lie {apart:.3g} apart and so far from each other that 32-bit floats step by {step:.3g}, which "
                         "does not tell their neighbours: give parts of the cloud that are less wide")


def refuse_with_step(**given: Any) -> None:
    """Raises UsageError for the first thing given, not None, that a run with a step would leave unread."""
    for name, value in given.items():
        if value is not None:
            raise UsageError(f"{name} does not go with step: leave it out")


def denoise_by_step(points: Any, step: Step, params: Params, *, mask: Any, box: Any, strength: float, device: str,
                    threads: int) -> Any:
    """What denoise does where it was given a step; `box` and `strength` as as_box and as_strength give them."""
    if not callable(step):
        raise UsageError(f"step is {kind_of(step)}: give a function of points, neighbors, normals and noise")
    if isinstance(points, Cloud):
        moved = points.copy()
        moved.xyz = denoise_by_step(points.xyz, step, params, mask=mask, box=box, strength=strength, device=device, threads=threads)
        return moved
    array = as_numpy(points)
    check_positions(array, images=True)
    layout = Layout(array, points)
    given = rows(array)
    before = layout.without_empty_pixels(given).astype(np.float64)
    movable = np.isfinite(before).all(axis=1)
    after = before.copy()
    after[movable] = _iterate(before[movable], step, params, device, threads)
    movable &= _within(before, as_mask(mask, len(before), layout.grid), box) & np.isfinite(after).all(axis=1)
    result = given.copy()
    from_there = before[movable]
    to = from_there + strength * (after[movable] - from_there)
    result[movable] = np.where(to == from_there, from_there, to)  # -0.0 stays
    out = array.copy("K")
    out[..., :3] = result.reshape(*layout.grid, 3)
    return out if layout.wrap is None else layout.wrap(out)


def _within(points: NDArray[np.float64], mask: Any, box: list[float] | None) -> NDArray[np.bool_]:
    within = np.ones(len(points), bool) if mask is None else mask.astype(bool)
    if box is not None:
        within &= ((points >= box[:3]) & (points <= box[3:])).all(axis=1)
    return within


def _iterate(points: NDArray[np.float64], step: Step, params: Params, device: str, threads: int) -> NDArray[np.float64]:
    """The finite points after all iterations."""
    k = _NEIGHBORS if params.k == "auto" else int(params.k)
    if len(points) < 4:
        return points
    before, centre = points, np.round(points.mean(axis=0))
    points = around = before - centre
    once = params.replace(iterations=1)
    with borrowed(device, threads) as pipeline:
        for _ in range(1 if params.iterations == "auto" else int(params.iterations)):
            normals, noise = np.empty(points.shape, np.float32), np.empty(len(points), np.float32)
            pipeline.load(points, False)
            pipeline.check_normals(once._native)
            pipeline.run(once._native, np.empty_like(points), 1.0, None, None, "", None)
            pipeline.normals(normals)
            pipeline.noise(noise, once._native)
            neighbors = nearest_neighbors(points, min(k, len(points) - 1))
            moved = np.asarray(step(points.copy(), neighbors, normals.astype(float), noise.astype(float)))
            if moved.shape != points.shape or moved.dtype.kind != "f":
                raise UsageError(f"step returned {moved.shape} of {moved.dtype}: return the new points, {points.shape} of float64")
            points = np.where(np.isfinite(moved).all(axis=1)[:, None], moved, points)
    result: NDArray[np.float64] = np.where(points == around, before, points + centre)  # which has fewer digits
    return result


def _in_float(points: NDArray[Any]) -> NDArray[np.float32]:
    """Positions around the median of the finite ones, which floats hold with most digits."""
    if points.dtype.itemsize == 4:
        return points
    finite = points[np.isfinite(points).all(axis=1)]
    with np.errstate(over="ignore"):
        around: NDArray[np.float32] = (points - (np.median(finite, axis=0) if len(finite) else 0)).astype(np.float32)
    return around
