# SPDX-License-Identifier: Apache-2.0
"""Many small clouds in one call."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Sequence, TypeVar, overload

import numpy as np

from . import _native
from ._arrays import Layout, Result, as_numpy, check_positions, rows
from ._errors import DeviceError, UsageError
from ._params import Params
from ._progress import Progress, progress_function
from ._report import Report, report_of
from ._runs import make_params
from ._values import as_threads

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from ._params import ParamArguments

Points = TypeVar("Points")


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
