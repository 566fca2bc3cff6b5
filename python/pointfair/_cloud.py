# SPDX-License-Identifier: Apache-2.0
"""Clouds of files: positions, attributes, and everything else that the file holds."""
from __future__ import annotations

import operator
import os
import warnings
from typing import TYPE_CHECKING, Any, Iterable, Mapping, Sequence

import numpy as np

from . import _native
from ._arrays import as_numpy, check_positions, rows
from ._errors import UsageError
from ._native import Cloud as NativeCloud
from ._progress import Progress, progress_function
from ._runs import borrowed, make_params, run_cloud
from ._values import as_text, as_threads, encodable, kind_of

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from ._params import ParamArguments, Params

_TYPES = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64")
_COORDINATES = ("x", "y", "z", "X", "Y", "Z")
_PLY = "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{}end_header\n"


class Cloud:
    """Positions with attributes, and whatever else their file holds. Its number of points never changes.

    Args:
        xyz: positions, (N, 3) float32 or float64. The cloud keeps every digit of them.
        attributes: values by name, (N,) or (N, C) each.

    Examples:
        >>> cloud = Cloud(np.zeros((2, 3)), {"intensity": np.array([7, 9], np.uint16)})
        >>> cloud["intensity"]
        array([7, 9], dtype=uint16)
        >>> cloud
        <pointfair.Cloud of 2 points, float64; intensity uint16>
    """

    __slots__ = ("_native",)
    _native: NativeCloud

    def __init__(self, xyz: Any, attributes: Mapping[str, Any] | None = None) -> None:
        array = _three_columns(xyz)
        self._native = _native.read_bytes(_ply_of(array), "", "ply") if len(array) else _native.Cloud()
        for name, values in (attributes or {}).items():
            self[name] = values

    @classmethod
    def _of(cls, native: NativeCloud) -> Cloud:
        cloud = cls.__new__(cls)
        cloud._native = native
        return cloud

    @property
    def xyz(self) -> NDArray[Any]:
        """The positions, (N, 3), in the type that holds them without loss, float32 or float64: a copy. Assign to it to
        move points: the cloud keeps every digit, and a file that it is written to has as many as its type of coordinates
        holds. O(N)."""
        out = np.empty((len(self), 3), np.float64)
        self._native.positions(out)
        return out.astype(self._native.position_type, copy=False)

    @xyz.setter
    def xyz(self, positions: Any) -> None:
        self._native.replace_positions(_three_columns(positions).astype(np.float64))

    @property
    def attributes(self) -> dict[str, np.dtype[Any]]:
        """The type of each attribute, by name; one with several values a point has a type with a shape. Bytes of a name
        that are no UTF-8 become surrogates, as in Python's names of files."""
        return {name.decode("utf-8", "surrogateescape"): np.dtype((kind, (n,))) if n > 1 else np.dtype(kind)
                for name, kind, n in self._native.attributes()}

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The values of an attribute, (N,) or (N, C): a copy. Raises UsageError if there is none. O(N)."""
        if not isinstance(name, str):
            raise UsageError(f"a Cloud is indexed by names of attributes, not by {kind_of(name)}: cloud.xyz has the positions")
        if name in _COORDINATES and name not in self:
            raise UsageError(f"'{name}' is a coordinate and no attribute: cloud.xyz has the positions")
        return self.values(name)[name]

    def values(self, *names: str) -> dict[str, NDArray[Any]]:
        """The values of several attributes, by name; without names, of all: copies. A text file is read once for all of
        them. Raises UsageError if there is none of a name. O(N) for each."""
        wanted = list(names) or list(self.attributes)
        found: dict[str, NDArray[Any]] = {}
        for name, (kind, components, values) in zip(wanted, self._native.values(list(map(_bytes_of, wanted)))):
            typed = values.view(kind)
            found[name] = typed.reshape(-1, components) if components > 1 else typed
        return found

    def __setitem__(self, name: str, values: Any) -> None:
        """Adds an attribute, or replaces an added one: one value or one row for each point."""
        if name in _COORDINATES and name not in self:
            raise UsageError(f"'{name}' is a coordinate and no attribute: assign positions to cloud.xyz")
        array = np.ascontiguousarray(as_numpy(values, name))
        if array.dtype == np.bool_:
            array = array.view(np.uint8)
        array = array.astype(array.dtype.newbyteorder("="), copy=False)
        if array.dtype.name not in _TYPES:
            raise UsageError(f"attribute '{name}' has the type {array.dtype}: give one of {', '.join(_TYPES)}")
        if array.ndim not in (1, 2) or len(array) != len(self):
            raise UsageError(f"attribute '{name}' has the shape {array.shape}: give a value or a row for each of the "
                             f"{len(self)} points")
        components = array.shape[1] if array.ndim == 2 else 1
        if components == 0:
            raise UsageError(f"attribute '{name}' has the shape {array.shape}: give one value a point at least")
        self._native.set_attribute(_bytes_of(name), array.dtype.name, components, array.reshape(-1).view(np.uint8))

    def __contains__(self, name: object) -> bool:
        return name in self.attributes

    @property
    def grid(self) -> tuple[int, int] | None:
        """Rows and columns of the image that the points are, row by row, where an organised PCD file says so; else None.
        With it, `cloud.xyz.reshape(*cloud.grid, 3)` is that image."""
        found: tuple[int, int] | None = self._native.grid
        return found

    @property
    def triangles(self) -> NDArray[np.uint32]:
        """The faces of the file as triangles of point indices, (M, 3); polygons as fans."""
        found: NDArray[np.uint32] = self._native.triangles()
        return found

    def denoise(self, params: Params | None = None, *, mask: Any = None, where: str | None = None,
                ignore: str | None = None, strength: float = 1.0, box: Any = None, viewpoint: Any = None,
                weights: Any = None, device: str = "auto", threads: int = 0, progress: Progress = False,
                **parameters: Unpack[ParamArguments]) -> Cloud:
        """A copy with moved points, and with outliers="mark" the attribute "outlier". Arguments are those of
        pointfair.denoise, which has a report as well."""
        chosen = make_params(params, parameters)
        with borrowed(device, threads, weights) as pipeline, progress_function(progress) as show:
            return Cloud._of(run_cloud(pipeline, self._native, chosen, mask=mask, where=where, ignore=ignore,
                                       strength=strength, box=box, viewpoint=viewpoint, show=show))

    def write(self, path: str | os.PathLike[str], *, format: str | None = None, encoding: str | None = None,
              overwrite: bool = False, strict: bool = False, threads: int = 0) -> None:
        """Writes the cloud. In its file's own format, only the coordinates of moved points differ. Other formats keep
        the attributes that they have a place for; what is lost is told in a UserWarning. The file gets its name only
        when it is complete. Raises FileError.

        Args:
            path: its extension says the format.
            format: "ply", "pcd" and so on, where the extension does not say it.
            encoding: "ascii", "binary", "binary-big-endian" or "binary-compressed"; by default the file's own.
            overwrite: False: an existing file is an error.
            strict: True: what the file cannot keep is a FileError rather than a warning.
            threads: 0: all cores.
        """
        self._write(path, format, encoding, overwrite, strict, threads)

    def _write(self, path: Any, format: Any, encoding: Any, overwrite: bool, strict: bool, threads: int) -> None:
        notes = self._native.write(_path(path), _optional(format, "format"), _optional(encoding, "encoding"),
                                   bool(overwrite), bool(strict), as_threads(threads))
        for note in notes:
            warnings.warn(note, stacklevel=3)

    def copy(self) -> Cloud:
        """An independent copy."""
        return Cloud._of(self._native.copy())

    __copy__ = copy

    def __deepcopy__(self, memo: Any) -> Cloud:
        return self.copy()

    def __reduce__(self) -> Any:
        raise TypeError("a Cloud holds its file and cannot be pickled: pass the path and read it there, or pass cloud.xyz")

    def __len__(self) -> int:
        return len(self._native)

    def __repr__(self) -> str:
        names = ", ".join(f"{encodable(name)} {kind.base}{list(kind.shape) if kind.shape else ''}"
                          for name, kind in self.attributes.items())
        return f"<pointfair.Cloud of {len(self)} points, {self._native.position_type}{'; ' + names if names else ''}>"


def _bytes_of(name: str) -> bytes:
    """Of an attribute, as its file has it."""
    text = as_text(name, "the name of an attribute")
    try:
        return name.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:
        return text.encode()


def _three_columns(xyz: Any) -> NDArray[Any]:
    array = as_numpy(xyz, "xyz")
    check_positions(array, "xyz")
    if array.shape[1] != 3:
        raise UsageError("xyz has 4 columns: give xyz[:, :3], and the fourth as an attribute")
    return rows(array)


def _ply_of(array: NDArray[Any]) -> bytes:
    """As a file, behind which the library keeps every digit."""
    kind = "float" if array.dtype.itemsize == 4 else "double"
    header = _PLY.format(len(array), "".join(f"property {kind} {axis}\n" for axis in "xyz"))
    return header.encode() + array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes()


def read(path: str | os.PathLike[str], *, format: str | None = None, columns: Sequence[str] = (), skip: int = 0,
         threads: int = 0) -> Cloud:
    """Reads a whole file; the content and the extension say the format, unless `format` does. Points stay in the order
    of the file, invalid ones included. `columns` names the columns of a text from the left, "x", "y" and "z" among them,
    where the file does not; `skip` lines at its front are passed over. Raises FileError with path, place and reason."""
    names = _column_names(columns)
    return Cloud._of(_native.read(_path(path), _optional(format, "format"), names, _as_lines(skip), as_threads(threads)))


def _as_lines(skip: Any) -> int:
    try:
        number = -1 if isinstance(skip, (bool, np.bool_)) else operator.index(skip)
    except TypeError:
        number = -1
    if not 0 <= number < 2**63:
        raise UsageError(f"skip cannot be {skip!r}: give the number of lines to pass over, a whole number from 0")
    return number


def _column_names(columns: Any) -> list[str]:
    if isinstance(columns, str):
        raise UsageError(f"columns is a str: give a list of names, {columns.split(',')} for instance")
    if not isinstance(columns, Iterable):
        raise UsageError(f"columns is {kind_of(columns)}: give a list of names, ['x', 'y', 'z'] for instance")
    names = [as_text(name, "the name of a column") for name in columns]
    if names and not all(names.count(axis) == 1 for axis in "xyz"):
        raise UsageError(f"columns cannot be {names}: 'x', 'y' and 'z' must be there, once each")
    return names


def _path(path: Any) -> bytes:
    try:
        encoded = os.fsencode(path)
        if b"\0" in encoded:  # where the library's paths end
            raise UsageError(f"path cannot be {path!r}: no name of a file has a zero in it")
        return encoded
    except (TypeError, UnicodeEncodeError):
        shown = f"cannot be {path!r}" if isinstance(path, str) else f"is {kind_of(path)}"
        raise UsageError(f"path {shown}: give a text or a pathlib.Path") from None


def _optional(text: Any, name: str) -> str | None:
    return None if text is None else as_text(text, name)


def write(path: str | os.PathLike[str], points: Any, *, format: str | None = None, encoding: str | None = None,
          overwrite: bool = False, strict: bool = False, threads: int = 0) -> None:
    """Writes a Cloud, or an array of positions, (N, 3). See Cloud.write."""
    _path(path)  # which is wrong where both arguments are in each other's place
    cloud = points if isinstance(points, Cloud) else Cloud(points)
    cloud._write(path, format, encoding, overwrite, strict, threads)
