# SPDX-License-Identifier: Apache-2.0
"""The add-on of Blender, in Blender as a Python module (bpy of PyPI, 370 MB, which the tests do not install)."""
import importlib
import pathlib
import sys

import numpy as np
import pytest
from clouds import same_bits

import pointfair as pf

bpy = pytest.importorskip("bpy", reason="bpy is not installed")


@pytest.fixture
def addon(monkeypatch):
    monkeypatch.syspath_prepend(str(pathlib.Path(__file__).parents[2] / "examples/blender"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    module = importlib.import_module("pointfair_addon")
    module.register()
    yield module
    module.unregister()
    del sys.modules["pointfair_addon"]


def noisy_sheet(side=60):
    """Vertices and quads of a sheet of waves."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side), indexing="ij"))
    z = 0.1 * np.sin(6 * x) + np.random.default_rng(1).normal(0, 0.005, side * side)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()[:, None]
    return np.c_[x, y, z].astype(np.float32), corner + [0, side, side + 1, 1]


def add(points, faces=()):
    mesh = bpy.data.meshes.new("scan")
    mesh.from_pydata(points.tolist(), [], np.asarray(faces).tolist())
    scan = bpy.data.objects.new("scan", mesh)
    bpy.context.collection.objects.link(scan)
    bpy.context.view_layer.objects.active = scan
    return mesh


def test_a_mesh_is_denoised_along_its_faces(addon):
    points, faces = noisy_sheet()
    mesh = add(points, faces)
    assert bpy.ops.object.pointfair_denoise() == {"FINISHED"}
    moved = addon.positions_of(mesh)
    assert same_bits(moved, pf.denoise(points, faces=addon.triangles_of(mesh), connectivity="mesh"))
    off = [np.std(xyz[:, 2] - 0.1 * np.sin(6 * xyz[:, 0])) for xyz in (points, moved)]
    assert off[1] < 0.5 * off[0] and len(mesh.polygons) == len(faces)


def test_vertices_without_faces_are_a_cloud_and_parameters_act(addon):
    points, _ = noisy_sheet()
    mesh = add(points)
    assert bpy.ops.object.pointfair_denoise(noise=0.004, iterations=1, strength=0.5) == {"FINISHED"}
    noise = np.float32(0.004).item()  # Blender's numbers are floats
    assert same_bits(addon.positions_of(mesh), pf.denoise(points, noise=noise, iterations=1, strength=0.5))


def test_it_is_not_offered_where_nothing_can_be_denoised(addon):
    assert not bpy.ops.object.pointfair_denoise.poll()
    with pytest.raises(RuntimeError):
        bpy.ops.object.pointfair_denoise()
    add(np.zeros((0, 3), np.float32))
    assert not bpy.ops.object.pointfair_denoise.poll()
    add(noisy_sheet()[0])
    assert bpy.ops.object.pointfair_denoise.poll()
