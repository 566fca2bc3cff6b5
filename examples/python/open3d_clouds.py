# SPDX-License-Identifier: Apache-2.0
"""Both kinds of point cloud of Open3D. The tensor kind needs no copy through NumPy by hand.

    python open3d_clouds.py scan.ply smooth.ply"""
from __future__ import annotations

import pathlib
import sys
from typing import Any

import numpy as np
import open3d as o3d

import pointfair as pf


def denoise_tensor_cloud(cloud: Any, **parameters: Any) -> Any:
    """Denoises an open3d.t.geometry.PointCloud on the CPU; colours and other attributes stay."""
    smooth = cloud.clone()
    smooth.point.positions = pf.denoise(cloud.point.positions, **parameters)
    return smooth


def denoise_legacy_cloud(cloud: Any, **parameters: Any) -> Any:
    """Denoises an open3d.geometry.PointCloud; colours stay."""
    smooth = o3d.geometry.PointCloud(cloud)
    smooth.points = o3d.utility.Vector3dVector(pf.denoise(np.asarray(cloud.points), **parameters))
    return smooth


if __name__ == "__main__":
    source, target = map(pathlib.Path, sys.argv[1:3])
    o3d.t.io.write_point_cloud(target, denoise_tensor_cloud(o3d.t.io.read_point_cloud(source)))
