# SPDX-License-Identifier: Apache-2.0
"""A scan before and after, side by side, as a picture. Without a scan, ripples with noise.

    python pyvista_before_after.py picture.png [scan.ply]"""
from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pyvista


def ripples(count: int = 150_000, noise: float = 0.03) -> Any:
    """A wave around the origin."""
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-1, 1, (2, count))
    distance = np.hypot(x, y)
    height = 0.25 * np.cos(7 * distance) * np.exp(-1.2 * distance) + rng.normal(0, noise, count)
    return pyvista.PolyData(np.column_stack([x, y, height]))


def draw(cloud: Any, picture: str) -> None:
    """Writes the picture."""
    smooth = cloud.pointfair.denoise()
    heights = smooth.points[:, 2]
    plotter: Any = pyvista.Plotter(off_screen=True, shape=(1, 2), window_size=[1400, 600], border=False)
    for column, shown in enumerate((cloud, smooth)):
        plotter.subplot(0, column)
        plotter.add_points(shown, scalars=shown.points[:, 2], clim=(heights.min(), heights.max()), point_size=2,
                           show_scalar_bar=False)
        plotter.camera.zoom(1.2)
    plotter.screenshot(picture)


if __name__ == "__main__":
    draw(pyvista.read(sys.argv[2]) if len(sys.argv) > 2 else ripples(), sys.argv[1])
