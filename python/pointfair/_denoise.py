# SPDX-License-Identifier: Apache-2.0
"""One call: arrays and clouds in, the same without noise out."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Literal, Sequence, TypeVar, overload

import numpy as np

from . import _native
from ._arrays import Layout, Result, as_box, as_mask, as_numpy, as_strength, check_positions, rows
from ._cloud import Cloud
from ._errors import DeviceError, UsageError
from ._params import Params
from ._pipeline import make_params, native_pipeline
from ._progress import Progress, progress_function
from ._values import as_threads
from ._report import DeviceStatus, Estimates, Report, device_of, report_of

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from ._params import ParamArguments

Points = TypeVar("Points")

# Pipelines of small clouds wait here for the next call, one for each device and number of threads: making one takes
# longer than denoising a few points.
_KEPT_POINTS = 100_000
_idle: dict[tuple[str, int], list[_native.Pipeline]] = {}
os.register_at_fork(after_in_child=_idle.clear)


def _take(device: str, threads: int) -> _native.Pipeline:
    try:
        return _idle[device, threads].pop()
    except (KeyError, IndexError, TypeError):
        return native_pipeline(device, threads)


def _give_back(pipeline: _native.Pipeline, device: str, threads: int) -> None:
    if pipeline.points <= _KEPT_POINTS:
        waiting = _idle.setdefault((device, threads), [])
        if not waiting:
            waiting.append(pipeline)


@overload
def denoise(points: Points, params: Params | None = None, *, mask: Any = None, strength: float = 1.0, box: Any = None,
            normals: bool = False, device: str = "auto", threads: int = 0, out: Any = None, progress: Progress = False,
            return_report: Literal[False] = False, **parameters: Unpack[ParamArguments]) -> Points: ...
@overload
def denoise(points: Points, params: Params | None = None, *, mask: Any = None, strength: float = 1.0, box: Any = None,
            normals: bool = False, device: str = "auto", threads: int = 0, out: Any = None, progress: Progress = False,
            return_report: Literal[True], **parameters: Unpack[ParamArguments]) -> tuple[Points, Report]: ...
def denoise(points: Any, params: Params | None = None, *, mask: Any = None, strength: float = 1.0, box: Any = None,
            normals: bool = False, device: str = "auto", threads: int = 0, out: Any = None, progress: Progress = False,
            return_report: bool = False, **parameters: Unpack[ParamArguments]) -> Any:
    """Removes the noise of a cloud and keeps its shape.

    Args:
        points: positions, (N, 3) float32 or float64: a NumPy array, a CPU tensor of torch, jax or Open3D, or a Cloud.
            Strides, byte order and memory order may be any. Of an (N, 4) array the last column stays as it is.
        params: what to do; by default everything is chosen from the data.
        mask: (N,) booleans, True for each point that may move. The others still count as neighbours.
        strength: blends the result with the input: 0 is the input, 1 the result.
        box: only points inside move: the lower and the upper corner, ((x, y, z), (x, y, z)).
        normals: whether the report has the normals; needs return_report.
        device: "auto" is a CUDA card if there is one, else the CPU; or "cpu", "cuda", "cuda:N".
        threads: CPU threads; 0: all cores.
        out: an array for the result, of the same shape and type; it may be `points` itself.
        progress: True shows tqdm's bar where tqdm is installed; a function is called with the share done and the stage.
        return_report: whether to return (result, Report) instead of the result.
        **parameters: fields of Params, such as k=24, that differ from `params`.

    Returns:
        The moved points, in the type, shape, order and kind of array that came in. A point that did not move keeps its
        bits. NaN rows and other points that cannot be treated keep their place and are counted in the report. The same
        input and parameters give the same bits for any number of threads and on any device.

    Raises:
        UsageError: an argument has a wrong shape, type or value.
        DeviceError: the device cannot be used.
        OutOfMemory: the host or the device has too little memory.
        KeyboardInterrupt: within 200 ms of Ctrl-C.

    Examples:
        >>> rng = np.random.default_rng(1)
        >>> plane = np.c_[rng.random((5000, 2)), rng.normal(0, 0.01, 5000)]
        >>> smooth, report = denoise(plane, return_report=True)
        >>> bool(smooth[:, 2].std() < 0.3 * plane[:, 2].std()), round(report.noise, 2)
        (True, 0.01)
    """
    chosen = make_params(params, parameters)
    if normals and not return_report:
        raise UsageError("normals=True needs return_report=True, since report.normals has them")
    strength, box = as_strength(strength), as_box(box)
    pipeline = _take(device, threads)
    try:
        with progress_function(progress) as show:
            if isinstance(points, Cloud):
                result = _denoise_cloud(pipeline, points, chosen, (strength, box, as_mask(mask, len(points))), out, show)
            else:
                result = _denoise_array(pipeline, points, chosen, strength, box, mask, out, show)
        if not return_report:
            return result
        return result, _full_report(pipeline, normals)
    finally:
        _give_back(pipeline, device, threads)


def _denoise_cloud(pipeline: _native.Pipeline, cloud: Cloud, params: Params,
                   limits: tuple[float, Any, Any], out: Any, show: Any) -> Cloud:
    if out is not None:
        raise UsageError("out= takes arrays, and a Cloud was given: leave it out")
    pipeline.load_cloud(cloud._native)
    return Cloud._of(pipeline.run_cloud(params._native, *limits, show))


def _denoise_array(pipeline: _native.Pipeline, points: Any, params: Params, strength: float, box: Any, mask: Any,
                   out: Any, show: Any) -> Any:
    array = as_numpy(points)
    check_positions(array)
    bytes_ = as_mask(mask, len(array))
    result = Result(Layout(array, points), out)
    pipeline.load(rows(array), strength != 1 or box is not None or bytes_ is not None)
    pipeline.run(params._native, result.rows, strength, box, bytes_, show)
    return result.finish()


def _full_report(pipeline: _native.Pipeline, with_normals: bool) -> Report:
    measured = Estimates(*pipeline.estimates())
    normals = None
    if with_normals:
        normals = np.empty((pipeline.points, 3), np.float32)
        pipeline.normals(normals)
    row = pipeline.report()
    outliers = pipeline.outliers()
    marked = outliers if len(outliers) == row[1] and row[1] > 0 else None
    return report_of(row, noise=measured.noise, spacing=measured.spacing, normals=normals, outliers=marked)


def estimate(points: Any, *, device: str = "auto", threads: int = 0) -> Estimates:
    """Bounds, spacing and noise of an array of positions or a Cloud. Arguments are those of denoise.

    Examples:
        >>> grid = np.stack(np.meshgrid(np.arange(50.0), np.arange(50.0), [0.0]), -1).reshape(-1, 3)
        >>> estimate(grid).points
        2500
    """
    pipeline = _take(device, threads)
    try:
        if isinstance(points, Cloud):
            pipeline.load_cloud(points._native)
        else:
            array = as_numpy(points)
            check_positions(array)
            pipeline.load(rows(array), False)
        return Estimates(*pipeline.estimates())
    finally:
        _give_back(pipeline, device, threads)


def devices() -> list[DeviceStatus]:
    """Every device of this machine that this build knows, the CPU first. A missing driver is no error."""
    return [DeviceStatus(device_of(info), usable, tuple(details)) for info, usable, details in _native.devices()]


@overload
def denoise_batch(clouds: Points, params: Params | None = None, *, offsets: Any = None, device: str = "auto",
                  threads: int = 0, progress: Progress = False, return_report: Literal[False] = False,
                  **parameters: Unpack[ParamArguments]) -> Points: ...
@overload
def denoise_batch(clouds: Points, params: Params | None = None, *, offsets: Any = None, device: str = "auto",
                  threads: int = 0, progress: Progress = False, return_report: Literal[True],
                  **parameters: Unpack[ParamArguments]) -> tuple[Points, list[Report]]: ...
def denoise_batch(clouds: Any, params: Params | None = None, *, offsets: Any = None, device: str = "auto",
                  threads: int = 0, progress: Progress = False, return_report: bool = False,
                  **parameters: Unpack[ParamArguments]) -> Any:
    """Denoises many small clouds in one call, each by itself: the bits are those of a call for each.

    Args:
        clouds: a list of (N, 3) arrays; or a (B, N, 3) array of clouds of one size; or with `offsets` one (N, 3) array in
            which cloud i has the rows offsets[i] to offsets[i + 1].
        offsets: whole numbers from 0 to N that do not decrease.
        params: as that of denoise.
        device: "auto" or "cpu": batches are computed on the CPU.
        threads: the clouds are spread over so many CPU threads; 0: all cores.
        progress: as that of denoise.
        return_report: whether to return (result, list of reports) instead of the result.
        **parameters: fields of Params that differ from `params`.

    Returns:
        What was given, with moved points; with return_report also a list of reports, without noise and spacing.

    Raises:
        UsageError: as denoise, with the number of the cloud.
        OutOfMemory: likewise.

    Examples:
        >>> rng = np.random.default_rng(1)
        >>> [len(cloud) for cloud in denoise_batch([rng.random((300, 3)), rng.random((200, 3))], k=12)]
        [300, 200]
    """
    chosen = make_params(params, parameters)
    if not isinstance(device, str) or device not in ("auto", "cpu"):
        raise DeviceError(f"device cannot be {device!r} here: denoise_batch computes on the CPU, 'auto' or 'cpu'")
    batch = _Batch(chosen, as_threads(threads), return_report)
    with progress_function(progress) as show:
        result = batch.run(clouds, offsets, show)
    return (result, batch.reports) if return_report else result


class _Batch:
    """The ways to give many clouds, each as rows and offsets."""

    def __init__(self, params: Params, threads: int, with_reports: bool) -> None:
        self.params, self.threads, self.with_reports = params, threads, with_reports
        self.reports: list[Report] = []

    def run(self, clouds: Any, offsets: Any, show: Any) -> Any:
        if isinstance(clouds, (list, tuple)):
            if offsets is not None:
                raise UsageError("offsets belong to one array of all points, and a list was given: leave them out")
            return self._list(clouds, show)
        array = as_numpy(clouds, "clouds")
        if offsets is not None:
            check_positions(array, "clouds")
            return self._packed(array, Layout(array, clouds), _as_offsets(offsets), show)
        if array.ndim != 3:
            raise UsageError(f"clouds has the shape {array.shape}: give a list of (N, 3), one (B, N, 3), or offsets too")
        size, count = array.shape[1], array.shape[0]
        flat = array.reshape(-1, array.shape[2])
        check_positions(flat, "each cloud")
        ends = np.arange(count + 1, dtype=np.int64) * size
        moved = self._packed(flat, Layout(flat, flat), ends, show).reshape(array.shape)
        wrap = Layout(flat, clouds).wrap
        return moved if wrap is None else wrap(moved)

    def _packed(self, array: NDArray[Any], layout: Layout, offsets: NDArray[np.int64], show: Any) -> Any:
        result = Result(layout)
        reports = _native.denoise_batch(rows(array), offsets, self.params._native, self.threads, result.rows,
                                        self.with_reports, show)
        self.reports = [report_of(row) for row in reports]
        return result.finish()

    def _list(self, clouds: Sequence[Any], show: Any) -> list[Any]:
        arrays = [as_numpy(cloud, f"cloud {i}") for i, cloud in enumerate(clouds)]
        for i, array in enumerate(arrays):
            check_positions(array, f"cloud {i}")
        results: list[Any] = [None] * len(arrays)
        reports: list[Any] = [None] * len(arrays)
        for kind in sorted({array.dtype.itemsize for array in arrays}):
            chosen = [i for i, array in enumerate(arrays) if array.dtype.itemsize == kind]
            self._same_type(chosen, arrays, clouds, results, show)
            for i, report in zip(chosen, self.reports):
                reports[i] = report
        self.reports = reports
        return results

    def _same_type(self, chosen: list[int], arrays: list[NDArray[Any]], clouds: Sequence[Any], results: list[Any],
                   show: Any) -> None:
        packed = np.concatenate([rows(arrays[i]) for i in chosen])
        offsets = np.zeros(len(chosen) + 1, np.int64)
        np.cumsum([len(arrays[i]) for i in chosen], out=offsets[1:])
        moved = self._packed(packed, Layout(packed, packed), offsets, show)
        for i, first, last in zip(chosen, offsets[:-1], offsets[1:]):
            result = Result(Layout(arrays[i], clouds[i]))
            result.rows[...] = moved[first:last]
            results[i] = result.finish()


def _as_offsets(offsets: Any) -> NDArray[np.int64]:
    array = np.asarray(offsets)
    if array.dtype.kind not in "iu" or array.ndim != 1 or len(array) == 0:
        raise UsageError(f"offsets cannot be {array.dtype} of shape {array.shape}: give whole numbers from 0 to N")
    return np.ascontiguousarray(array, np.int64)
