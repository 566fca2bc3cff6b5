# SPDX-License-Identifier: Apache-2.0
"""The add-on of Blender, in Blender as a Python module (bpy of PyPI, 370 MB, which make test-integrations installs)."""
import importlib
import pathlib
import sys

import numpy as np
import pytest
from clouds import same_bits

import pointfair as pf

bpy = pytest.importorskip("bpy", reason="bpy is not installed: make test-integrations installs it")


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


def test_a_point_cloud_is_denoised(addon):
    points, _ = noisy_sheet()
    add(points)
    bpy.context.active_object.select_set(True)
    assert bpy.ops.object.convert(target="POINTCLOUD") == {"FINISHED"}
    scan = bpy.context.active_object
    assert scan.type == "POINTCLOUD" and bpy.ops.object.pointfair_denoise() == {"FINISHED"}
    assert same_bits(addon.positions_of(scan.data), pf.denoise(points))


@pytest.mark.parametrize("importer, name", [("ply_import", "scan.ply"), ("obj_import", "scan.obj")])
def test_an_imported_scan_is_not_shaded_with_the_normals_of_its_noise(addon, tmp_path, importer, name):
    points, quads = noisy_sheet()
    normals = np.random.default_rng(2).normal(0, 0.3, points.shape) + [0, 0, 1]
    corners = ["%d//%d" % (i, i) for i in range(1, len(points) + 1)]
    lines = ["v %.9g %.9g %.9g" % tuple(p) for p in points] + ["vn %.4f %.4f %.4f" % tuple(n) for n in normals]
    (tmp_path / "scan.obj").write_text("\n".join(lines + ["f " + " ".join(corners[i] for i in quad) for quad in quads]) + "\n")
    if name != "scan.obj":
        pf.read(tmp_path / "scan.obj").write(tmp_path / name)
    assert getattr(bpy.ops.wm, importer)(filepath=str(tmp_path / name), forward_axis="Y", up_axis="Z") == {"FINISHED"}
    scan = bpy.context.view_layer.objects.active = bpy.context.selected_objects[0]
    assert scan.data.has_custom_normals and len(scan.data.polygons) == len(quads)
    assert bpy.ops.object.pointfair_denoise() == {"FINISHED"} and not scan.data.has_custom_normals
    moved = addon.positions_of(scan.data)
    slope = 0.6 * np.cos(6 * moved[:, 0])  # of the waves
    true = np.c_[-slope, 0 * slope, 1 + 0 * slope] / np.sqrt(1 + slope**2)[:, None]
    shaded = np.array([corner.vector for corner in scan.data.corner_normals])
    of_corner = np.array([loop.vertex_index for loop in scan.data.loops])
    inner = (moved[of_corner, :2] > 0.1).all(1) & (moved[of_corner, :2] < 0.9).all(1)
    assert np.sqrt(np.mean(np.sum((shaded - true[of_corner])[inner] ** 2, 1))) < 0.1  # those of the file are off by 0.4


def test_an_object_with_shape_keys_is_refused_with_what_to_do(addon):
    points, faces = noisy_sheet()
    mesh = add(points, faces)
    bpy.context.active_object.shape_key_add(name="Basis")
    with pytest.raises(RuntimeError, match="apply or remove"):
        bpy.ops.object.pointfair_denoise()
    assert same_bits(addon.positions_of(mesh), points)


def test_it_is_not_offered_where_nothing_can_be_denoised(addon):
    assert not bpy.ops.object.pointfair_denoise.poll()
    with pytest.raises(RuntimeError):
        bpy.ops.object.pointfair_denoise()
    add(np.zeros((0, 3), np.float32))
    assert not bpy.ops.object.pointfair_denoise.poll()
    add(noisy_sheet()[0])
    assert bpy.ops.object.pointfair_denoise.poll()
