# SPDX-License-Identifier: Apache-2.0
"""PyVista's accessor: `mesh.pointfair.denoise()`. PyVista 0.48 and later find it by themselves; for earlier versions,
import this module once."""
from __future__ import annotations

from typing import Any

import pyvista  # type: ignore[import-not-found,import-untyped,unused-ignore]

from ._denoise import denoise, estimate
from ._report import Estimates


class Accessor:
    """What pointfair adds to point sets and meshes."""

    def __init__(self, dataset: Any) -> None:
        self._dataset = dataset

    def denoise(self, *, inplace: bool = False, **arguments: Any) -> Any:
        """The data set with moved points; cells and arrays stay. Arguments are those of pointfair.denoise but out and
        return_report. With inplace, the data set itself changes."""
        moved = denoise(self._dataset.points, **arguments)
        result = self._dataset if inplace else self._dataset.copy()
        result.points = moved
        return result

    def estimate(self, **arguments: Any) -> Estimates:
        """Bounds, spacing and noise of the points. Arguments are those of pointfair.estimate."""
        return estimate(self._dataset.points, **arguments)


def _register() -> None:
    register = getattr(pyvista, "register_dataset_accessor", None)
    for kind in (pyvista.PointSet, pyvista.PolyData):
        if register is not None:
            register("pointfair", kind)(Accessor)
        else:
            kind.pointfair = property(Accessor)


_register()
