# SPDX-License-Identifier: Apache-2.0
"""Frames of a depth camera: depths and points, what comes back, and how much noise goes."""
import numpy as np
import pytest
from clouds import same_bits

import pointfair as pf

HEIGHT, WIDTH, FOCAL = 60, 80, 70.0


def frames(dtype=np.float32, windowed=False):
    """True and measured points of a slanted wall with a box in front, whose error in disparity is alike in windows."""
    v, u = np.indices((HEIGHT, WIDTH)) - np.array([HEIGHT / 2, WIDTH / 2])[:, None, None]
    depth = 1 / (0.5 + 0.001 * u)
    depth[20:40, 25:50] = 1.4
    error = np.random.default_rng(3).normal(0, 0.004, depth.shape)
    if windowed:
        padded = np.pad(error, 2, mode="wrap")
        error = sum(padded[i:i + HEIGHT, j:j + WIDTH] for i in range(5) for j in range(5)) / 5
    rays = np.stack([u / FOCAL, v / FOCAL, np.ones_like(depth)], -1)
    return (depth[..., None] * rays).astype(dtype), (rays / (1 / depth + error)[..., None]).astype(dtype)


def error(points, truth):
    return np.abs(points[..., 2].astype(float) - truth[..., 2]).mean()


@pytest.mark.parametrize("windowed, share", [(False, 0.35), (True, 0.6)])
def test_most_noise_goes_and_pixels_stay_on_their_rays(windowed, share):
    truth, measured = frames(np.float64, windowed)
    result = pf.denoise_depth(measured)
    assert error(result, truth) < share * error(measured, truth)
    assert np.abs(np.cross(result, measured)).max() < 1e-12


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_depths_and_points_agree_and_keep_what_was_not_measured(dtype):
    points = frames(dtype)[1]
    points[3, 5:9], points[30:34, 60] = np.nan, 0
    points[9, 9, 0] = np.inf
    before = points.copy()
    result = pf.denoise_depth(points)
    assert same_bits(points, before) and result.dtype == dtype and result.shape == points.shape
    kept = ~np.isfinite(points).all(axis=2) | (points == 0).all(axis=2)
    assert kept.sum() == 9 and same_bits(result[kept], points[kept])
    depth = np.where(kept, 0, points[..., 2])
    assert same_bits(pf.denoise_depth(depth)[~kept], result[..., 2][~kept])
    fourth = np.concatenate([points, np.full((HEIGHT, WIDTH, 1), 7, dtype)], -1)
    assert same_bits(pf.denoise_depth(fourth), np.concatenate([result, fourth[..., 3:]], -1))
    assert same_bits(pf.denoise_depth(np.asfortranarray(points), threads=1), result)
    assert pf.denoise_depth(points, out=points) is points and same_bits(points, result)


def organised(path, image, intensity):
    """An organised PCD file with a column beside the points."""
    height, width, _ = image.shape
    rows = np.zeros(height * width, [("xyz", "<f4", 3), ("intensity", "<u2")])
    rows["xyz"], rows["intensity"] = image.reshape(-1, 3), intensity
    path.write_bytes(f"VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 2\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH {width}\nHEIGHT {height}\n"
                     f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(rows)}\nDATA binary\n".encode() + rows.tobytes())


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_image_has_the_camera_that_its_file_has(tmp_path, dtype):
    image = frames(np.float32)[1]
    image[20:40:2, 24], image[7, 9] = image[20:40:2, 24] * 1.2, 0  # between the box and the wall
    organised(tmp_path / "in.pcd", image, np.zeros(HEIGHT * WIDTH))
    pipeline = pf.Pipeline("cpu")
    pipeline.load(pf.read(tmp_path / "in.pcd"))
    of_file = pipeline.run(outliers="keep").xyz.reshape(image.shape)
    file_report, file_notes = pipeline.report, pipeline.notes()
    assert file_report.unmoved.outliers_by_reason.mixed_pixels > 0
    assert any("where the rays of the grid meet; viewpoint=(nan, nan, nan)" in note for note in file_notes), file_notes
    points = image.astype(dtype)
    pipeline.load(points)
    result = pipeline.run(outliers="keep")
    measured = (image != 0).any(axis=-1)
    assert same_bits(result[measured].astype(np.float32), of_file[measured].astype(np.float32))
    assert pipeline.report.unmoved == file_report.unmoved
    assert pipeline.notes() == file_notes
    assert same_bits(pf.denoise(points, outliers="keep"), result)
    pipeline.load(points)
    pipeline.set_viewpoint(None)
    pipeline.run(outliers="keep")
    assert pipeline.report.unmoved.outliers_by_reason.mixed_pixels == 0
    assert not any("rays of the grid" in note for note in pipeline.notes())


def test_an_organised_file_is_an_image(tmp_path):
    points = frames()[1]
    points[3, 5:9], points[30:34, 60] = np.nan, 0
    organised(tmp_path / "in.pcd", points, np.arange(HEIGHT * WIDTH) % 1000)
    cloud = pf.read(tmp_path / "in.pcd")
    assert cloud.grid == (HEIGHT, WIDTH)
    smooth = pf.denoise_depth(cloud)
    expected = pf.denoise_depth(points)
    empty = (points == 0).all(axis=2, keepdims=True)  # which a file's cloud has as invalid points
    assert not same_bits(expected, points) and same_bits(smooth.xyz.reshape(points.shape), np.where(empty, np.nan, expected).astype(np.float32))
    assert same_bits(cloud.xyz.reshape(points.shape), np.where(empty, np.nan, points).astype(np.float32))
    moved = cloud.denoise(k=8).xyz.reshape(points.shape)
    assert same_bits(moved, np.where(empty, np.nan, pf.denoise(points, k=8)).astype(np.float32))
    smooth.write(tmp_path / "out.pcd")
    organised(tmp_path / "expected.pcd", expected, np.arange(HEIGHT * WIDTH) % 1000)
    assert (tmp_path / "out.pcd").read_bytes() == (tmp_path / "expected.pcd").read_bytes()
    assert cloud.denoise(k=8, outliers="keep").grid == cloud.grid
    with pytest.raises(pf.UsageError, match="new Cloud"):
        pf.denoise_depth(cloud, out=points)
    rows = pf.Cloud(points.reshape(-1, 3))
    assert rows.grid is None
    with pytest.raises(pf.UsageError, match="organised PCD"):
        pf.denoise_depth(rows)


@pytest.mark.parametrize("wrong, advice", [
    (np.zeros(5, np.float32), r"\(H, W\)"), (np.zeros((4, 5, 2)), r"\(H, W, 3\)"), (np.zeros((4, 5), np.uint16), "float32 or float64"),
    ([[1.0]], "array"), (np.ones((307200, 3), np.float32), r"reshape\(H, W, -1\)"), (np.ones((100, 4)), r"reshape\(H, W, -1\)"),
])
def test_what_is_no_frame_is_refused_with_advice(wrong, advice):
    with pytest.raises(pf.UsageError, match=advice):
        pf.denoise_depth(wrong)
    with pytest.raises(pf.UsageError, match="out is"):
        pf.denoise_depth(np.zeros((4, 5), np.float32), out=np.zeros((4, 6), np.float32))


@pytest.mark.parametrize("scale", [1, 1000])
def test_frames_in_other_coordinates_than_the_cameras_are_refused(scale, tmp_path):
    _, measured = frames(np.float64)
    measured *= scale
    measured[5, 5:20] = 0
    measured[7, 5:20] = np.nan
    seen = np.isfinite(measured).all(axis=2) & (measured != 0).any(axis=2)
    assert pf.denoise_depth(measured)[seen].shape == measured[seen].shape
    forward = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # x looks ahead, y to the left, z up, as robots have it
    moved = np.where(seen[..., None], measured + scale * np.array([3.0, 1.0, 2.0]), 0)
    with pytest.raises(pf.UsageError, match=r"meet at \(3(000)?, 1(000)?, 2(000)?\), and not at \(0, 0, 0\)"):
        pf.denoise_depth(moved)
    with pytest.raises(pf.UsageError, match="z below and above 0"):
        pf.denoise_depth(measured @ forward.T)
    with pytest.raises(pf.UsageError, match="meet at"):
        pf.denoise_depth(np.where(seen[..., None], measured @ forward.T + scale * np.array([3.0, 1.0, 9.0]), 0).astype(np.float32))
    organised(tmp_path / "moved.pcd", moved, np.zeros(moved[..., 0].size))
    with pytest.raises(pf.UsageError, match="meet at"):
        pf.denoise_depth(pf.read(tmp_path / "moved.pcd"))
    assert same_bits(pf.denoise_depth(-measured), -pf.denoise_depth(measured))  # a camera that looks along -z
