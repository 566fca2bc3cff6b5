# SPDX-License-Identifier: Apache-2.0
"""The examples, and the packages that they work with; a package that is not installed is skipped."""
import importlib
import pathlib
import subprocess
import sys
import types
from array import array

import numpy as np
import pytest
from clouds import same_bits, waves, write_ply

import pointfair as pf

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "examples/python"))
POINTS = waves(2000)


def test_a_laspy_tile(tmp_path):
    laspy = pytest.importorskip("laspy")
    laspy_tile = importlib.import_module("laspy_tile")
    xyz = waves(5000, centre=(500000, 5.8e6, 100))
    las = laspy.create(point_format=6, file_version="1.4")
    las.header.offsets, las.header.scales = [500000, 5.8e6, 100], [1e-4] * 3
    las.xyz = xyz
    las.classification = np.arange(5000) % 4 + 1
    las.intensity = np.arange(5000)
    las.write(tmp_path / "in.las")
    report = laspy_tile.denoise_tile(str(tmp_path / "in.las"), str(tmp_path / "out.las"))
    before, after = laspy.read(tmp_path / "in.las"), laspy.read(tmp_path / "out.las")
    ground = np.asarray(before.classification) == 2
    assert (before.xyz[~ground] == after.xyz[~ground]).all() and (before.xyz[ground] != after.xyz[ground]).any()
    whole = pf.denoise(before.xyz)
    assert np.abs(after.xyz[ground] - whole[ground]).max() <= 0.51e-4
    assert (after.intensity == before.intensity).all() and report.points == 5000
    cloud = pf.read(tmp_path / "in.las")
    assert (cloud["classification"] == before.classification).all() and np.abs(cloud.xyz - before.xyz).max() < 1e-9
    cloud.denoise(where="classification=2").write(tmp_path / "own.las")
    assert np.abs(pf.read(tmp_path / "own.las").xyz - after.xyz)[~ground].max() < 1e-9


class Field:
    def __init__(self, name, offset, datatype):
        self.name, self.offset, self.datatype, self.count = name, offset, datatype, 1


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("kind, datatype", [("f4", 7), ("f8", 8)])
@pytest.mark.parametrize("padding", [0, 24])
def test_a_point_cloud_2_message(order, kind, datatype, padding):
    point_cloud2 = importlib.import_module("point_cloud2")
    size = int(kind[1])
    layout = np.dtype({"names": ["y", "x", "rgb", "z"], "formats": [order + kind, order + kind, "u4", order + kind],
                       "offsets": [1, 1 + size, 1 + 2 * size, 5 + 2 * size], "itemsize": 32})
    image = np.zeros((40, 50), layout)
    for axis, column in zip("xyz", POINTS.T):
        image[axis] = column.reshape(40, 50)
    image["rgb"] = np.arange(2000).reshape(40, 50)
    image["x"][3, 4] = np.nan
    for axis in "xyz":
        image[axis][5, 6] = 0  # as lidars and some cameras say that they saw nothing
    data = b"".join(row.tobytes() + b"\xaa" * padding for row in image)
    message = types.SimpleNamespace(height=40, width=50, is_bigendian=order == ">", point_step=32, row_step=50 * 32 + padding, data=data,
                                    fields=[Field(name, layout.fields[name][1], datatype if name in "xyz" else 6) for name in layout.names])
    xyz = point_cloud2.positions(message)
    expected = np.stack([image[axis] for axis in "xyz"], -1)
    assert same_bits(xyz, expected)
    moved, report = pf.denoise(xyz, k=10, return_report=True)
    assert report.unmoved.non_finite == 2 and same_bits(moved[5, 6], xyz[5, 6])
    changed = point_cloud2.with_positions(message, moved)
    assert isinstance(changed, array) and changed.typecode == "B", "else rclpy looks at each byte"
    changed = changed.tobytes()
    assert len(changed) == len(data)
    again = types.SimpleNamespace(**{**vars(message), "data": changed})
    assert same_bits(point_cloud2.positions(again), moved)
    rows = [np.frombuffer(changed[i * message.row_step:][:1600], layout) for i in range(40)]
    assert (np.stack(rows)["rgb"] == image["rgb"]).all()
    assert all(changed[i * message.row_step + 1600:(i + 1) * message.row_step] == b"\xaa" * padding for i in range(40))
    message.fields = message.fields[1:]
    with pytest.raises(ValueError, match="no field y"):
        point_cloud2.positions(message)


@pytest.mark.parametrize("height, width", [(1, 0), (0, 0), (0, 5)])
def test_a_message_of_ros_without_points_passes(height, width):
    point_cloud2 = importlib.import_module("point_cloud2")
    fields = [types.SimpleNamespace(name=axis, offset=4 * i, datatype=7, count=1) for i, axis in enumerate("xyz")]
    message = types.SimpleNamespace(height=height, width=width, is_bigendian=False, point_step=12, row_step=12 * width, data=b"",
                                    fields=fields)
    xyz = point_cloud2.positions(message)
    assert xyz.shape == (0, 3) and xyz.dtype == np.float32
    assert point_cloud2.with_positions(message, pf.denoise(xyz)) == array("B")


def test_a_filter_of_pdal():
    pdal_filter = importlib.import_module("pdal_filter")
    ins = {axis: column.copy() for axis, column in zip("XYZ", POINTS.T)} | {"Intensity": np.zeros(2000, "u2")}
    outs = {}
    pdal_filter.pdalargs = {"k": 10}
    assert pdal_filter.denoise(ins, outs) is True
    assert same_bits(np.column_stack([outs[axis] for axis in "XYZ"]), pf.denoise(POINTS, k=10)) and set(outs) == set("XYZ")


def test_frames_of_a_sensor():
    sensor_stream = importlib.import_module("sensor_stream")
    frames = [waves(2000 + 100 * i, seed=i, dtype=np.float32) for i in range(3)]
    results = list(sensor_stream.denoise_frames(frames, "cpu"))
    assert all(same_bits(result, pf.denoise(frame, outliers="keep")) for frame, result in zip(frames, results)) and len(results) == 3


def test_frames_of_a_folder_are_written_into_another(tmp_path):
    script = pathlib.Path(importlib.import_module("sensor_stream").__file__)
    frames = {f"{i}.ply": waves(500, seed=i, dtype=np.float32) for i in range(2)}
    (tmp_path / "in").mkdir()
    for name, frame in frames.items():
        pf.write(tmp_path / "in" / name, frame)
    subprocess.run([sys.executable, script, tmp_path / "in", tmp_path / "new/out"], check=True)
    for name, frame in frames.items():
        assert same_bits(pf.read(tmp_path / "new/out" / name).xyz.astype(np.float32), pf.denoise(frame, outliers="keep"))
    empty = subprocess.run([sys.executable, script, tmp_path / "new", tmp_path / "none"], capture_output=True, text=True)
    assert empty.returncode != 0 and "there is no file *.ply" in empty.stderr


def test_frames_of_a_depth_camera_lose_their_noise_at_every_depth():
    sensor_stream = importlib.import_module("sensor_stream")
    rng = np.random.default_rng(1)
    column, row = np.meshgrid(np.arange(200) - 99.5, np.arange(120) - 59.5)
    depth = np.where(column < 0, 1.0, 2.5)
    seen = depth + 0.002 * depth**2 * rng.normal(0, 1, depth.shape)
    frame = np.stack([column / 250 * seen, row / 250 * seen, seen], -1).reshape(-1, 3).astype(np.float32)
    smooth, = sensor_stream.denoise_frames([frame], "cpu")
    inner = ((abs(row) < 50) & (abs(column) > 10) & (abs(column) < 90)).ravel()
    for at in (1.0, 2.5):
        chosen = inner & (depth.ravel() == at)
        assert (smooth[chosen, 2] - at).std() < 0.5 * (frame[chosen, 2] - at).std(), at


def test_torch_batches():
    torch = pytest.importorskip("torch")
    torch_batches = importlib.import_module("torch_batches")
    clouds = [torch.from_numpy(waves(300, seed=i, dtype=np.float32)) for i in range(4)]
    result = torch_batches.denoised(clouds)
    assert isinstance(result, torch.Tensor) and result.shape == (4, 300, 3)
    assert same_bits(result[2].numpy(), pf.denoise(clouds[2].numpy(), k=16, noise=0.01))


def test_both_clouds_of_open3d():
    o3d = pytest.importorskip("open3d")
    open3d_clouds = importlib.import_module("open3d_clouds")
    for dtype in (np.float32, np.float64):
        cloud = o3d.t.geometry.PointCloud(o3d.core.Tensor(POINTS.astype(dtype)))
        cloud.point.colors = o3d.core.Tensor(np.ones((2000, 3), np.float32))
        smooth = open3d_clouds.denoise_tensor_cloud(cloud, k=10)
        assert isinstance(smooth.point.positions, o3d.core.Tensor)
        assert same_bits(smooth.point.positions.numpy(), pf.denoise(POINTS.astype(dtype), k=10))
        assert same_bits(cloud.point.positions.numpy(), POINTS.astype(dtype)) and "colors" in smooth.point
    legacy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    assert same_bits(np.asarray(open3d_clouds.denoise_legacy_cloud(legacy, k=10).points), pf.denoise(POINTS, k=10))


def test_the_accessor_of_pyvista(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    for kind in (pyvista.PointSet, pyvista.PolyData):
        cloud = kind(POINTS)
        cloud["level"] = np.arange(2000)
        smooth = cloud.pointfair.denoise(k=10)
        assert same_bits(np.asarray(smooth.points), pf.denoise(POINTS, k=10)) and (smooth["level"] == np.arange(2000)).all()
        assert same_bits(np.asarray(cloud.points), POINTS)
        assert cloud.pointfair.denoise(k=10, inplace=True) is cloud and (np.asarray(cloud.points) == smooth.points).all()
        assert cloud.pointfair.estimate().points == 2000
