# SPDX-License-Identifier: Apache-2.0
"""Many small clouds in one call."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Sequence, TypeVar, overload

import numpy as np

from . import _native
from ._arrays import Layout, Result, as_numpy, check_positions, rows
from ._card import CardLayout, CardResult, card_array, concatenate, current_stream, is_on_card
from ._errors import UsageError
from ._params import Params
from ._progress import Progress, progress_function
from ._report import Report, report_of
from ._runs import borrowed, make_params
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
@overload
def denoise_batch(clouds: Points, params: Params | None = None, *, offsets: Any = None, device: str = "auto",
                  threads: int = 0, progress: Progress = False, return_report: bool,
                  **parameters: Unpack[ParamArguments]) -> Points | tuple[Points, list[Report]]: ...
def denoise_batch(clouds: Any, params: Params | None = None, *, offsets: Any = None, device: str = "auto",
                  threads: int = 0, progress: Progress = False, return_report: bool = False,
                  **parameters: Unpack[ParamArguments]) -> Any:
    """Denoises many small clouds in one call, each by itself: the bits are those of a call for each.

    Args:
        clouds: a list of (N, 3) arrays; or a (B, N, 3) array of clouds of one size; or with `offsets` one (N, 3) array
            in which cloud i has the rows offsets[i] to offsets[i + 1]. All may be in host memory or on a card.
        offsets: whole numbers from 0 to N that do not decrease.
        params: as in denoise.
        device: "auto" is a CUDA card if there is one, else the CPU; or "cpu", "cuda", "cuda:N". A card computes all
            clouds at once with the method bilateral, without the constraint and without reports; with k only if
            normal_sigma, closeness_sigma and similarity_sigma are all given as lengths.
        threads: CPU threads that share the clouds where a card does not compute all at once; 0: all cores.
        progress: as in denoise.
        return_report: whether to return (result, list of reports) instead of the result.
        **parameters: fields of Params that differ from `params`.

    Returns:
        What was given, with moved points; with return_report also a list of reports, without noise, spacing and the marks
        of outliers.

    Raises:
        UsageError: as denoise, with the number of the cloud.
        OutOfMemory: likewise.

    Examples:
        >>> rng = np.random.default_rng(1)
        >>> [len(cloud) for cloud in denoise_batch([rng.random((300, 3)), rng.random((200, 3))], k=12)]
        [300, 200]
    """
    chosen = make_params(params, parameters)
    threads = as_threads(threads)
    on_card = _tensors_of(clouds)
    if on_card is not None:
        device = CardLayout(on_card, "clouds", any_shape=True).check_device(device)
        if return_report:
            raise UsageError("reports of batches take clouds in host memory: leave return_report out")
    with borrowed(device, threads) as pipeline, progress_function(progress) as show:
        batch = _Batch(pipeline, device, chosen, threads, return_report)
        result = batch.run(clouds, offsets, show)
    return (result, batch.reports) if return_report else result


class _Batch:
    """The ways to give many clouds, each as rows and offsets."""

    def __init__(self, pipeline: _native.Pipeline, device: str, params: Params, threads: int, with_reports: bool) -> None:
        self.pipeline, self.device = pipeline, device
        self.params, self.threads, self.with_reports = params, threads, with_reports
        self.reports: list[Report] = []

    def run(self, clouds: Any, offsets: Any, show: Any) -> Any:
        on_card = _tensors_of(clouds)
        if isinstance(clouds, (list, tuple)):
            if offsets is not None:
                raise UsageError("offsets belong to one array of all points, and a list was given: leave them out")
            if on_card is not None:
                return self._list_on_card(clouds, show)
            return self._list(clouds, show)
        if on_card is not None:
            return self._one_on_card(clouds, offsets, show)
        array = as_numpy(clouds, "clouds")
        if offsets is not None:
            check_positions(array, "clouds")
            return self._packed(array, Layout(array, clouds), _as_offsets(offsets), show)
        if array.ndim != 3:
            raise UsageError(f"clouds has the shape {array.shape}: give a list of (N, 3), one (B, N, 3), or offsets too")
        if array.shape[2] not in (3, 4):
            check_positions(array, "clouds")
        size, count = array.shape[1], array.shape[0]
        flat = array.reshape(-1, array.shape[2])
        check_positions(flat, "each cloud")
        ends = np.arange(count + 1, dtype=np.int64) * size
        moved = self._packed(flat, Layout(flat, flat), ends, show).reshape(array.shape)
        wrap = Layout(flat, clouds).wrap
        return moved if wrap is None else wrap(moved)

    def _one_on_card(self, clouds: Any, offsets: Any, show: Any) -> Any:
        if offsets is not None:
            return self._packed_on_card(clouds, _as_offsets(offsets), show)
        shape = tuple(clouds.shape)
        if len(shape) != 3:
            raise UsageError(f"clouds has the shape {shape}: give a list of (N, 3), one (B, N, 3), or offsets too")
        ends = np.arange(shape[0] + 1, dtype=np.int64) * shape[1]
        return self._packed_on_card(clouds.reshape(-1, shape[2]), ends, show).reshape(shape)

    def _list_on_card(self, clouds: Sequence[Any], show: Any) -> list[Any]:
        ends = np.cumsum([0, *(len(cloud) for cloud in clouds)], dtype=np.int64)
        moved = self._packed_on_card(concatenate(clouds), ends, show)
        return [moved[first:last] for first, last in zip(ends[:-1].tolist(), ends[1:].tolist())]

    def _packed_on_card(self, points: Any, offsets: NDArray[np.int64], show: Any) -> Any:
        layout = CardLayout(points, "clouds")
        stream = current_stream(layout)
        result = CardResult(layout, points, None, stream)
        _native.denoise_batch_on_card(self.pipeline, card_array(points, stream), stream, offsets, self.params._native,
                                      result.native, show)
        return result.array

    def _packed(self, array: NDArray[Any], layout: Layout, offsets: NDArray[np.int64], show: Any) -> Any:
        result = Result(layout)
        reports = _native.denoise_batch(self.pipeline, self.device, rows(array), offsets, self.params._native, self.threads,
                                        result.rows, self.with_reports, show)
        self.reports = [report_of(row) for row in reports]
        return result.finish()

    def _list(self, clouds: Sequence[Any], show: Any) -> list[Any]:
        arrays = [as_numpy(cloud, f"clouds[{i}]") for i, cloud in enumerate(clouds)]
        for i, array in enumerate(arrays):
            check_positions(array, f"clouds[{i}]")
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


def _tensors_of(clouds: Any) -> Any:
    """An array on a card if the clouds are one or begin with one, else None."""
    first = clouds[0] if isinstance(clouds, (list, tuple)) and clouds else clouds
    return first if not isinstance(first, (np.ndarray, list, tuple)) and is_on_card(first) else None


def _as_offsets(offsets: Any) -> NDArray[np.int64]:
    try:
        array = np.asarray(offsets)
    except (TypeError, ValueError):
        raise UsageError(f"offsets cannot be {offsets!r}: give whole numbers from 0 to N") from None
    if array.dtype.kind not in "iu" or array.ndim != 1 or len(array) == 0:
        raise UsageError(f"offsets cannot be {array.dtype} of shape {array.shape}: give whole numbers from 0 to N")
    return np.ascontiguousarray(array, np.int64)
