# SPDX-License-Identifier: Apache-2.0
"""What every way to denoise begins with: parameters, a pipeline of the library, the run of a cloud with attributes."""
from __future__ import annotations

import contextlib
import difflib
import functools
import os
from typing import Any, Iterator

from . import _native
from ._arrays import as_box, as_mask, as_selections, as_strength, as_viewpoint
from ._errors import FileError, UsageError
from ._params import Params
from ._values import as_text, as_threads, kind_of

_DEFAULT = Params()


# What calls take beside parameters, to be guessed where a name is mistyped, and where a pipeline has it.
_OF_CALLS = {"box": "Pipeline.run", "device": "Pipeline", "faces": "Pipeline.set_faces", "ignore": "Pipeline.load",
             "mask": "Pipeline.run", "normals": "Pipeline.normals", "out": "Pipeline.run", "progress": "Pipeline.run",
             "return_report": "Pipeline.report", "step": "Pipeline.run", "strength": "Pipeline.run", "threads": "Pipeline",
             "viewpoint": "Pipeline.set_viewpoint", "weights": "Pipeline", "where": "Pipeline.run"}


def make_params(params: Params | None, changes: Any) -> Params:
    """`params`, or the defaults, with the changes."""
    if params is not None and not isinstance(params, Params):
        raise UsageError(f"params is {kind_of(params)}: give a pointfair.Params, or parameters by their names, as k=24")
    if not changes:
        return _DEFAULT if params is None else params
    if params is not None:
        return params.replace(**_known(changes))
    try:
        return _params_of(tuple((name, type(value), value) for name, value in changes.items()))
    except TypeError:  # a value that cannot be a key
        return Params(**_known(changes))


@functools.lru_cache(maxsize=64)
def _params_of(changes: tuple[tuple[str, type, Any], ...]) -> Params:
    """Calls mostly repeat their arguments, and to check them takes longer than to denoise a few points."""
    return Params(**_known({name: value for name, _, value in changes}))


def _known(changes: dict[str, Any]) -> dict[str, Any]:
    for name in changes:
        if name not in Params.__dataclass_fields__:
            if name in _OF_CALLS:
                raise UsageError(f"there is no parameter '{name}', and this call takes no such argument: pointfair.denoise does, "
                                 f"and for pipelines see pointfair.{_OF_CALLS[name]}")
            if name == "preset":
                raise UsageError("there is no parameter 'preset': pointfair.Params.paper() has that of the paper")
            near = difflib.get_close_matches(name, [*Params.__dataclass_fields__, *_OF_CALLS], 1)
            guess = f"did you mean {near[0]}? " if near else ""
            raise UsageError(f"there is no parameter '{name}': {guess}help(pointfair.Params) lists them")
    return changes


def native_pipeline(device: str, threads: int) -> _native.Pipeline:
    """Raises UsageError for a device or a number of threads that cannot be."""
    return _native.Pipeline(as_text(device, "device"), as_threads(threads))


# Pipelines of small clouds wait here for the next call, one for each device and number of threads: making one takes
# longer than denoising a few points, on a card a million.
_KEPT_POINTS, _KEPT_ON_CARD = 100_000, 2_000_000
_idle: dict[tuple[str, int], list[_native.Pipeline]] = {}
if hasattr(os, "register_at_fork"):  # Windows has no fork
    os.register_at_fork(after_in_child=_idle.clear)


def _take(device: str, threads: int) -> _native.Pipeline:
    try:
        return _idle[device, threads].pop()
    except (KeyError, IndexError, TypeError):
        return native_pipeline(device, threads)


@contextlib.contextmanager
def borrowed(device: str, threads: int, weights: Any = None) -> Iterator[_native.Pipeline]:
    """A pipeline for one call."""
    threads = as_threads(threads)  # 1.0 and True are the same keys as 1
    pipeline = _take(device, threads)
    try:
        if weights is not None:
            set_weights(pipeline, weights)
        yield pipeline
    finally:
        if weights is not None:
            pipeline.set_weights(b"", "")
        _give_back(pipeline, device, threads)


def _give_back(pipeline: _native.Pipeline, device: str, threads: int) -> None:
    if pipeline.points <= (_KEPT_ON_CARD if device.startswith("cuda") else _KEPT_POINTS):
        waiting = _idle.setdefault((device, threads), [])
        if not waiting:
            waiting.append(pipeline)


def set_viewpoint(pipeline: _native.Pipeline, viewpoint: Any, grid: tuple[int, ...] = ()) -> None:
    """Where the sensor stood: an array, or a text where a cloud was loaded."""
    if isinstance(viewpoint, str):
        pipeline.set_viewpoint_text(viewpoint)
    else:
        pipeline.set_viewpoint(as_viewpoint(viewpoint, pipeline.points, grid))


def set_weights(pipeline: _native.Pipeline, weights: Any) -> None:
    """Those of the method learned: a file, or what one holds; None: the program's own."""
    if weights is None:
        pipeline.set_weights(b"", "")
    elif isinstance(weights, bytes):
        pipeline.set_weights(weights or b"-", "weights")  # nothing at all is no file of weights either
    else:
        try:
            path = os.fspath(weights)
        except TypeError:
            raise UsageError(f"weights is {kind_of(weights)}: give a file's path, or its bytes") from None
        try:
            with open(path, "rb") as file:
                content = file.read()
        except (OSError, ValueError) as error:  # ValueError: a zero in the name
            raise FileError(f"{os.fsdecode(path)}: cannot be read: {getattr(error, 'strerror', error)}") from None
        pipeline.set_weights(content or b"-", os.fsdecode(path))


def run_cloud(pipeline: _native.Pipeline, cloud: _native.Cloud, params: Params, *, mask: Any, where: str | None,
              ignore: str | None, strength: float, box: Any, viewpoint: Any, show: Any, normals: bool = False) -> _native.Cloud:
    """Loads and denoises a cloud; returns a copy with moved points. `show` is as progress_function gives it. `normals`:
    they will be asked for."""
    limits = (as_strength(strength), as_box(box), as_mask(mask, len(cloud)), as_selections(where, "where"))
    pipeline.load_cloud(cloud, as_selections(ignore, "ignore"))
    if viewpoint is not None:
        set_viewpoint(pipeline, viewpoint)
    if normals:
        pipeline.check_normals(params._native)
    return pipeline.run_cloud(params._native, *limits, show)
