# SPDX-License-Identifier: Apache-2.0
"""Arrays in the memory of a card, of torch, CuPy, Numba and whatever speaks DLPack or __cuda_array_interface__."""
from __future__ import annotations

import sys
from typing import Any

import numpy as np

from . import _native
from ._errors import DeviceError, UsageError

_CUDA, _CUDA_MANAGED = 2, 13  # DLPack's devices
_LEGACY, _PER_THREAD = 1, 2  # the streams that have numbers


def dlpack_device(points: Any) -> tuple[int, int] | None:
    """Kind and number of the device of an array that speaks DLPack, None for others. Raises UsageError where there is
    no memory, as in torch's meta tensors."""
    device = getattr(points, "__dlpack_device__", None)
    if device is None:
        return None
    try:
        kind, number = device()
    except (TypeError, ValueError, BufferError, RuntimeError) as error:
        raise UsageError(f"the {type(points).__name__} has no memory that can be read: give an array in host memory or on "
                         f"a CUDA card ({error})") from None
    return int(getattr(kind, "value", kind)), int(number)


def is_on_card(points: Any) -> bool:
    """Whether the array lies in the memory of a CUDA card."""
    device = dlpack_device(points)
    if device is None:
        return hasattr(points, "__cuda_array_interface__")
    return device[0] in (_CUDA, _CUDA_MANAGED)


def _package(points: Any) -> str:
    return type(points).__module__.partition(".")[0]


class CardLayout:
    """Shape, type, card and kind of an array on a card, to give results in. Raises UsageError for what holds no
    positions."""

    def __init__(self, points: Any, name: str = "points", any_shape: bool = False) -> None:
        if getattr(points, "requires_grad", False):
            raise UsageError("the tensor requires a gradient, which denoise does not give: pass tensor.detach()")
        self.shape, self.dtype = tuple(points.shape), str(points.dtype).rpartition(".")[2]
        if self.dtype not in ("float32", "float64"):
            raise UsageError(f"{name} has the type {self.dtype}: give float32 or float64")
        if not any_shape and (len(self.shape) != 2 or self.shape[1] not in (3, 4)):
            raise UsageError(f"{name} has the shape {self.shape}: give (N, 3), or (N, 4) whose last column stays")
        self.package, self.card = _package(points), _card_of(points)

    @property
    def device(self) -> str:
        return f"cuda:{self.card}"

    def check_device(self, device: str) -> str:
        """The name of the device to compute on, which must be where the array lies."""
        if device == "auto":
            return self.device
        if device == "cpu":
            raise UsageError(f"the array lies on {self.device} and device is 'cpu': leave device out, or copy the array to the host")
        return device

    def check_out(self, out: Any) -> None:
        if not is_on_card(out):
            raise UsageError(f"out lies in host memory and points on {self.device}: they must agree")
        its = CardLayout(out, "out")
        if (its.shape, its.dtype, its.card) != (self.shape, self.dtype, self.card):
            raise UsageError(f"out is {its.shape} of {its.dtype} on {its.device}, points {self.shape} of {self.dtype} on "
                             f"{self.device}: they must agree")


def layout_of(points: Any) -> CardLayout | None:
    """The layout of an array on a card, None for anything else."""
    return CardLayout(points) if type(points) is not np.ndarray and is_on_card(points) else None


def _card_of(points: Any) -> int:
    device = dlpack_device(points)
    return device[1] if device is not None else 0


def current_stream(layout: CardLayout) -> int:
    """The number of the stream on which the array's package works now."""
    number = _LEGACY
    if layout.package == "torch":
        number = sys.modules["torch"].cuda.current_stream(layout.card).cuda_stream
    elif layout.package == "cupy":
        cupy = sys.modules["cupy"]
        with cupy.cuda.Device(layout.card):
            stream = cupy.cuda.get_current_stream()
        number = stream.ptr
        if number == _PER_THREAD:  # means another one on the thread that computes
            stream.synchronize()
            number = _LEGACY
    return number or _LEGACY


def card_array(points: Any, stream: int) -> _native.CardArray:
    """x, y, z of the array as the native calls take them, ready on the stream."""
    rows = points if points.shape[1] == 3 else points[:, :3]
    if _package(rows) == "torch":  # `stream` is torch's own, so nothing is to be ordered, for which DLPack takes 10 us
        row_stride, column_stride = rows.stride()
        return _native.CardArray(rows.data_ptr(), len(rows), row_stride, column_stride, rows.element_size() == 8, rows.get_device())
    if hasattr(rows, "__dlpack__"):
        return _native.CardArray(rows.__dlpack__(stream=stream))
    interface = rows.__cuda_array_interface__
    size = int(interface["typestr"][2:])
    strides = interface.get("strides") or (rows.shape[1] * size, size)
    if any(stride % size for stride in strides):
        raise UsageError("the strides of the array are no multiples of its scalars: copy it")
    return _native.CardArray(interface["data"][0], rows.shape[0], strides[0] // size, strides[1] // size, size == 8, _card_of(points))


def empty_like(points: Any) -> Any:
    """An array of the same kind, shape, type and card."""
    package = _package(points)
    if package == "torch":
        return sys.modules["torch"].empty_like(points)
    if package == "cupy":
        return sys.modules["cupy"].empty_like(points)
    if package == "numba":
        return sys.modules["numba"].cuda.device_array_like(points)
    raise DeviceError(f"{type(points).__name__} on a card cannot be made here: give out=, or take a tensor of torch or CuPy, "
                      "torch.from_dlpack(array) for instance")


def concatenate(arrays: Any) -> Any:
    """The rows of all arrays in one, on their card."""
    package = _package(arrays[0])
    if not all(_package(array) == package and is_on_card(array) for array in arrays):
        raise UsageError("clouds must all be of one kind: some lie on a card and some do not")
    if package == "torch":
        return sys.modules["torch"].cat(list(arrays))
    if package == "cupy":
        return sys.modules["cupy"].concatenate(list(arrays))
    raise UsageError(f"a list of {type(arrays[0]).__name__} cannot be put together here: give one array and offsets")


class CardResult:
    """A place for a result; `finish` gives it."""

    def __init__(self, layout: CardLayout, like: Any, out: Any, stream: int) -> None:
        if out is not None:
            layout.check_out(out)
        self.array = empty_like(like) if out is None else out
        if layout.shape[1] == 4 and self.array is not like:
            self.array[:, 3] = like[:, 3]
        self.native, self.stream = card_array(self.array, stream), stream
