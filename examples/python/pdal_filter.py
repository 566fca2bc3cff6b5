# SPDX-License-Identifier: Apache-2.0
"""For PDAL's filters.python:

    {"type": "filters.python", "script": "pdal_filter.py", "module": "pdal_filter", "function": "denoise",
     "pdalargs": {"k": 24}}

PDAL must run in a Python that has pointfair."""
from __future__ import annotations

from typing import Any

import numpy as np

import pointfair as pf

pdalargs: dict[str, Any] = {}  # PDAL sets it


def denoise(ins: dict[str, Any], outs: dict[str, Any]) -> bool:
    """Moves X, Y and Z; every other dimension stays."""
    xyz = np.column_stack([ins["X"], ins["Y"], ins["Z"]])
    outs["X"], outs["Y"], outs["Z"] = np.ascontiguousarray(pf.denoise(xyz, **pdalargs).T)
    return True
