# SPDX-License-Identifier: Apache-2.0
"""One call: arrays and clouds in, the same without noise out."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeVar, overload

import numpy as np

from . import _card, _native
from ._arrays import Layout, Result, as_box, as_faces, as_mask, as_numpy, as_strength, check_positions, grid_of, rows
from ._cloud import Cloud
from ._errors import UsageError
from ._params import Params
from ._progress import Progress, progress_function
from ._report import DeviceStatus, Estimates, Report, device_of, report_of
from ._runs import borrowed, make_params, run_cloud, set_viewpoint
from ._step import denoise_by_step, refuse_with_step

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._params import ParamArguments
    from ._step import Step

Points = TypeVar("Points")


@overload
def denoise(points: Points, params: Params | None = None, *, mask: Any = None, where: str | None = None,
            ignore: str | None = None, strength: float = 1.0, box: Any = None, viewpoint: Any = None,
            faces: Any = None, weights: Any = None, step: Step | None = None, normals: bool = False,
            device: str = "auto", threads: int = 0, out: Any = None, progress: Progress = False, return_report: Literal[False] = False,
            **parameters: Unpack[ParamArguments]) -> Points: ...
@overload
def denoise(points: Points, params: Params | None = None, *, mask: Any = None, where: str | None = None,
            ignore: str | None = None, strength: float = 1.0, box: Any = None, viewpoint: Any = None,
            faces: Any = None, weights: Any = None, step: Step | None = None, normals: bool = False,
            device: str = "auto", threads: int = 0, out: Any = None, progress: Progress = False, return_report: Literal[True],
            **parameters: Unpack[ParamArguments]) -> tuple[Points, Report]: ...
@overload
def denoise(points: Points, params: Params | None = None, *, mask: Any = None, where: str | None = None,
            ignore: str | None = None, strength: float = 1.0, box: Any = None, viewpoint: Any = None,
            faces: Any = None, weights: Any = None, step: Step | None = None, normals: bool = False,
            device: str = "auto", threads: int = 0, out: Any = None, progress: Progress = False, return_report: bool,
            **parameters: Unpack[ParamArguments]) -> Points | tuple[Points, Report]: ...
def denoise(points: Any, params: Params | None = None, *, mask: Any = None, where: str | None = None,
            ignore: str | None = None, strength: float = 1.0, box: Any = None, viewpoint: Any = None,
            faces: Any = None, weights: Any = None, step: Step | None = None, normals: bool = False,
            device: str = "auto", threads: int = 0, out: Any = None, progress: Progress = False, return_report: bool = False, **parameters: Unpack[ParamArguments]) -> Any:
    """Removes the noise of a cloud and keeps its shape. No point is added or removed.

    Args:
        points: positions, (N, 3) float32 or float64: a NumPy array, a tensor of torch, jax or Open3D, or a Cloud.
            Any strides, byte order and memory order work. Of an (N, 4) array the last column stays as it is. A tensor
            of torch or CuPy on a CUDA card is computed there, after the work of the current stream, without a copy
            through the host. An image of points in host memory, (H, W, 3) or (H, W, 4), is one cloud: `mask` may be
            (H, W), the report's arrays are. Its pixels that are NaN or (0, 0, 0), where the camera measured nothing, keep
            their place, and report.unmoved.non_finite counts them.
        params: the parameters; by default all are chosen from the data. Lengths are in the unit of the points.
        mask: (N,) booleans, True for each point that may move. The others still count as neighbours.
        where: only points of a Cloud whose attribute has one of these integers move, as in "classification=2,6-9".
        ignore: points of a Cloud with such an attribute do not move, and are nobody's neighbours.
        strength: blends the result with the input: 0 is the input, 1 the result.
        box: only points inside move: the lower and the upper corner, ((x, y, z), (x, y, z)).
        viewpoint: where the sensor stood, in the coordinates of the points: (3,), or (N, 3) with a position for each
            point; (0, 0, 0) in a camera's own coordinates. Points between two surfaces along the ray are then outliers,
            normals look to the sensor, and along="ray" is possible. With a Cloud also the names of three attributes,
            "vx,vy,vz", or "none"; by default what its file says. Without it, a run that measures the noise looks for the
            place in the grid of an image of points, where the rays of a camera meet, and else in the distances between points,
            there for mixed pixels alone; (nan, nan, nan): none is looked for.
        faces: for connectivity="mesh", the numbers of the points of each face, (F, 3) for triangles, (F, 4) for quads; a
            Cloud has those of its file.
        weights: for method="learned", a file of weights in place of the program's own: its path, or its bytes.
        step: a function of one's own that moves the points in place of the library's step, for research: step(points,
            neighbors, normals, noise) returns the new points. It gets the finite points, (M, 3) float64; the rows of
            the k nearest other points of each, (M, k), nearest first, k = 24 where it is "auto"; their normals, (M, 3),
            zero where there is none; and the standard deviation of their noise, (M,). It is called once an iteration,
            once where that is "auto", each time with what is measured on the moved points. A row that is not finite
            leaves its point where it is. Of the parameters, k, iterations and those of noise and normals count; mask,
            box and strength act on the result.
        normals: whether the report has the normals; needs return_report.
        device: "auto" is where a tensor lies, else a CUDA card if there is one, else the CPU; or "cpu", "cuda",
            "cuda:N"; or several cards, "cuda:0,2" or "cuda:all", which share clouds of 4 million points and more.
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
        FileError: the file of weights cannot be read, is cut, damaged, foreign, or of another version.
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
    if faces is not None and (isinstance(points, Cloud) or _card.layout_of(points) is not None):
        raise UsageError("faces go with arrays in host memory; a Cloud has those of its file: leave faces out")
    strength, box = as_strength(strength), as_box(box)
    if step is not None:
        refuse_with_step(where=where, ignore=ignore, viewpoint=viewpoint, faces=faces, weights=weights, out=out,
                         progress=progress or None, return_report=return_report or None)
        return denoise_by_step(points, step, chosen, mask=mask, box=box, strength=strength, device=device, threads=threads)
    layout = _card.layout_of(points)
    _check_kind(points, layout, by_attribute=where is not None or ignore is not None,
                in_part=mask is not None or box is not None or strength != 1, out=out)
    if layout is not None:
        device = layout.check_device(device)
    with borrowed(device, threads, weights) as pipeline, progress_function(progress) as show:
        if layout is not None:
            result: Any = _denoise_on_card(pipeline, points, layout, chosen, viewpoint, out, show)
        elif isinstance(points, Cloud):
            result = Cloud._of(run_cloud(pipeline, points._native, chosen, mask=mask, where=where, ignore=ignore,
                                         strength=strength, box=box, viewpoint=viewpoint, show=show, normals=normals))
        else:
            result = _denoise_array(pipeline, points, chosen, strength, box, mask, viewpoint, faces, out, show, normals)
        return (result, _full_report(pipeline, normals, grid_of(result))) if return_report else result


def _check_kind(points: Any, layout: _card.CardLayout | None, *, by_attribute: bool, in_part: bool, out: Any) -> None:
    """Refuses what this kind of points cannot be asked."""
    if layout is not None:
        if by_attribute:
            raise UsageError("where and ignore need a Cloud, whose attributes they name")
        if in_part:
            raise UsageError("mask, box and strength take arrays in host memory: blend the tensors instead, "
                             "torch.where(mask[:, None], result, points) for instance")
    elif isinstance(points, Cloud):
        if out is not None:
            raise UsageError("out= takes arrays, and a Cloud was given: leave it out")
    elif by_attribute:
        raise UsageError("where and ignore need a Cloud, whose attributes they name; mask takes booleans")


def _denoise_on_card(pipeline: _native.Pipeline, points: Any, layout: _card.CardLayout, params: Params, viewpoint: Any,
                     out: Any, show: Any) -> Any:
    stream = _card.current_stream(layout)
    result = _card.CardResult(layout, points, out, stream)
    array = _card.card_array(points, stream)
    if viewpoint is None:
        pipeline.denoise_on_card(array, stream, params._native, result.native, show)
    else:
        pipeline.load_on_card(array, stream)
        set_viewpoint(pipeline, viewpoint)
        pipeline.run_on_card(params._native, result.native, stream, show)
    return result.array


def _denoise_array(pipeline: _native.Pipeline, points: Any, params: Params, strength: float, box: Any, mask: Any,
                   viewpoint: Any, faces: Any, out: Any, show: Any, normals: bool) -> Any:
    array = as_numpy(points)
    check_positions(array, images=True)
    layout = Layout(array, points)
    positions = layout.without_empty_pixels(rows(array))
    bytes_ = as_mask(mask, len(positions), layout.grid)
    result = Result(layout, out)
    pipeline.load(positions, strength != 1 or box is not None or bytes_ is not None, layout.width if viewpoint is None else 0)
    if viewpoint is not None:
        set_viewpoint(pipeline, viewpoint, layout.grid)
    if faces is not None:
        pipeline.set_faces(as_faces(faces))
    if normals:
        pipeline.check_normals(params._native)
    pipeline.run(params._native, result.rows, strength, box, bytes_, "", show)
    return result.finish()


def _full_report(pipeline: _native.Pipeline, with_normals: bool, grid: tuple[int, ...]) -> Report:
    """`grid` is the shape of an image of points, which the arrays of the report get."""
    measured = Estimates(*pipeline.estimates())
    normals = None
    if with_normals:
        normals = np.empty((pipeline.points, 3), np.float32)
        pipeline.normals(normals)
        normals = normals.reshape(*grid, 3) if grid else normals
    row = pipeline.report()
    outliers = pipeline.outliers()
    marked = outliers if len(outliers) == row[1] and row[1] > 0 else None
    if marked is not None and grid:
        marked = marked.reshape(grid)
    return report_of(row, noise=measured.noise, spacing=measured.spacing, normals=normals, outliers=marked)


def estimate(points: Any, *, device: str = "auto", threads: int = 0) -> Estimates:
    """Measures bounds, spacing and noise of an array of positions or a Cloud. Arguments are those of denoise.

    Examples:
        >>> grid = np.stack(np.meshgrid(np.arange(50.0), np.arange(50.0), [0.0]), -1).reshape(-1, 3)
        >>> estimate(grid).points
        2500
    """
    layout = _card.layout_of(points)
    if layout is not None:
        device = layout.check_device(device)
    with borrowed(device, threads) as pipeline:
        if isinstance(points, Cloud):
            pipeline.load_cloud(points._native, "")
        elif layout is not None:
            stream = _card.current_stream(layout)
            pipeline.load_on_card(_card.card_array(points, stream), stream)
        else:
            array = as_numpy(points)
            check_positions(array, images=True)
            pipeline.load(Layout(array, points).without_empty_pixels(rows(array)), False)
        return Estimates(*pipeline.estimates())


def devices() -> list[DeviceStatus]:
    """Every device of this machine that this build knows, the CPU first. A missing driver is no error."""
    return [DeviceStatus(device_of(info), usable, tuple(details)) for info, usable, details in _native.devices()]
