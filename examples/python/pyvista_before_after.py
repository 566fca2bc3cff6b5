# SPDX-License-Identifier: Apache-2.0
"""A scan before and after, side by side, as a picture.

    python pyvista_before_after.py scan.ply picture.png"""
from __future__ import annotations

import sys
from typing import Any

import pyvista


def draw(cloud: Any, picture: str) -> None:
    """Writes the picture."""
    plotter = pyvista.Plotter(off_screen=True, shape=(1, 2), window_size=(1400, 700))
    for column, shown in enumerate((cloud, cloud.pointfair.denoise())):
        plotter.subplot(0, column)
        plotter.add_points(shown, scalars=shown.points[:, 2], point_size=3, show_scalar_bar=False)
    plotter.link_views()
    plotter.screenshot(picture)


if __name__ == "__main__":
    draw(pyvista.read(sys.argv[1]), sys.argv[2])
