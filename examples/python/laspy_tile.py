# SPDX-License-Identifier: Apache-2.0
"""A tile of a laser scan with laspy: only ground and buildings move, and everything else in the file stays.

    python laspy_tile.py tile.las smooth.las"""
from __future__ import annotations

import sys

import laspy
import numpy as np

import pointfair as pf

GROUND, BUILDING = 2, 6


def denoise_tile(source: str, target: str) -> pf.Report:
    """Returns what the run did."""
    las = laspy.read(source)
    movable = np.isin(np.asarray(las.classification), (GROUND, BUILDING))
    las.xyz, report = pf.denoise(las.xyz, mask=movable, return_report=True)
    las.write(target)
    return report


if __name__ == "__main__":
    print(denoise_tile(*sys.argv[1:3]))
