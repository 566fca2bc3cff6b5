# SPDX-License-Identifier: Apache-2.0
"""Arrays of every kind as contiguous NumPy rows of x, y, z, and results in the kind that came in."""
from __future__ import annotations

import math
import numbers
import os
import sys
import warnings
from typing import Any, Callable, Literal

import numpy as np

from ._card import dlpack_device
from ._errors import DeviceError, UsageError
from ._values import encodable, kind_of

_HOST = (1, 3, 11)  # DLPack's devices whose memory the host reads: CPU, CUDA's and ROCm's page-locked


def _refuse_devices(points: Any) -> None:
    if getattr(points, "requires_grad", False):
        raise UsageError("the tensor requires a gradient, which denoise does not give: pass tensor.detach()")
    device = dlpack_device(points)
    if (device is not None and device[0] not in _HOST) or hasattr(points, "__cuda_array_interface__"):
        raise DeviceError("the array lies on a card, and this call takes arrays in host memory: copy it to the host, "
                          "tensor.cpu() in torch, array.get() in cupy")


_MADE_OF = {"mask": "bool", "faces": "int"}  # what arguments are; all else is of floats

# where laspy, Open3D, trimesh and others keep positions
_PARTS = {"xyz": "xyz", "points": "points", "vertices": "vertices", "point": "point.positions"}


def _no_array(value: Any, name: str) -> UsageError:
    holds_points = name in ("points", "xyz", "a", "b") or name.startswith("clouds")
    if isinstance(value, (str, bytes, os.PathLike)) and holds_points:
        return UsageError(f"{name} is {kind_of(value)}: give an array; of a file, pointfair.read(path) is a Cloud")
    for attribute, part in _PARTS.items() if holds_points else ():
        if hasattr(value, attribute):
            return UsageError(f"{name} is {kind_of(value)}: give its positions, {name}.{part}")
    advice = f"an array, numpy.asarray({name}, {_MADE_OF.get(name, 'float')})"
    if name == "clouds":
        advice = "a list of arrays, list(clouds)"
    return UsageError(f"{name} is {kind_of(value)}: give {advice} for instance")


def as_numpy(points: Any, name: str = "points") -> np.ndarray[Any, Any]:
    """The array as NumPy sees it, without a copy. Raises UsageError for what is no array."""
    if type(points) is np.ndarray:
        return points
    if isinstance(points, (list, tuple, str, bytes, os.PathLike, numbers.Number)) or points is None:
        raise _no_array(points, name)
    _refuse_devices(points)
    try:
        if isinstance(points, np.ma.MaskedArray) and np.ma.is_masked(points):
            filled = "numpy.nan) has NaN there, and such points keep their place" if name in ("points", "xyz") else "value) has a value there"
            raise UsageError(f"{name} has masked elements, which would count as the numbers under the mask: {name}.filled({filled}")
        if hasattr(points, "__array__") or hasattr(points, "__array_interface__"):
            return np.asarray(points)
        if hasattr(points, "__dlpack__"):
            return np.from_dlpack(points)
        try:
            memory = memoryview(points)
        except TypeError:
            raise _no_array(points, name) from None
        return np.asarray(memory)
    except UsageError:
        raise
    except (TypeError, ValueError, BufferError, RuntimeError) as error:
        if "bfloat16" in str(getattr(points, "dtype", "")):
            raise _no_floats("bfloat16", name) from None
        raise UsageError(f"{name} is {kind_of(points)}, which NumPy cannot see as an array: {error}") from None


def _no_floats(dtype: Any, name: str) -> UsageError:
    kind, method = ("float32", "float") if str(dtype) in ("float16", "bfloat16") else ("float64", "double")  # keeps all digits
    return UsageError(f"{name} has the type {dtype}: give float32 or float64, {name}.astype('{kind}') of an array or {name}.{method}() of a tensor")


def check_floats(array: np.ndarray[Any, Any], name: str) -> None:
    """Raises UsageError unless the array is float32 or float64."""
    if array.dtype.names:
        axes = ("x", "y", "z") if {"x", "y", "z"} <= set(array.dtype.names) else array.dtype.names[:3]
        columns = ", ".join(f"{name}[{axis!r}]" for axis in axes)
        raise UsageError(f"{name} has the fields {', '.join(array.dtype.names)}: give the coordinates alone, numpy.column_stack([{columns}]) for instance")
    if array.dtype.kind != "f" or array.dtype.itemsize not in (4, 8):
        raise _no_floats(array.dtype, name)


def check_positions(array: np.ndarray[Any, Any], name: str = "points", images: bool = False) -> None:
    """Raises UsageError unless the array has N rows, or with `images` H x W pixels, of 3 or 4 float32 or float64."""
    check_floats(array, name)
    if array.ndim not in ((2, 3) if images else (2,)) or array.shape[-1] not in (3, 4):
        advice = _how_to_positions(array, name)
        image = ", or an image of points, (H, W, 3)" if images else ""
        raise UsageError(f"{name} has the shape {array.shape}: give (N, 3), or (N, 4) whose last column stays{image}{advice}")
    if array.ndim == 3 and _is_no_image(array):
        warnings.warn(f"{name} has the shape {array.shape} and is taken as one image of points, but the points of its rows are in no order: "
                      "denoise_batch takes a batch of clouds, each for itself", stacklevel=3)


def _how_to_positions(array: np.ndarray[Any, Any], name: str) -> str:
    """What makes positions of an array of another shape; empty where nothing is likely."""
    if array.ndim == 3 and array.shape[2] not in (3, 4) and 3 in array.shape[:2]:
        axes = (1, 2, 0) if array.shape[0] == 3 and array.shape[1] != 3 else (0, 2, 1)
        return f"; numpy.transpose({name}, {axes}) has the coordinates last, and denoise_batch takes a batch of clouds"
    if array.ndim == 3:
        return "; reshape(-1, 3) makes one of an image"
    if array.ndim == 2 and array.shape[0] in (3, 4) and array.shape[1] > 4:
        return f"; {name}.T has a point in each row"
    return f"; {name}[:, :3] has the coordinates alone" if array.ndim == 2 and array.shape[1] > 4 else ""


def _is_no_image(array: np.ndarray[Any, Any]) -> bool:
    """Whether neighbours in rows are about as far apart as other points of the row, as in a batch of clouds: from a sample."""
    fewest, rows_looked_at, pixels = 64, 32, 256
    some = array[:: max(1, array.shape[0] // rows_looked_at), :pixels, :3]
    some = np.where((some == 0).all(axis=-1, keepdims=True), np.nan, some)  # a camera measured nothing there
    with np.errstate(all="ignore"):
        near = np.linalg.norm(some[:, 1:] - some[:, :-1], axis=-1)
        far = np.linalg.norm(some - np.roll(some, some.shape[1] // 2, axis=1), axis=-1)
    near, far = near[np.isfinite(near)], far[np.isfinite(far)]
    return some.shape[1] >= 16 and min(len(near), len(far)) >= fewest and bool(np.median(near) > np.median(far) / 2)


def rows(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """x, y, z as contiguous rows in native byte order; the array's own memory where it is that."""
    if array.dtype.isnative and array.flags.c_contiguous and array.flags.aligned and array.shape[-1] == 3:
        return array if array.ndim == 2 else array.reshape(-1, 3)
    return np.array(array[..., :3], array.dtype.newbyteorder("="), order="C").reshape(-1, 3)


def grid_of(array: Any) -> tuple[int, ...]:
    """(H, W) of an image of points, () of all else."""
    shape = tuple(getattr(array, "shape", ()))
    return shape[:2] if len(shape) == 3 else ()


class Layout:
    """Shape, type, order and kind of an array, to give a result in."""

    def __init__(self, array: np.ndarray[Any, Any], like: Any) -> None:
        self.shape, self.dtype = array.shape, array.dtype
        self.grid = array.shape[:-1]
        self.width = self.grid[1] if len(self.grid) == 2 else 0  # pixels a row of an image
        self.order: Literal["C", "F"] = "F" if abs(array.strides[0]) < abs(array.strides[-1]) else "C"
        self.last = array[..., 3] if array.shape[-1] == 4 else None
        self.wrap = wrapper(like)
        self._empty: tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]] | None = None  # which rows they are, and these

    def without_empty_pixels(self, points: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """The rows of an image with NaN at its pixels (0, 0, 0), where the camera measured nothing; other rows as they are."""
        if len(self.grid) == 1:
            return points
        empty = (points == 0).all(axis=1)
        if not empty.any():
            return points
        self._empty, points = (empty, points[empty]), points.copy()
        points[empty] = np.nan
        return points

    def restore_empty_pixels(self, moved: np.ndarray[Any, Any]) -> None:
        """Puts them back into the rows of a result."""
        if self._empty is not None:
            empty, rows_before = self._empty  # 0.0 or -0.0
            moved[empty] = rows_before

    def keep(self) -> Layout:
        """The same when the caller's array changes later."""
        if self.last is not None:
            self.last = self.last.copy()
        return self


class Result:
    """Memory for a result: `rows` is to be filled, then `finish` gives it in the layout."""

    def __init__(self, layout: Layout, out: Any = None) -> None:
        self.layout, self.given = layout, out
        self.array = np.empty(layout.shape, layout.dtype, layout.order) if out is None else writable(out, layout)
        fits = layout.last is None and self.array.flags.c_contiguous and self.array.flags.aligned and layout.dtype.isnative
        self.rows = rows(self.array) if fits else np.empty((math.prod(layout.grid), 3), layout.dtype.newbyteorder("="))
        self.fits = fits

    def finish(self) -> Any:
        """`out` itself, or a new array of the caller's kind."""
        self.layout.restore_empty_pixels(self.rows)
        if not self.fits:
            if self.layout.last is not None:
                self.array[..., 3] = self.layout.last
            self.array[..., :3] = self.rows.reshape(*self.layout.grid, 3)
        if self.given is not None:
            return self.given
        return self.array if self.layout.wrap is None else self.layout.wrap(self.array)


def writable(out: Any, like: Layout | np.ndarray[Any, Any], name: str = "points") -> np.ndarray[Any, Any]:
    """`out` as NumPy sees it. Raises UsageError unless it can take a result of the shape and type of the input."""
    target = as_numpy(out, "out")
    if target.shape != like.shape or target.dtype != like.dtype:
        raise UsageError(f"out is {target.shape} of {target.dtype}, {name} {like.shape} of {like.dtype}: they must agree")
    if not target.flags.writeable:
        raise UsageError("out is read-only: give an array that can be written")
    return target


def wrapper(like: Any) -> Callable[[Any], Any] | None:
    """What makes an array of the kind of `like` from NumPy's memory; None for NumPy's own."""
    kind = type(like)
    if kind is np.ndarray or isinstance(like, np.ndarray):
        return None
    package = kind.__module__.partition(".")[0]
    if package == "torch":
        return sys.modules["torch"].from_numpy  # type: ignore[no-any-return]
    if package == "open3d":
        return getattr(kind, "from_numpy", kind)  # the vectors of legacy clouds are made of arrays
    if hasattr(like, "__array_namespace__"):
        return like.__array_namespace__().asarray  # type: ignore[no-any-return]
    return None


def _of_each(array: np.ndarray[Any, Any], points: int, grid: tuple[int, ...]) -> bool:
    """Whether the array has one element for each point, in a row or in the grid of an image."""
    return array.shape in ((points,), grid)


def as_mask(mask: Any, points: int, grid: tuple[int, ...] = ()) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
    """A mask as bytes, 1 for each point that may move; `grid` is the shape of an image of points."""
    if mask is None:
        return None
    array = as_numpy(mask, "mask")
    if array.dtype != np.bool_:
        raise UsageError(f"mask has the type {array.dtype}: give booleans, True for each point that may move")
    if not _of_each(array, points, grid):
        raise UsageError(f"mask has the shape {array.shape}: give one boolean for each of the {points} points")
    return np.ascontiguousarray(array).view(np.uint8).reshape(-1)


def as_sigmas(sigmas: Any, points: int, grid: tuple[int, ...] = ()) -> np.ndarray[Any, np.dtype[np.float32]]:
    """One number for each point, as float32; no numbers for None."""
    if sigmas is None:
        return np.empty(0, np.float32)
    if isinstance(sigmas, numbers.Number):
        raise UsageError(f"sigmas is one number: give one for each of the {points} points, or this one as noise={sigmas} to run")
    array = as_numpy(sigmas, "sigmas")
    if array.dtype.kind not in "fiu":
        raise UsageError(f"sigmas has the type {array.dtype}: give numbers, a standard deviation for each point")
    if not _of_each(array, points, grid):
        raise UsageError(f"sigmas has the shape {array.shape}: give one number for each of the {points} points")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32).reshape(-1)


def as_viewpoint(viewpoint: Any, points: int, grid: tuple[int, ...] = ()) -> np.ndarray[Any, np.dtype[np.float64]]:
    """One position, or one for each point, as rows of doubles; no rows for None."""
    if viewpoint is None:
        return np.empty((0, 3))
    try:
        array = np.asarray(viewpoint, float) if isinstance(viewpoint, (list, tuple)) else as_numpy(viewpoint, "viewpoint")
    except (TypeError, ValueError):
        raise UsageError(f"viewpoint cannot be {viewpoint!r}: give where the sensor stood, (x, y, z)") from None
    if array.dtype.kind not in "fiu" or array.shape not in ((3,), (1, 3), (points, 3), (*grid, 3)):
        raise UsageError(f"viewpoint has the shape {array.shape} and the type {array.dtype}: give where the sensor stood, "
                         f"(3,), or a position for each of the {points} points, ({points}, 3)")
    return np.ascontiguousarray(array.reshape(-1, 3), np.float64)


def as_faces(faces: Any) -> np.ndarray[Any, np.dtype[np.uint32]]:
    """Faces of as many corners each, as rows of point numbers."""
    if isinstance(faces, (list, tuple)):
        try:
            faces = np.asarray(faces)
        except ValueError:
            raise UsageError("faces have different numbers of corners: give one number for all, (F, 3) integers for triangles, "
                             "(F, 4) for quads") from None
    array = as_numpy(faces, "faces")
    if array.dtype.kind not in "iu" or array.ndim != 2 or array.shape[1] < 3:
        raise UsageError(f"faces has the shape {array.shape} and the type {array.dtype}: give the point numbers of each "
                         "face, (F, 3) integers for triangles, (F, 4) for quads")
    if array.size > 0 and (array.min() < 0 or array.max() >= 2**32):
        raise UsageError(f"faces has the corner {array.min() if array.min() < 0 else array.max()}: corners are numbers of "
                         "points, from 0")
    return np.ascontiguousarray(array, np.uint32)


def as_box(box: Any) -> list[float] | None:
    """A box ((x, y, z), (x, y, z)), lower and upper corner, as six numbers."""
    if box is None:
        return None
    try:
        corners = np.asarray(box, float)
    except (TypeError, ValueError):
        raise UsageError(f"box cannot be {box!r}: give the lower and the upper corner, ((x, y, z), (x, y, z))") from None
    if corners.shape != (2, 3) or not (corners[0] <= corners[1]).all():
        raise UsageError(f"box cannot be {box!r}: give the lower and the upper corner, ((x, y, z), (x, y, z))")
    numbers: list[float] = corners.ravel().tolist()
    return numbers


def as_strength(strength: Any) -> float:
    """A number from 0 to 1."""
    try:
        value = float(strength)
    except (TypeError, ValueError):
        value = -1.0
    if not 0 <= value <= 1:
        raise UsageError(f"strength cannot be {strength!r}: give a number from 0, the input, to 1, the result")
    return value


def as_selections(text: Any, name: str) -> str:
    """A choice of points by an attribute, "classification=2,6"; nothing for None."""
    if text is None:
        return ""
    if not isinstance(text, str) or not text:
        raise UsageError(f"{name} cannot be {text!r}: give an attribute and whole numbers, 'classification=2,6-9' for instance")
    return encodable(text)
