# SPDX-License-Identifier: Apache-2.0
"""Arrays of every kind as contiguous NumPy rows of x, y, z, and results in the kind that came in."""
from __future__ import annotations

import sys
from typing import Any, Callable, Literal

import numpy as np

from ._card import dlpack_device
from ._errors import DeviceError, UsageError
from ._values import encodable

_HOST = (1, 3, 11)  # DLPack's devices whose memory the host reads: CPU, CUDA's and ROCm's page-locked


def _refuse_devices(points: Any) -> None:
    if getattr(points, "requires_grad", False):
        raise UsageError("the tensor requires a gradient, which denoise does not give: pass tensor.detach()")
    device = dlpack_device(points)
    if (device is not None and device[0] not in _HOST) or hasattr(points, "__cuda_array_interface__"):
        raise DeviceError("the array lies on a card, and this call takes arrays in host memory: copy it to the host, "
                          "tensor.cpu() in torch, array.get() in cupy")


def as_numpy(points: Any, name: str = "points") -> np.ndarray[Any, Any]:
    """The array as NumPy sees it, without a copy. Raises UsageError for what is no array."""
    if type(points) is np.ndarray:
        return points
    if isinstance(points, (list, tuple, str, bytes)) or points is None:
        raise UsageError(f"{name} is a {type(points).__name__}: give an array, numpy.asarray({name}, float) for instance")
    _refuse_devices(points)
    try:
        if hasattr(points, "__array__") or hasattr(points, "__array_interface__"):
            return np.asarray(points)
        if hasattr(points, "__dlpack__"):
            return np.from_dlpack(points)
        return np.asarray(memoryview(points))
    except (TypeError, ValueError, BufferError, RuntimeError) as error:
        raise UsageError(f"{name} is a {type(points).__name__}, which NumPy cannot see as an array: {error}") from None


def check_positions(array: np.ndarray[Any, Any], name: str = "points") -> None:
    """Raises UsageError unless the array has N rows of 3 or 4 float32 or float64."""
    if array.dtype.kind != "f" or array.dtype.itemsize not in (4, 8):
        raise UsageError(f"{name} has the type {array.dtype}: give float32 or float64, {name}.astype('float32') for instance")
    if array.ndim != 2 or array.shape[1] not in (3, 4):
        advice = "; denoise_batch takes many clouds, reshape(-1, 3) makes one of an image" if array.ndim == 3 else ""
        raise UsageError(f"{name} has the shape {array.shape}: give (N, 3), or (N, 4) whose last column stays{advice}")


def rows(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """x, y, z as contiguous rows in native byte order; the array itself where it is that."""
    if array.dtype.isnative and array.flags.c_contiguous and array.flags.aligned and array.shape[1] == 3:
        return array
    return np.array(array[:, :3], array.dtype.newbyteorder("="), order="C")


class Layout:
    """Shape, type, order and kind of an array, to give a result in."""

    def __init__(self, array: np.ndarray[Any, Any], like: Any) -> None:
        self.shape, self.dtype = array.shape, array.dtype
        self.order: Literal["C", "F"] = "F" if abs(array.strides[0]) < abs(array.strides[1]) else "C"
        self.last = array[:, 3] if array.shape[1] == 4 else None
        self.wrap = _wrapper(like)

    def keep(self) -> Layout:
        """The same when the caller's array changes later."""
        if self.last is not None:
            self.last = self.last.copy()
        return self


class Result:
    """Memory for a result: `rows` is to be filled, then `finish` gives it in the layout."""

    def __init__(self, layout: Layout, out: Any = None) -> None:
        self.layout, self.given = layout, out
        self.array = np.empty(layout.shape, layout.dtype, layout.order) if out is None else _writable(out, layout)
        fits = layout.last is None and self.array.flags.c_contiguous and self.array.flags.aligned and layout.dtype.isnative
        self.rows = self.array if fits else np.empty((layout.shape[0], 3), layout.dtype.newbyteorder("="))

    def finish(self) -> Any:
        """`out` itself, or a new array of the caller's kind."""
        if self.array is not self.rows:
            if self.layout.last is not None:
                self.array[:, 3] = self.layout.last
            self.array[:, :3] = self.rows
        if self.given is not None:
            return self.given
        return self.array if self.layout.wrap is None else self.layout.wrap(self.array)


def _writable(out: Any, layout: Layout) -> np.ndarray[Any, Any]:
    target = as_numpy(out, "out")
    if target.shape != layout.shape or target.dtype != layout.dtype:
        raise UsageError(f"out is {target.shape} of {target.dtype}, points {layout.shape} of {layout.dtype}: they must agree")
    if not target.flags.writeable:
        raise UsageError("out is read-only: give an array that can be written")
    return target


def _wrapper(like: Any) -> Callable[[Any], Any] | None:
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


def as_mask(mask: Any, points: int) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
    """A mask as bytes, 1 for each point that may move."""
    if mask is None:
        return None
    array = as_numpy(mask, "mask")
    if array.dtype != np.bool_:
        raise UsageError(f"mask has the type {array.dtype}: give booleans, True for each point that may move")
    if array.shape != (points,):
        raise UsageError(f"mask has the shape {array.shape}: give one boolean for each of the {points} points")
    return np.ascontiguousarray(array).view(np.uint8)


def as_sigmas(sigmas: Any, points: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    """One number for each point, as float32; no numbers for None."""
    if sigmas is None:
        return np.empty(0, np.float32)
    array = as_numpy(sigmas, "sigmas")
    if array.dtype.kind not in "fiu":
        raise UsageError(f"sigmas has the type {array.dtype}: give numbers, a standard deviation for each point")
    if array.shape != (points,):
        raise UsageError(f"sigmas has the shape {array.shape}: give one number for each of the {points} points")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32)


def as_viewpoint(viewpoint: Any, points: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """One position, or one for each point, as rows of doubles; no rows for None."""
    if viewpoint is None:
        return np.empty((0, 3))
    try:
        array = np.asarray(viewpoint, float) if isinstance(viewpoint, (list, tuple)) else as_numpy(viewpoint, "viewpoint")
    except (TypeError, ValueError):
        raise UsageError(f"viewpoint cannot be {viewpoint!r}: give where the sensor stood, (x, y, z)") from None
    if array.dtype.kind not in "fiu" or array.shape not in ((3,), (1, 3), (points, 3)):
        raise UsageError(f"viewpoint has the shape {array.shape} and the type {array.dtype}: give where the sensor stood, "
                         f"(3,), or a position for each of the {points} points, ({points}, 3)")
    return np.ascontiguousarray(array.reshape(-1, 3), np.float64)


def as_faces(faces: Any) -> np.ndarray[Any, np.dtype[np.uint32]]:
    """Faces of as many corners each, as rows of point numbers."""
    array = np.asarray(faces) if isinstance(faces, (list, tuple)) else as_numpy(faces, "faces")
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
