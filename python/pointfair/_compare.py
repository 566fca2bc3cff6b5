# SPDX-License-Identifier: Apache-2.0
"""Distances of a cloud to another one or to a mesh, measured by the program that comes with the package."""
from __future__ import annotations

import dataclasses
import os
from typing import Any

from ._arrays import as_numpy, check_positions
from ._cloud import Cloud
from ._cloud import _path as path_bytes
from ._errors import Error, FileError, UsageError
from ._program import program_path
from ._values import as_threads


@dataclasses.dataclass(frozen=True)
class FaceComparison:
    """How the faces of mesh A differ from mesh B, in the unit of the coordinates. Where both have the same faces, each is
    compared with its own, else with the nearest one of B."""

    faces: int
    """Number of faces of A that have an area."""
    folded: int
    """How many of them are turned by more than 90 degrees from B's."""
    normal_error: float
    """Mean angle between the normals of A's and of B's faces, in degrees."""
    turned: bool
    """Whether most of A's area faces the other way than B's; then all faces were turned round first."""
    back_mean: float
    """Mean distance of B's vertices to A's faces."""
    back_rms: float
    """Root mean square of those."""
    back_max: float
    """The largest of those."""
    volume: float | None
    """Of A; None if it is not closed."""
    reference_volume: float | None
    """Of B."""


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Distances of cloud A to cloud or mesh B, in the unit of the coordinates."""

    points: int
    """Number of points of A."""
    diagonal: float
    """Of B's bounding box."""
    mean: float
    """Mean distance."""
    rms: float
    """Root mean square of the distances."""
    p95: float
    """95 % of the distances are smaller."""
    max: float
    """The largest distance."""
    chamfer: float
    """Mean squared distance from A to B plus that from B to A, where B's bounding sphere has radius 1."""
    edge_rms: float | None
    """Root mean square of the distances near edges; None without `edges`."""
    edge_points: int
    """Number of those points."""
    normal_error: float | None
    """Mean angle to the normal of the nearest face in degrees; None without `normals`."""
    faces: FaceComparison | None
    """Where both are meshes; else None."""


def compare(a: Any, b: Any, *, as_cloud: bool = False, edges: float | None = None, normals: int | None = None,
            threads: int = 0) -> Comparison:
    """Measures the distances of cloud `a` to `b`, a cloud or a mesh. Both are arrays, (N, 3), Clouds, or paths.

    Args:
        as_cloud: use only b's points if it has faces.
        edges: also measure near edges of b whose faces differ by more than this angle, in degrees.
        normals: also measure the error of normals of planes through this many nearest points, at least 3.
        threads: CPU threads; 0: all cores.

    Raises UsageError, FileError.
    """
    import json  # here, since they double the time of importing the package
    import subprocess
    import tempfile

    arguments = ["--threads", str(as_threads(threads))] + (["--as", "cloud"] if as_cloud else [])
    for name, value in (("--edges", edges), ("--normals", normals)):
        arguments += [] if value is None else [name, str(value)]
    with tempfile.TemporaryDirectory(prefix="pointfair-") as folder:
        paths = [_path(points, folder, name) for name, points in (("a", a), ("b", b))]
        command = [program_path(), "compare", *paths, "--report", "-", *arguments]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
    if done.returncode != 0:
        message = done.stderr.strip().splitlines()[-1:] or ["no reason given"]
        kind = {2: UsageError, 3: FileError}.get(done.returncode, Error)
        said = message[0].removeprefix("pointfair: ").removeprefix("error: ")
        for name in ("a", "b"):
            said = said.replace(os.path.join(folder, f"{name}.ply"), name)
        raise kind(_in_python(said))
    found = json.loads(done.stdout)
    if (faces := found["faces"]) is not None:
        back = faces.pop("back")
        found["faces"] = FaceComparison(**faces, **{f"back_{name}": back[name] for name in ("mean", "rms", "max")})
    return Comparison(**found)


def _in_python(message: str) -> str:
    """The program's message with the names of this module's arguments in place of flags, and without its own help."""
    message = message.partition("; see pointfair ")[0]
    for flag, name in (("--edges", "edges"), ("--normals", "normals"), ("--threads", "threads"), ("--as cloud", "as_cloud=True")):
        message = message.replace(flag, name)
    return message


def _path(points: Any, folder: str, name: str) -> str:
    if isinstance(points, (str, os.PathLike)):
        path = os.fsdecode(path_bytes(points))
        return os.path.join(os.curdir, path) if path.startswith("-") else path  # no flag, and no standard input
    if not isinstance(points, Cloud):
        check_positions(as_numpy(points, name), name)
    cloud = points if isinstance(points, Cloud) else Cloud(points)
    if len(cloud) == 0:
        raise UsageError(f"{name} has no points: there is nothing to compare")
    temporary = os.path.join(folder, f"{name}.ply")
    cloud._native.write(os.fsencode(temporary), "ply", None, False, False, 0)  # what it does not keep is not compared
    return temporary
