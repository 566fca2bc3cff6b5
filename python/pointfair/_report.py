# SPDX-License-Identifier: Apache-2.0
"""What a run did, what a cloud is like, and which devices there are."""
from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from ._params import Params

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclasses.dataclass(frozen=True)
class DeviceInfo:
    """The device of a run."""

    kind: str
    """Either "cpu" or "cuda"."""
    name: str
    """Such as "AMD EPYC, 2 threads, AVX-512" or "NVIDIA H200"."""
    reason: str
    """Why it is this one."""


@dataclasses.dataclass(frozen=True)
class DeviceStatus:
    """A device of this machine."""

    info: DeviceInfo
    """Which it is."""
    usable: bool
    """Whether a run can use it."""
    details: tuple[str, ...]
    """Driver, runtime, memory, and why it cannot be used."""


@dataclasses.dataclass(frozen=True)
class Estimates:
    """Measured on a cloud. Lengths are in the unit of the coordinates."""

    min: tuple[float, float, float]
    """Lower corner of the bounds of the finite points."""
    max: tuple[float, float, float]
    """Upper corner."""
    diagonal: float
    """Of the bounds."""
    spacing: float
    """Mean distance to the 6 nearest other points."""
    noise: float
    """Standard deviation of the noise along the normal."""
    points: int
    """Number of all points."""
    finite: int
    """Number of points without NaN or infinity."""
    noise_quantiles: tuple[float, float, float]
    """The noise at the quietest, the typical and the loudest places: the 5, 50 and 95 % quantiles of the samples."""
    float_step: float
    """The largest step between coordinates: a run works on 32-bit floats around the cloud's origin, and they step by
    1 mm at 16 km. 0 for float32 arrays, which keep their digits."""
    without_surface: float
    """Share of the cloud where no surface shows, as in crowns or clutter beside one; 1 where none shows anywhere. The
    default run does not move it."""


@dataclasses.dataclass(frozen=True)
class Outliers:
    """How many outliers there are, by reason."""

    isolated: int
    """Too few neighbours within reach."""
    off_surface: int
    """Farther than the outlier distance from the surface that the neighbours show."""
    mixed_pixels: int
    """Between two surfaces along the ray; only where the place of the sensor is known or found."""


@dataclasses.dataclass(frozen=True)
class Unmoved:
    """How many points kept their place, by reason."""

    non_finite: int
    """A coordinate is NaN or infinite, or its square would overflow; in an image of points also pixels at (0, 0, 0)."""
    too_few_neighbors: int
    """Fewer than 3 neighbours."""
    no_normal: int
    """Neighbours identical or on a line."""
    outliers: int
    """Off the surface."""
    outliers_by_reason: Outliers
    """The outliers by reason."""
    boundary: int
    """On the border of a mesh, which keep_boundary holds."""

    @property
    def total(self) -> int:
        """All points that kept their place."""
        return self.non_finite + self.too_few_neighbors + self.no_normal + self.outliers + self.boundary


@dataclasses.dataclass(frozen=True)
class Stage:
    """How long a stage took."""

    name: str
    """Such as "neighbors"."""
    milliseconds: float
    """On the device; further iterations are added."""


@dataclasses.dataclass(frozen=True)
class Mesh:
    """The mesh that a run followed, connectivity="mesh", as it was found."""

    faces: int
    """All that were given."""
    vertices: int
    """Places of points that faces have; points at one place are one vertex."""
    degenerate_faces: int
    """With fewer than 3 different places; they make no edges."""
    boundary_edges: int
    """With one face."""
    non_manifold_edges: int
    """With more than two faces."""
    boundary_vertices: int
    """Of boundary edges."""
    isolated_points: int
    """Of no face; they keep their place."""
    folded_before: int
    """Faces of the input whose normal is more than 90 degrees off their filtered normal."""
    folded_after: int
    """The same of the result."""


@dataclasses.dataclass(frozen=True)
class Solver:
    """The solution of the equations of method="implicit"."""

    iterations: int
    """Of conjugate gradients, over all iterations of the run."""
    residual: float
    """The largest that was left, relative to the right-hand side."""


@dataclasses.dataclass(frozen=True)
class Report:
    """What a run did."""

    device: DeviceInfo
    """Where it ran."""
    points: int
    """Number of all points."""
    params: Params
    """As used in a typical place: lengths in the unit of the points, and "auto" only for values that the run did not
    read. What was automatic followed the noise from place to place, so to repeat a run, give it the same parameters and
    not these."""
    unmoved: Unmoved
    """Points that kept their place."""
    short_neighborhoods: int
    """Points whose constrained neighbourhood has fewer than k neighbours."""
    copies: int
    """Points that repeat another one, exactly or nearly, if eight of 500 samples do: they count for nothing
    and got the result of that one, which brings them together. 0 where no parameter follows the noise."""
    stages: tuple[Stage, ...]
    """The stages that ran, in order."""
    mesh: Mesh | None
    """The mesh that the run followed; None without connectivity="mesh"."""
    solver: Solver | None
    """Of method="implicit"; None with others."""
    tiles: int
    """Number of tiles that the cloud was cut into; 1: not cut."""
    milliseconds: float
    """Time of the run, from array to array."""
    peak_host_bytes: int
    """Largest host memory of the pipeline, without the caller's arrays."""
    peak_device_bytes: int
    """Largest memory on the card."""
    found_sensor: tuple[float, float, float] | None
    """Where the sensor stood by the distances between points, as the run took it to look for mixed pixels; None where a place
    was given, or none was looked for or found."""
    pulled: Outliers
    """Outliers that outliers="move" pulled in; the first iteration tells."""
    noise: float = dataclasses.field(default=float("nan"))
    """Estimated on the input; nan: not asked for."""
    spacing: float = dataclasses.field(default=float("nan"))
    """Estimated on the input; nan: not asked for."""
    normals: NDArray[np.float32] | None = dataclasses.field(default=None, repr=False, compare=False)
    """The unit normals of the result, (N, 3), with normals=True; zero where there is none."""
    outliers: NDArray[np.bool_] | None = dataclasses.field(default=None, repr=False, compare=False)
    """True for each outlier, with outliers="mark"."""


def device_of(row: tuple[Any, ...]) -> DeviceInfo:
    """A DeviceInfo of the native module's tuple."""
    return DeviceInfo(*row)


def report_of(row: tuple[Any, ...], **more: Any) -> Report:
    """A Report of the native module's tuple."""
    (device, points, params, unmoved, short, copies, stages, mesh, solver, tiles, milliseconds, host_bytes, device_bytes,
     place, pulled) = row
    non_finite, too_few_neighbors, no_normal, outliers, reasons, boundary = unmoved
    kept = Unmoved(non_finite, too_few_neighbors, no_normal, outliers, Outliers(*reasons), boundary)
    return Report(device_of(device), points, Params._of(params), kept, short, copies,
                  tuple(Stage(*stage) for stage in stages), Mesh(*mesh) if mesh[0] else None,
                  Solver(*solver) if solver[0] else None, tiles, milliseconds, host_bytes, device_bytes,
                  tuple(place) if place else None, Outliers(*pulled), **more)
