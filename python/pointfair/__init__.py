# SPDX-License-Identifier: Apache-2.0
"""Removes the noise of 3D scans and keeps their shape.

    import pointfair as pf

    smooth = pf.denoise(xyz)                     # (N, 3) float32 or float64
    pf.read("tile.ply").denoise(k=24).write("smooth.ply")
"""
from ._batch import denoise_batch
from ._cloud import Cloud, read, write
from ._compare import Comparison, FaceComparison, compare
from ._denoise import denoise, devices, estimate
from ._depth import denoise_depth
from ._errors import DeviceError, Error, FileError, OutOfMemory, UsageError
from ._native import version as _version
from ._params import PARAMETERS, ParamArguments, Params
from ._pipeline import Pipeline
from ._report import DeviceInfo, DeviceStatus, Estimates, Mesh, Report, Solver, Stage, Unmoved
from ._step import nearest_neighbors
from ._values import Parameter

__version__ = _version()

__all__ = [
    "Cloud", "Comparison", "DeviceError", "DeviceInfo", "DeviceStatus", "Error", "Estimates", "FaceComparison",
    "FileError", "Mesh", "OutOfMemory",
    "PARAMETERS", "ParamArguments", "Parameter", "Params", "Pipeline", "Report", "Solver", "Stage", "Unmoved",
    "UsageError",
    "__version__", "compare", "denoise", "denoise_batch", "denoise_depth", "devices", "estimate",
    "nearest_neighbors", "read", "write",
]
