# SPDX-License-Identifier: Apache-2.0
"""A cloud on a device, with the results of all stages."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np

from . import _card
from ._arrays import Layout, Result, as_box, as_faces, as_mask, as_numpy, as_selections, as_sigmas, as_strength, check_positions, rows
from ._cloud import Cloud
from ._errors import UsageError
from ._params import Params
from ._progress import Progress, progress_function
from ._report import DeviceInfo, Estimates, Report, device_of, report_of
from ._runs import make_params, native_pipeline, set_viewpoint, set_weights
from ._step import denoise_by_step, refuse_with_step
from ._values import kind_of

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import TypeVar as TypeVarWithDefault
    from typing_extensions import Unpack

    from ._params import ParamArguments
    from ._step import Step

    Points = TypeVarWithDefault("Points", default=NDArray[Any])
else:
    Points = TypeVar("Points")
T = TypeVar("T")


class Pipeline(Generic[Points]):
    """Holds one cloud on one device, together with the results of all stages: a run repeats only the stages whose
    parameters changed. One thread at a time may use it; runs of different pipelines go on side by side.

    Args:
        device: "auto" is a CUDA card if there is one, else the CPU; or "cpu", "cuda", "cuda:N"; or several
            cards, "cuda:0,2" or "cuda:all", which share clouds of 4 million points and more.
        threads: CPU threads; 0: all cores.
        weights: for method="learned", as in pointfair.denoise; of all clouds.

    For type checkers a pipeline is of the kind of its points, which `load` takes and `run` returns: NumPy arrays unless
    it says otherwise, as in Pipeline[pointfair.Cloud]("cpu") or Pipeline[torch.Tensor]().

    Raises:
        DeviceError: the device cannot be used.
        FileError: the file of weights cannot be used.

    Examples:
        >>> pipeline = Pipeline("cpu")
        >>> pipeline.load(np.random.default_rng(1).random((1000, 3), np.float32))
        >>> pipeline.run(k=12).shape
        (1000, 3)
    """

    def __init__(self, device: str = "auto", *, threads: int = 0, weights: Any = None) -> None:
        self._native = native_pipeline(device, threads)
        self._where = device, threads
        if weights is not None:
            set_weights(self._native, weights)
        self._layout: Layout | None = None
        self._on_card: Any = None  # the array that lies on the card
        self._given: set[str] = set()  # beside the points, since the last load
        self._asked = Params()  # of the last run

    def load(self, points: Points, *, ignore: str | None = None) -> None:
        """Copies an array of positions, (N, 3) or (N, 4), an image of them, (H, W, 3) or (H, W, 4), or a Cloud to the device. The next run starts with the first
        stage. O(N). A tensor on a card must be on the pipeline's card, and is copied there. `ignore` chooses points of a
        Cloud that are nobody's neighbours, as in pointfair.denoise. A load that is refused leaves everything as it was;
        one that fails on the way, for lack of memory for instance, leaves a pipeline that holds no cloud."""
        if isinstance(points, Cloud):
            self._native.load_cloud(points._native, as_selections(ignore, "ignore"))
            self._layout, self._on_card, self._given = None, None, set() if ignore is None else {"ignore"}
            return
        if ignore is not None:
            raise UsageError("ignore needs a Cloud, whose attributes it names")
        if type(points) is not np.ndarray and _card.is_on_card(points):
            card_layout = _card.CardLayout(points)
            stream = _card.current_stream(card_layout)
            self._native.load_on_card(_card.card_array(points, stream), stream)
            self._layout, self._on_card, self._given = None, points, set()
            return
        array = as_numpy(points)
        check_positions(array, images=True)
        layout = Layout(array, points).keep()
        self._native.load(layout.without_empty_pixels(rows(array)), True, layout.width)
        self._layout, self._on_card, self._given = layout, None, set()

    def run(
        self,
        params: Params | None = None,
        *,
        mask: Any = None,
        where: str | None = None,
        strength: float = 1.0,
        box: Any = None,
        out: Any = None,
        step: Step | None = None,
        progress: Progress = False,
        **parameters: Unpack[ParamArguments],
    ) -> Points:
        """Denoises the loaded cloud. Arguments are those of pointfair.denoise. Returns what was loaded, an array of the
        same type, shape and order or a Cloud, with the moved positions. After a run with `step`, `report`, `normals` and
        `outliers` are those of one iteration of the library on the loaded cloud."""
        chosen = make_params(params, parameters)
        holds = self._native.holds  # after a load that failed, nothing, whatever the fields say
        if holds == "nothing":
            raise UsageError("the pipeline holds no cloud: call load first")
        if step is not None:
            refuse_with_step(where=where, out=out, progress=progress or None, **dict.fromkeys(self._given, True))
            return self._run_step(step, chosen, as_strength(strength), as_box(box), mask)
        limits = (as_strength(strength), as_box(box), as_mask(mask, len(self), self._grid), as_selections(where, "where"))
        with progress_function(progress) as show:
            if holds == "cloud":
                if out is not None:
                    raise UsageError("out= takes arrays, and a Cloud was loaded: leave it out")
                moved: Any = Cloud._of(self._native.run_cloud(chosen._native, *limits, show))
                self._asked = chosen
                return moved  # type: ignore[no-any-return]
            if holds == "array on card":
                if limits != (1.0, None, None, ""):
                    raise UsageError("mask, where, box and strength take arrays in host memory: blend the tensors instead")
                return self._run_on_card(chosen, out, show)  # type: ignore[no-any-return]
            assert self._layout is not None
            result = Result(self._layout, out)
            self._native.run(chosen._native, result.rows, *limits, show)
            self._asked = chosen
            return result.finish()  # type: ignore[no-any-return]

    def _run_step(self, step: Step, params: Params, strength: float, box: list[float] | None, mask: Any) -> Points:
        if self._on_card is not None:
            raise UsageError("step takes arrays in host memory: load a copy that lies there")
        held: Any = self.run(params.replace(iterations=1), strength=0.0)  # the points as they were loaded
        device, threads = self._where
        moved = denoise_by_step(held, step, params, mask=mask, box=box, strength=strength, device=device, threads=threads)
        return moved  # type: ignore[no-any-return]

    def _run_on_card(self, params: Params, out: Any, show: Any) -> Any:
        layout = _card.CardLayout(self._on_card)
        stream = _card.current_stream(layout)
        result = _card.CardResult(layout, self._on_card, out, stream)
        self._native.run_on_card(params._native, result.native, stream, show)
        self._asked = params
        return result.array

    def resolve(self, params: Params | None = None, **parameters: Unpack[ParamArguments]) -> Params:
        """The parameters with every "auto" replaced by the value that a run would use in a typical place, and lengths in
        the unit of the points. A run with "auto" follows the noise from place to place; a run with these values does
        not. Raises UsageError if there is nothing to measure in the cloud, as where no point is finite, all lie at one
        place, or too few show a surface: such values would leave later frames as they are."""
        return Params._of(self._native.resolve(make_params(params, parameters)._native))

    def estimates(self) -> Estimates:
        """Bounds, spacing and noise of the loaded cloud. Measured once after each load."""
        return Estimates(*self._native.estimates())

    def notes(self, moved: Any = 0.0) -> list[str]:
        """Why the result of the last run may not be what it seems, in sentences, as the program prints them: floats
        that are coarse so far from 0, points too sparse for their noise, noise or moves that are large against the
        cloud, noise that neighbours share, rows too far apart, points that show no surface, where the grid of an image shows
        its camera. `moved` are the lengths that
        points moved, an array; without it neither large moves nor such rows are told. Empty where there is nothing to
        say. Measures what estimates() does; O(N) for `moved`.

        Examples:
            >>> rng = np.random.default_rng(1)
            >>> sparse = np.c_[1000 * rng.random((3000, 2)), rng.normal(0, 0.02, 3000)]
            >>> pipeline = Pipeline("cpu")
            >>> pipeline.load(sparse)
            >>> result = pipeline.run()
            >>> notes = pipeline.notes(np.linalg.norm(result - sparse, axis=1))
            >>> any("so far apart, noise and shape look the same" in note for note in notes)
            True
        """
        try:
            lengths = np.asarray(moved, np.float64).ravel()
        except (TypeError, ValueError):
            raise UsageError(f"moved is {kind_of(moved)}: give how far points moved, an array of lengths") from None
        lengths = lengths[np.isfinite(lengths)] if np.isfinite(lengths).any() else np.zeros(1)
        rms = np.sqrt(np.mean(lengths**2)) if np.ndim(moved) else np.inf  # not known
        moves = (lengths.mean(), rms, np.quantile(lengths, 0.95), lengths.max())
        return self._native.notes(self._asked._native, [float(value) for value in moves])

    @overload
    def normals(self) -> NDArray[np.float32]: ...
    @overload
    def normals(self, out: T) -> T: ...
    def normals(self, out: Any = None) -> Any:
        """The unit normals of the last run's last iteration, (N, 3), zero where there is none. They look towards the
        sensor where its place is known, and have arbitrary signs elsewhere and on a card. `out`, an array on the
        pipeline's card, takes them without a copy through the host. Raises UsageError if the last run failed or if a
        cloud was loaded since. Of a cloud that is too wide for floats around one origin, which runs in zones, they are
        coarse, or refused where they would mean nothing."""
        if out is not None:
            if type(out) is np.ndarray or not _card.is_on_card(out):
                raise UsageError("out takes an array on the pipeline's card: leave it out for one in host memory")
            stream = _card.current_stream(_card.CardLayout(out, "out"))
            self._native.normals_on_card(_card.card_array(out, stream), stream)
            return out
        out = np.empty((len(self), 3), np.float32)
        self._native.normals(out)
        return out.reshape(*self._grid, 3) if self._grid else out

    def noise(self, params: Params | None = None, **parameters: Unpack[ParamArguments]) -> NDArray[np.float32]:
        """The standard deviation of the noise at each point of the loaded cloud, (N,), in its unit; NaN for an invalid
        point. Of the parameters only `noise` is read: where it is given, it is the noise of a typical place. O(N)."""
        out = np.empty(len(self), np.float32)
        self._native.noise(out, make_params(params, parameters)._native)
        return out.reshape(self._grid) if self._grid else out

    def set_noise(self, sigmas: Any) -> None:
        """Gives the standard deviation of the noise at each point of the loaded cloud, (N,), in its unit, in place of
        the estimate; None brings the estimate back. Holds until the next load. The median is the noise of a typical
        place. The values are smoothed onto a grid of 32 nodes along each axis, and kept within an eighth of the median
        and 8 times the median. A value that is not positive and finite is ignored, and its place takes the noise around
        it.

        Examples:
            >>> rng = np.random.default_rng(1)
            >>> plane = np.c_[rng.random((5000, 2)), rng.normal(0, 0.01, 5000)]
            >>> pipeline = Pipeline("cpu")
            >>> pipeline.load(plane)
            >>> pipeline.set_noise(0.008 + 0.004 * plane[:, 0])
            >>> round(pipeline.estimates().noise, 3)
            0.01
        """
        if self._native.holds == "nothing":
            raise UsageError("the pipeline holds no cloud: call load first")
        self._native.set_noise(as_sigmas(sigmas, len(self), self._grid))
        self._note("noise of each point", sigmas)

    def set_viewpoint(self, viewpoint: Any) -> None:
        """Gives the place where the sensor stood, in the coordinates of the loaded points: (3,), or (N, 3) with a
        position for each point; None: none, and none is looked for. With a Cloud also the names of three attributes,
        "vx,vy,vz", or "none". Holds until the next load; a load of a Cloud takes what its file says. A position that is
        not finite is unknown. Without this call, the place is where the rays of an image of points meet, and else a run that
        measures the noise looks for it in the distances between points (Report.found_sensor), for mixed pixels alone.

        Examples:
            >>> rng = np.random.default_rng(1)
            >>> plane = np.c_[rng.random((5000, 2)), rng.normal(0, 0.01, 5000)]
            >>> pipeline = Pipeline("cpu")
            >>> pipeline.load(plane)
            >>> pipeline.set_viewpoint((0.5, 0.5, 3))
            >>> moved = pipeline.run(along="ray") - plane
            >>> rays = plane - (0.5, 0.5, 3)
            >>> bool(np.abs(np.cross(moved, rays)).max() < 1e-6)
            True
        """
        set_viewpoint(self._native, viewpoint, self._grid)
        self._note("viewpoint", viewpoint)

    def set_faces(self, faces: Any) -> None:
        """Gives the faces of the loaded points for connectivity="mesh": the numbers of their points, (F, 3) for
        triangles, (F, 4) for quads. Holds until the next load; a load of a Cloud takes those of its file.

        Examples:
            >>> x, y = np.meshgrid(np.arange(30.0), np.arange(30.0), indexing="ij")
            >>> points = np.c_[x.ravel(), y.ravel(), np.random.default_rng(1).normal(0, 0.2, 900)]
            >>> corner = (np.arange(29)[:, None] * 30 + np.arange(29)).ravel()[:, None]
            >>> pipeline = Pipeline("cpu")
            >>> pipeline.load(points)
            >>> pipeline.set_faces(corner + [0, 30, 31, 1])
            >>> smooth = pipeline.run(connectivity="mesh")
            >>> bool(smooth[:, 2].std() < 0.7 * points[:, 2].std()), pipeline.report.mesh.boundary_edges
            (True, 116)
        """
        self._native.set_faces(as_faces(faces))
        self._note("faces", faces)

    def _note(self, name: str, value: Any) -> None:
        """What a run with a step of one's own would leave unread."""
        if value is None:
            self._given.discard(name)
        else:
            self._given.add(name)

    def outliers(self) -> NDArray[np.bool_] | None:
        """True for each outlier of the last run; None unless it had outliers="mark"."""
        found: NDArray[np.bool_] = self._native.outliers()
        if len(found) != len(self) or len(self) == 0:
            return None
        return found.reshape(self._grid) if self._grid else found

    @property
    def _grid(self) -> tuple[int, ...]:
        """(H, W) of an image of points, () of all else."""
        return self._layout.grid if self._layout is not None and len(self._layout.grid) == 2 else ()

    @property
    def report(self) -> Report:
        """What the last successful run did."""
        return report_of(self._native.report(), outliers=self.outliers())

    @property
    def device(self) -> DeviceInfo:
        """The device that this pipeline runs on."""
        return device_of(self._native.device())

    def __len__(self) -> int:
        """Number of points of the loaded cloud; 0 where none is loaded."""
        return int(self._native.points)

    def __reduce__(self) -> Any:
        raise TypeError("a Pipeline holds memory of this process and can be neither copied nor pickled: make one in each process")

    def __repr__(self) -> str:
        held = "no cloud" if self._native.holds == "nothing" else f"{len(self)} points"
        return f"<pointfair.Pipeline on {self.device.kind}, {held}>"
