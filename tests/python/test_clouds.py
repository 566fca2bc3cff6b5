# SPDX-License-Identifier: Apache-2.0
"""Files and clouds: what is read, what is written, what is refused."""
import copy
import warnings

import numpy as np
import pytest
from clouds import read_ply, same_bits, waves, write_ply

import pointfair as pf


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_file_is_read_moved_and_written(tmp_path, dtype):
    xyz = waves(dtype=dtype, centre=(500000, 5.8e6, 100))
    write_ply(tmp_path / "in.ply", xyz)
    cloud = pf.read(tmp_path / "in.ply")
    assert len(cloud) == 3000 and same_bits(cloud.xyz, xyz)
    smooth = cloud.denoise(k=20)
    smooth.write(tmp_path / "out.ply")
    assert same_bits(cloud.xyz, xyz)
    assert same_bits(smooth.xyz, pf.denoise(xyz, k=20))
    assert same_bits(read_ply(tmp_path / "out.ply", dtype), smooth.xyz)


def test_arrays_become_files(tmp_path):
    xyz = waves(100, centre=(500000.1, 5.8e6, 0))
    pf.write(tmp_path / "a.ply", xyz)
    assert same_bits(pf.read(tmp_path / "a.ply").xyz, xyz)
    pf.write(tmp_path / "a.xyz", xyz.astype(np.float32))
    assert same_bits(pf.read(tmp_path / "a.xyz").xyz.astype(np.float32), xyz.astype(np.float32))
    assert len(pf.Cloud(np.empty((0, 3)))) == 0


def test_names_of_attributes_may_have_letters_of_any_kind(tmp_path):
    xyz, heights = waves(100), np.arange(100, dtype=np.float32)
    pf.Cloud(xyz, {"höhe €": heights}).write(tmp_path / "a.npy")
    assert np.load(tmp_path / "a.npy").dtype.names == ("x", "y", "z", "höhe €")
    assert same_bits(pf.read(tmp_path / "a.npy")["höhe €"], heights)
    rows = "".join(f"{x},{y},{z},{h}\n" for (x, y, z), h in zip(xyz, heights))
    (tmp_path / "latin.csv").write_bytes(("x,y,z,höhe\n" + rows).encode("latin-1"))  # as spreadsheets write it
    cloud = pf.read(tmp_path / "latin.csv")
    name = "höhe".encode("latin-1").decode("utf-8", "surrogateescape")
    assert list(cloud.attributes) == [name] and list(cloud.values()) == [name]
    assert same_bits(cloud[name].astype(np.float32), heights)
    assert "h\\udcf6he" in repr(cloud)
    cloud.write(tmp_path / "latin.npy")
    assert np.load(tmp_path / "latin.npy").dtype.names[3] == "höhe"
    copied = pf.Cloud(xyz, {name: heights})
    assert list(copied.attributes) == [name]
    with pytest.raises(pf.UsageError, match="no attribute"):
        cloud["\ud800"]


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8", ">f8", "?"])
def test_attributes_of_each_type_survive_a_file(tmp_path, kind):
    values = np.arange(100).astype(kind)
    cloud = pf.Cloud(waves(100), {"level": values})
    expected = values.astype("u1") if kind == "?" else values.astype(values.dtype.newbyteorder("="))
    assert same_bits(cloud["level"], expected)
    assert cloud.attributes == {"level": expected.dtype} and "level" in cloud
    cloud.write(tmp_path / "a.ply")
    assert same_bits(pf.read(tmp_path / "a.ply")["level"], expected)


def test_several_attributes_are_read_at_once(tmp_path):
    (tmp_path / "a.csv").write_text("x,y,z,i,red,name\n1,2,3,0.5,7,oak\n4,5,6,0.25,8,ash\n")
    cloud = pf.read(tmp_path / "a.csv")
    cloud["normal"] = np.ones((2, 3), np.float32)
    assert list(cloud.values()) == ["i", "red", "normal"]
    some = cloud.values("normal", "i")
    assert list(some) == ["normal", "i"] and some["normal"].shape == (2, 3)
    for name, values in cloud.values().items():
        assert same_bits(values, cloud[name])
    with pytest.raises(pf.UsageError, match="no attribute 'name'"):
        cloud.values("i", "name")


def test_attributes_may_have_several_values_a_point():
    cloud = pf.Cloud(waves(50))
    cloud["normal"] = np.ones((50, 3), np.float32)
    cloud["normal"] = np.zeros((50, 3), np.float32)
    assert cloud["normal"].shape == (50, 3) and not cloud["normal"].any()
    assert cloud.attributes["normal"].shape == (3,)


def test_a_cloud_knows_where_its_sensor_stood():
    rng = np.random.default_rng(4)
    xyz = np.c_[rng.random((4000, 2)), rng.normal(0, 0.004, 4000)]
    cloud = pf.Cloud(xyz)
    for axis, place in zip("xyz", (0.5, 0.5, 2.0)):
        cloud["v" + axis] = np.full(len(xyz), place)
    named = pf.denoise(cloud, viewpoint="vx,vy,vz", along="ray").xyz
    assert same_bits(named, pf.denoise(cloud, viewpoint=(0.5, 0.5, 2.0), along="ray").xyz)
    assert same_bits(named, pf.denoise(xyz, viewpoint=np.tile((0.5, 0.5, 2.0), (len(xyz), 1)), along="ray"))
    assert same_bits(named, cloud.denoise(viewpoint=(0.5, 0.5, 2.0), along="ray").xyz)
    rays, moved = xyz - (0.5, 0.5, 2.0), named - xyz
    assert np.abs(np.cross(rays, moved)).max() < 1e-6 and np.abs(moved).max() > 1e-3
    far = xyz + np.array([500000.0, 5.8e6, 100.0])
    there = pf.denoise(far, viewpoint=(500000.5, 5.8e6 + 0.5, 102.0), along="ray", return_report=True, normals=True)
    assert np.abs(there[0] - far - moved).max() < 1e-4
    assert (there[1].normals[:, 2] >= 0).all() and there[1].unmoved.outliers_by_reason.mixed_pixels < 20
    with pytest.raises(pf.UsageError, match="viewpoint"):
        pf.denoise(xyz, viewpoint=(1.0, 2.0))
    for wrong in ((1.0, "a", 2.0), ((1.0, 2.0, 3.0), (1.0, 2.0)), "vx,vy,vz", 3.0):
        with pytest.raises(pf.UsageError, match="viewpoint"):
            pf.denoise(xyz, viewpoint=wrong)
    with pytest.raises(pf.UsageError, match="^along ray needs .* give viewpoint"):
        pf.denoise(xyz, along="ray")


def two_walls():
    """The image of a camera at the origin of coordinates; a pixel in each of 60 rows lies between the walls."""
    rng = np.random.default_rng(4)
    column, row = np.meshgrid(np.arange(80), np.arange(60))
    depth = np.where(column < 40, 1.0, np.where(column == 40, rng.uniform(1.2, 1.8, column.shape), 2.0)) + rng.normal(0, .001, column.shape)
    return np.stack([(column - 40) * .01 * depth, (row - 30) * .01 * depth, depth], -1).reshape(-1, 3)


def test_distances_between_points_tell_where_the_sensor_stood():
    walls, far = two_walls(), np.array([500000.0, 5.4e6, 100.0])
    near = np.array([3000.0, -2000.0, 500.0])  # whose floats have an origin
    for points, origin in ((walls.astype(np.float32), 0), (walls, 0), (walls + far, far), ((walls + near).astype(np.float32), near)):
        report = pf.denoise(points, return_report=True)[1]
        assert np.linalg.norm(report.found_sensor - np.asarray(origin)) < 0.7
        assert report.unmoved.outliers_by_reason.mixed_pixels == 60 and report.pulled.mixed_pixels == 0
        moved = pf.denoise(points, outliers="move", return_report=True)[1]
        assert moved.pulled.mixed_pixels > 50 and moved.unmoved.outliers == 0
        for place in ((0, 0, 0) + np.asarray(origin), (np.nan, np.nan, np.nan)):
            told = pf.denoise(points, viewpoint=place, return_report=True)[1]
            assert told.found_sensor is None and (told.unmoved.outliers_by_reason.mixed_pixels == 60) == np.isfinite(place[0])
    pipeline = pf.Pipeline("cpu")
    pipeline.load(walls)
    assert pipeline.run() is not None and pipeline.report.found_sensor is not None
    assert any("show a sensor near" in note for note in pipeline.notes())
    pipeline.set_viewpoint(None)
    assert pipeline.run() is not None and pipeline.report.found_sensor is None


def test_outliers_are_marked():
    xyz = waves()
    xyz[::100, 2] += 0.5
    cloud, report = pf.denoise(pf.Cloud(xyz), outliers="mark", return_report=True)
    assert report.unmoved.outliers == report.outliers.sum() == (cloud["outlier"] > 0).sum() >= 25
    assert report.outliers.dtype == bool and report.outliers[::100].sum() >= 25
    assert same_bits(pf.denoise(xyz, outliers="mark"), cloud.xyz)


def test_points_are_chosen_by_attributes(tmp_path):
    xyz = waves(2000)
    kinds = np.arange(2000, dtype=np.uint8) % 3
    cloud = pf.Cloud(xyz, {"kind": kinds})
    whole = pf.denoise(xyz, k=10)
    chosen = cloud.denoise(k=10, where="kind=1-2").xyz
    assert same_bits(chosen[kinds > 0], whole[kinds > 0]) and same_bits(chosen[kinds == 0], xyz[kinds == 0])
    without = cloud.denoise(k=10, ignore="kind=0").xyz
    assert same_bits(without[kinds > 0], pf.denoise(xyz[kinds > 0], k=10)) and same_bits(without[kinds == 0], xyz[kinds == 0])
    pipeline = pf.Pipeline("cpu")
    pipeline.load(cloud, ignore="kind=0")
    assert same_bits(pipeline.run(k=10).xyz, without)
    assert same_bits(pipeline.run(k=10, strength=0).xyz, xyz)
    for wrong in ("kind", "colour=1", 3, "", "kind=x"):
        with pytest.raises(pf.UsageError):
            cloud.denoise(where=wrong)
        with pytest.raises(pf.UsageError):
            cloud.denoise(ignore=wrong)
    with pytest.raises(pf.UsageError, match="need a Cloud"):
        pf.denoise(xyz, where="kind=1")
    with pytest.raises(pf.UsageError, match="needs a Cloud"):
        pipeline.load(xyz, ignore="kind=1")


def test_lengths_in_metres_need_a_file_that_has_them():
    assert pf.Params(noise="5mm").noise == pf.Params(noise="0.005m").noise
    assert pf.Params(**pf.Params(noise="5mm").changed()) == pf.Params(noise="5mm")
    with pytest.raises(pf.UsageError, match="noise"):
        pf.denoise(waves(50), noise="5mm")


def test_attributes_of_a_file_get_new_values(tmp_path):
    pf.Cloud(waves(20), {"kind": np.zeros(20, np.uint8)}).write(tmp_path / "a.ply")
    cloud = pf.read(tmp_path / "a.ply")
    cloud["kind"] = np.arange(20, dtype=np.uint8)
    assert (cloud["kind"] == np.arange(20)).all() and list(cloud.attributes) == ["kind"]
    cloud.write(tmp_path / "b.ply")
    assert (pf.read(tmp_path / "b.ply")["kind"] == np.arange(20)).all()


@pytest.mark.parametrize("name, lost", [("a.obj", ["kind"]), ("a.off", ["kind"]), ("a.xyz", ["kind", "normal", "red"]),
                                        ("a.pts", ["kind", "normal", "red"]), ("a.csv", []), ("a.ply", []), ("a.pcd", [])])
def test_attributes_that_a_file_does_not_keep_are_told(tmp_path, name, lost):
    colours = {channel: np.zeros(20, np.uint8) for channel in ("red", "green", "blue")}
    cloud = pf.Cloud(waves(20), {"kind": np.zeros(20, np.uint8), "normal": np.ones((20, 3), np.float32), **colours})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        cloud.write(tmp_path / name)
        pf.write(tmp_path / ("b" + name), cloud)
    told = [str(warning.message) for warning in caught]
    assert len(told) == (2 if lost else 0) and all(warning.filename == __file__ for warning in caught)
    for word in ("kind", "normal", "red"):
        assert all((word in text) == (word in lost) for text in told)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pf.read(tmp_path / name).write(tmp_path / ("again" + name))
        pf.compare(cloud, cloud)


def test_positions_can_be_set():
    cloud = pf.Cloud(waves(100, centre=(1e6, 0, 0)))
    moved = cloud.xyz
    moved[3] += 0.25
    cloud.xyz = moved
    assert same_bits(cloud.xyz, moved)
    with pytest.raises(pf.UsageError, match="keeps its number of points"):
        cloud.xyz = moved[:5]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("before, after", [((0, 0, 0), (500000.1, 5.2e6, 300)), ((500000.1, 5.2e6, 300), (0, 0, 0)),
                                           ((0, 0, 0), (0.1, 0.2, 0.3))])
def test_positions_that_are_set_keep_their_digits(tmp_path, dtype, before, after):
    cloud = pf.Cloud(waves(500, centre=before, dtype=dtype), {"kind": np.arange(500, dtype=np.uint16)})
    wanted = waves(500, seed=2, centre=after)
    wanted[7] = np.nan
    cloud.xyz = wanted
    assert same_bits(cloud.xyz, wanted) and (cloud["kind"] == np.arange(500)).all()
    assert same_bits(cloud.copy().xyz, wanted)
    cloud.write(tmp_path / "a.csv")
    assert same_bits(pf.read(tmp_path / "a.csv").xyz, wanted)
    cloud.write(tmp_path / "a.ply")
    step = np.spacing(np.float32(1)) if dtype == np.float32 and after[0] < 1 else 0
    found = pf.read(tmp_path / "a.ply")
    np.testing.assert_allclose(found.xyz, wanted, rtol=0, atol=step)
    assert (found["kind"] == np.arange(500)).all()
    fresh = pf.Cloud(wanted)
    assert same_bits(pf.denoise(cloud, k=10).xyz, pf.denoise(fresh, k=10).xyz)
    cloud.xyz = waves(500, centre=before, dtype=dtype)
    assert same_bits(cloud.xyz.astype(dtype), waves(500, centre=before, dtype=dtype))


def test_points_of_a_file_that_are_not_set_anew_keep_their_bytes(tmp_path):
    lines = [f"{x * 0.25:.2f} {x % 7:.3f} 1.50 {x}" for x in range(100)]
    (tmp_path / "a.xyz").write_text("\n".join(lines) + "\n")
    cloud = pf.read(tmp_path / "a.xyz")
    xyz = cloud.xyz.astype(float)
    xyz[3] = 1 / 3, 500000.5, 0.1
    cloud.xyz = xyz
    cloud.write(tmp_path / "b.xyz")
    lines[3] = f"{1 / 3!r} 500000.5 0.1 3"
    assert (tmp_path / "b.xyz").read_text().splitlines() == lines


def test_a_las_file_refuses_positions_that_its_scale_does_not_reach(tmp_path):
    pf.write(tmp_path / "a.las", waves(100, centre=(500000, 5.2e6, 300)))
    cloud = pf.read(tmp_path / "a.las")
    cloud.xyz = waves(100)
    with pytest.raises(pf.FileError, match="scale and offset have no integers"):
        cloud.write(tmp_path / "b.las")
    cloud.write(tmp_path / "b.ply")
    assert same_bits(pf.read(tmp_path / "b.ply").xyz, waves(100))


def test_four_columns_are_no_positions_of_a_cloud():
    cloud = pf.Cloud(waves(10))
    with pytest.raises(pf.UsageError, match="4 columns"):
        cloud.xyz = np.zeros((10, 4))


def test_copies_are_independent():
    cloud = pf.Cloud(waves(20))
    other = copy.copy(cloud)
    other["a"] = np.zeros(20, np.uint8)
    assert "a" not in cloud and "a" in copy.deepcopy(other)


def test_triangles(tmp_path):
    (tmp_path / "m.off").write_text("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    assert pf.read(tmp_path / "m.off").triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert pf.Cloud(waves(5)).triangles.shape == (0, 3)


@pytest.mark.parametrize("name, values", [
    ("a", np.zeros(4)), ("a", np.zeros((5, 0))), ("a", np.zeros((5, 2, 2))), ("a", np.zeros(5, np.int64)), ("a", np.zeros(5, "U3")),
    ("a", [1, 2, 3, 4, 5]), ("a", np.zeros(5, complex)),
])
def test_attributes_that_cannot_be_are_refused(name, values):
    with pytest.raises(pf.UsageError, match=name):
        pf.Cloud(waves(5))[name] = values


@pytest.mark.parametrize("name", ["x", "Y"])
def test_a_coordinate_is_no_attribute(name):
    cloud = pf.Cloud(waves(5))
    with pytest.raises(pf.UsageError, match="assign positions to cloud.xyz"):
        cloud[name] = np.zeros(5)
    with pytest.raises(pf.UsageError, match="cloud.xyz has the positions"):
        cloud[name]
    assert not cloud.attributes


def test_a_cloud_is_no_sequence():
    cloud = pf.Cloud(waves(5))
    for call in (lambda: cloud[0], lambda: cloud[:3], lambda: np.asarray(cloud), lambda: list(cloud)):
        with pytest.raises(pf.UsageError, match="names of attributes.*cloud.xyz"):
            call()


def test_arguments_in_each_others_place_are_named(tmp_path):
    with pytest.raises(pf.UsageError, match="^path is a ndarray: give a text") as raised:
        pf.write(waves(5), tmp_path / "a.ply")
    assert len(str(raised.value)) < 80
    with pytest.raises(pf.UsageError, match="^path is a ndarray"):
        pf.read(waves(5))
    with pytest.raises(pf.UsageError, match="^device is a ndarray"):
        pf.Pipeline(waves(5))


@pytest.mark.parametrize("columns, says", [("x,y,z", r"columns is a str: give a list of names, \['x', 'y', 'z'\]"), (["a", "b", "c"], "once each"),
                                           (["x", "y", "z", "x"], "once each"), ([3], "name of a column"),
                                           (5, "columns is an int"), (None, "columns is None")])
def test_columns_are_names_with_coordinates(tmp_path, columns, says):
    (tmp_path / "a.csv").write_text("1,2,3\n")
    with pytest.raises(pf.UsageError, match=says):
        pf.read(tmp_path / "a.csv", columns=columns)


@pytest.mark.parametrize("skip", ["x", None, 2**70, -1, 1.5, True])
def test_lines_to_skip_are_a_whole_number(tmp_path, skip):
    (tmp_path / "a.csv").write_text("1,2,3\n")
    with pytest.raises(pf.UsageError, match="^skip cannot be"):
        pf.read(tmp_path / "a.csv", skip=skip)


def test_a_path_with_a_zero_is_refused_rather_than_cut(tmp_path):
    for path in (f"{tmp_path}/a.ply\0b.pcd", f"{tmp_path}/a.ply\0b.pcd".encode()):
        with pytest.raises(pf.UsageError, match="no name of a file has a zero in it"):
            pf.write(path, waves(5))
        with pytest.raises(pf.UsageError, match="no name of a file has a zero in it"):
            pf.read(path)
    with pytest.raises(pf.FileError, match="cannot be read"):
        pf.denoise(waves(50), method="learned", weights=f"{tmp_path}/a.ply\0b.pcd")
    assert not list(tmp_path.iterdir())


def test_messages_of_the_library_name_arguments_of_python(tmp_path):
    (tmp_path / "a.data").write_text("one two\nthree four\n")
    with pytest.raises(pf.FileError, match=r"unknown format; say which it is \(format\)"):
        pf.read(tmp_path / "a.data")
    (tmp_path / "a.csv").write_text("a,b,c\n1,2,3\n")
    with pytest.raises(pf.FileError, match="as in columns") as raised:
        pf.read(tmp_path / "a.csv")
    assert "--" not in str(raised.value)


def test_errors_of_files_name_the_file_and_the_next_step(tmp_path):
    cloud = pf.Cloud(waves(5))
    with pytest.raises(pf.FileError, match="missing.ply"):
        pf.read(tmp_path / "missing.ply")
    (tmp_path / "broken.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 3\n")
    with pytest.raises(pf.FileError, match="broken.ply"):
        pf.read(tmp_path / "broken.ply")
    cloud.write(tmp_path / "a.ply")
    with pytest.raises(pf.FileError, match="a.ply: exists already; choose another name or set overwrite"):
        cloud.write(tmp_path / "a.ply")
    cloud.write(tmp_path / "a.ply", overwrite=True)
    with pytest.raises(pf.FileError, match="unknown extension"):
        cloud.write(tmp_path / "a.what")
    with pytest.raises(pf.UsageError, match="format cannot be 'what'"):
        cloud.write(tmp_path / "b", format="what")
    with pytest.raises(pf.UsageError, match="encoding cannot be 'zip'"):
        cloud.write(tmp_path / "b.ply", encoding="zip")
    with pytest.raises(pf.UsageError, match="no attribute 'colour'"):
        cloud["colour"]
    with pytest.raises(pf.UsageError, match="4 columns"):
        pf.Cloud(np.zeros((3, 4)))
    with pytest.raises(OSError):
        pf.read(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.ply", "broken.ply"]


def test_names_of_files_are_bytes(tmp_path):
    import os
    path = os.fsencode(tmp_path) + b"/\xff.ply"
    pf.write(path, waves(5))
    assert len(pf.read(os.fsdecode(path))) == 5
    with pytest.raises(pf.FileError, match="fe.ply"):
        pf.read(os.fsencode(tmp_path) + b"/\xfe.ply")
    for wrong in (3, None, "\ud800"):
        with pytest.raises(pf.UsageError, match="^path (is|cannot be)"):
            pf.read(wrong)
    for arguments in ({"format": 3}, {"format": "\ud800"}, {"threads": -1}):
        with pytest.raises(pf.UsageError, match="cannot be|is an int: give a text"):
            pf.read(path, **arguments)
    for name in (5, "\ud800", None):
        with pytest.raises(pf.UsageError):
            pf.Cloud(waves(5))[name]


def test_what_belongs_to_arrays_is_refused_for_clouds():
    cloud = pf.Cloud(waves(50))
    with pytest.raises(pf.UsageError, match="out="):
        pf.denoise(cloud, out=np.empty((50, 3)))
    with pytest.raises(pf.UsageError, match="return_report"):
        cloud.denoise(return_report=True)


def test_messages_name_arguments_and_no_flags(tmp_path):
    cloud = pf.Cloud(waves(500) + (5e5, 5e6, 0), {"class": np.zeros(500, np.uint8)})
    with pytest.raises(pf.FileError, match="leave out strict$"):
        cloud.write(tmp_path / "a.obj", strict=True)
    (tmp_path / "far.off").write_text("OFF\n3 1 0\n500000.001 0 0\n500001.002 0 0\n500000.003 1 0\n3 0 1 2\n")
    with pytest.warns(UserWarning, match="; encoding ascii keeps them$"):
        pf.read(tmp_path / "far.off").write(tmp_path / "a.stl")
    sparse = np.c_[1000 * np.random.default_rng(1).random((3000, 2)), np.random.default_rng(2).normal(0, 0.02, 3000)]
    pipeline = pf.Pipeline("cpu")
    pipeline.load(sparse)
    notes = pipeline.notes(np.linalg.norm(pipeline.run() - sparse, axis=1))
    assert any("noise gives the noise" in note for note in notes) and not any("--" in note for note in notes), notes


def test_compare_measures_what_geometry_says(tmp_path):
    flat = np.c_[np.random.default_rng(1).random((2000, 2)), np.zeros(2000)]
    (tmp_path / "square.off").write_text("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    found = pf.compare(flat + [0, 0, 0.25], tmp_path / "square.off")
    assert found.points == 2000 and abs(found.mean - 0.25) < 1e-6 and abs(found.max - 0.25) < 1e-6
    assert abs(found.diagonal - 2**0.5) < 1e-6 and found.normal_error is None
    assert pf.compare(flat, pf.Cloud(flat)).max == 0
    with pytest.raises(pf.FileError, match="missing"):
        pf.compare(flat, tmp_path / "missing.ply")
    with pytest.raises(pf.UsageError, match="^edges: .* no number from 0 to 180$"):
        pf.compare(flat, flat, edges=1000)
    with pytest.raises(pf.UsageError, match="threads cannot be"):
        pf.compare(flat, flat, threads=1.0)
    with pytest.raises(pf.UsageError, match="^b has no points"):
        pf.compare(flat, flat[:0])
    with pytest.raises(pf.FileError, match="^b: has no finite point"):
        pf.compare(flat, np.full((5, 3), np.nan))
    with pytest.raises(pf.UsageError, match="^b is a list: give an array, numpy.asarray"):
        pf.compare(flat, [1])
    for no_flag in ("--help", "-", "-o"):
        with pytest.raises(pf.FileError, match=f"^./{no_flag}: cannot open"):
            pf.compare(no_flag, flat)
    with pytest.raises(pf.UsageError, match="has a zero in it"):
        pf.compare("a\0.ply", flat)
