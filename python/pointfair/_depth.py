# SPDX-License-Identifier: Apache-2.0
"""Frames of depth cameras, fast."""
from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from . import _native
from ._arrays import as_numpy, check_floats, wrapper, writable
from ._cloud import Cloud
from ._errors import UsageError
from ._values import as_threads

Frame = TypeVar("Frame")

_FEW_ROWS = 16  # an image of so few columns with more rows is none
_LOOKED_AT = 2000  # pixels that say where the camera is
_ASIDE, _AHEAD = 0.1, 0.3  # of the distance; nearer, its place is (0, 0, 0): a lens that distorts shows it ahead or behind
_SOME = 0.01  # of the pixels


def denoise_depth(frame: Frame, *, out: Any = None, threads: int = 0) -> Frame:
    """Denoises a frame of a depth camera in a few milliseconds: an image of depths, or of points in the camera's own
    coordinates, whose z is the depth. Each pixel moves along its ray to the mean of what pairs of pixels around it
    say, but for pairs beyond a jump or an edge. The noise is measured in the frame. On the correlated noise of stereo
    and structured light it leaves no more than denoise; on independent noise and on time of flight, denoise leaves less.

    Args:
        frame: depths, (H, W), or points, (H, W, 3) or (H, W, 4), float32 or float64: a NumPy array, a tensor in host
            memory, or a Cloud of an organised PCD file. Points that a transform moved or turned are in no camera's coordinates.
            Pixels whose depth is 0 or not finite, where nothing was
            measured, keep their bits.
        out: an array for the result, of the same shape and type; it may be `frame` itself. None for a Cloud.
        threads: CPU threads; 0: all cores.

    Returns:
        The frame with moved pixels, in the type, shape and kind that came in; of a Cloud, a new one with all its
        attributes. The same bits for any number of threads.

    Raises:
        UsageError: an argument has a wrong shape, type or value, or the points show that (0, 0, 0) is not the camera.

    Examples:
        >>> noise = np.random.default_rng(1).normal(0, 0.01, (120, 160))
        >>> smooth = denoise_depth(2 + noise)
        >>> bool(smooth.std() < 0.4 * noise.std())
        True
    """
    if isinstance(frame, Cloud):
        return _of_cloud(frame, out, threads)  # type: ignore[return-value]
    array = as_numpy(frame, "frame")
    check_floats(array, "frame")
    if array.ndim != 2 and (array.ndim != 3 or array.shape[2] not in (3, 4)):
        raise UsageError(f"frame has the shape {array.shape}: give depths, (H, W), or points, (H, W, 3)")
    if array.ndim == 2 and array.shape[1] in (3, 4) and array.shape[0] > _FEW_ROWS:
        raise UsageError(f"frame has the shape {array.shape}, which is that of points in a row and no image: give "
                         "frame.reshape(H, W, -1), or depths, (H, W)")
    threads = as_threads(threads)
    result = np.empty(array.shape, array.dtype) if out is None else writable(out, array, "frame")
    if array.ndim == 2:
        np.multiply(array, _factors(array, threads), out=result)
    else:
        _refuse_other_coordinates(array)
        measured = np.isfinite(array[..., 0]) & np.isfinite(array[..., 1])
        factors, last = _factors(np.where(measured, array[..., 2], 0), threads), array[..., 3:].copy()
        np.multiply(array[..., :3], factors[..., None], out=result[..., :3])
        result[..., 3:] = last
    if out is not None:
        return out  # type: ignore[no-any-return]
    wrap = wrapper(frame)
    done: Any = result if wrap is None else wrap(result)
    return done  # type: ignore[no-any-return]


def _refuse_other_coordinates(points: np.ndarray[Any, Any]) -> None:
    """Raises UsageError for points that are not in the camera's own coordinates, as far as some of them tell: rays that meet
    elsewhere than at (0, 0, 0), or depths of both signs."""
    step = max(1, round((points.shape[0] * points.shape[1] / _LOOKED_AT) ** 0.5))
    some = points[::step, ::step, :3]
    image = np.ascontiguousarray(some.reshape(-1, 3), np.float64)
    measured = image[np.isfinite(image).all(axis=1) & (image[:, 2] != 0)]
    if len(measured) == 0:
        return
    advice = "give points in the camera's own coordinates, whose z is the depth; denoise takes any"
    if _SOME < (measured[:, 2] < 0).mean() < 1 - _SOME:
        raise UsageError(f"the frame has points with z below and above 0, so that z is no depth: {advice}")
    camera = _native.image_viewpoint(image, some.shape[1])
    if camera is None:
        return
    way = np.median(measured - camera, axis=0)
    distance = float(np.linalg.norm(way))
    ahead = abs(float(np.dot(camera, way))) / distance
    aside = float(np.linalg.norm(np.cross(camera, way))) / distance
    if aside > _ASIDE * distance or ahead > _AHEAD * distance:
        place = ", ".join(f"{value:.4g}" for value in camera)
        raise UsageError(f"the rays of the frame's pixels meet at ({place}), and not at (0, 0, 0): {advice}")


def _of_cloud(cloud: Cloud, out: Any, threads: int) -> Cloud:
    if cloud.grid is None:
        raise UsageError("the cloud is no image: give one of an organised PCD file (HEIGHT above 1), or an array (H, W, 3)")
    if out is not None:
        raise UsageError("out is for arrays: of a Cloud the result is a new Cloud")
    result = cloud.copy()
    result.xyz = denoise_depth(cloud.xyz.reshape(*cloud.grid, 3), threads=threads).reshape(-1, 3)
    return result


def _factors(depths: np.ndarray[Any, Any], threads: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    """What the depths are to be multiplied by; 1 where they stay."""
    with np.errstate(over="ignore"):
        before = np.ascontiguousarray(depths, np.float32)
    after = np.empty_like(before)
    _native.denoise_depth(before, after, threads)
    return np.divide(after, before, out=np.ones_like(before), where=(after != before) & np.isfinite(before))
