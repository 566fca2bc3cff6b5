# SPDX-License-Identifier: Apache-2.0
"""Arrays of every kind: the right result, or the right exception with a sentence."""
import pathlib
import warnings

import numpy as np
import pytest
from clouds import same_bits, waves
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import pointfair as pf

POINTS = waves(400)
# What a run of these points gives, from plain contiguous arrays; test_program.py compares such runs with the program.
EXPECTED = {np.dtype(t): pf.denoise(POINTS.astype(t), k=10) for t in (np.float32, np.float64)}


def strided(array):
    wide = np.full((2 * len(array), 5), 7, array.dtype)
    wide[::2, 1:4] = array
    return wide[::2, 1:4]


def backwards(array):
    return np.ascontiguousarray(array[::-1])[::-1]


def read_only(array):
    copy = array.copy()
    copy.flags.writeable = False
    return copy


def unaligned(array):
    memory = np.zeros(array.nbytes + 1, np.uint8)
    view = memory[1:].view(array.dtype).reshape(array.shape)
    view[...] = array
    return view


def byte_swapped(array):
    return array.astype(array.dtype.newbyteorder(">"))


LAYOUTS = [np.copy, np.asfortranarray, strided, backwards, read_only, unaligned, byte_swapped]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_layout_changes_nothing(layout, dtype):
    points = layout(POINTS.astype(dtype))
    before = points.copy()
    result = pf.denoise(points, k=10)
    assert same_bits(result.astype(dtype), EXPECTED[np.dtype(dtype)])
    assert result.dtype == points.dtype and type(result) is np.ndarray
    assert same_bits(points, before)
    assert not np.shares_memory(result, points)


def test_memory_order_comes_back():
    assert pf.denoise(np.asfortranarray(POINTS)).flags.f_contiguous
    assert pf.denoise(POINTS).flags.c_contiguous


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_fourth_column_stays(dtype):
    fourth = np.c_[POINTS, np.arange(len(POINTS))].astype(dtype)
    result = pf.denoise(fourth, k=10)
    assert same_bits(np.ascontiguousarray(result[:, :3]), EXPECTED[np.dtype(dtype)])
    assert same_bits(result[:, 3], fourth[:, 3])


def test_out_may_be_the_input_or_any_part_of_it():
    for make in (np.copy, np.asfortranarray, strided, byte_swapped):
        points = make(POINTS)
        assert pf.denoise(points, k=10, out=points) is points
        assert same_bits(points.astype(float), EXPECTED[np.dtype(float)])
    long = np.concatenate([POINTS, POINTS])
    pf.denoise(long[:400], k=10, out=long[100:500])
    assert same_bits(long[100:500], EXPECTED[np.dtype(float)])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("offset", [0, 1e5])
@pytest.mark.parametrize("arguments", [dict(strength=0.0), dict(mask=np.zeros(400, bool))])
def test_zeros_that_stay_keep_their_signs(dtype, offset, arguments):
    points = (POINTS * (20, 20, 1) + (offset, offset, 0)).astype(dtype)
    points[:300, 2] = -0.0
    result = pf.denoise(points, **arguments)
    stay = result == points
    assert stay[:300, 2].any() and same_bits(result[stay], points[stay])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_pixels_without_a_measurement_keep_the_signs_of_their_zeros(dtype):
    image = POINTS.astype(dtype).reshape(20, 20, 3)
    image[3, 4], image[3, 5], image[7, 7] = (-0.0, 0, 0), 0, (0, -0.0, -0.0)
    result = pf.denoise(image)
    for pixel in ((3, 4), (3, 5), (7, 7)):
        assert same_bits(result[pixel], image[pixel])


@pytest.mark.parametrize("out", [np.empty((400, 3), np.float32), np.empty((399, 3)), np.empty((400, 4)),
                                 read_only(POINTS), [1, 2], np.empty((400, 3), int)])
def test_an_out_that_cannot_take_the_result_is_refused(out):
    with pytest.raises(pf.UsageError, match="out "):
        pf.denoise(POINTS, out=out)


def test_large_coordinates_keep_their_digits():
    centre = np.array([500000.125, 5800000.25, 120.0])
    near, far = pf.denoise(POINTS, k=10, noise=0.01), pf.denoise(POINTS + centre, k=10, noise=0.01)
    assert np.abs(far - centre - near).max() < 1e-5
    still = pf.denoise(POINTS + centre, mask=np.zeros(400, bool))
    assert same_bits(still, POINTS + centre)


def test_points_that_cannot_be_treated_keep_their_bits_and_are_counted():
    for dtype in (np.float32, np.float64):
        points = POINTS.astype(dtype)
        points[7] = np.nan, 1, 2
        points[9] = np.inf, -np.inf, 0
        result, report = pf.denoise(points, return_report=True)
        assert same_bits(result[[7, 9]], points[[7, 9]])
        assert report.unmoved.non_finite == 2 and report.unmoved.total >= 2
        assert (result[:7] != points[:7]).any()


@pytest.mark.parametrize("count", [0, 1, 2, 3, 8])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_few_points(count, dtype):
    points = POINTS[:count].astype(dtype)
    result, report = pf.denoise(points, return_report=True, normals=True)
    assert result.shape == (count, 3) and result.dtype == dtype
    assert report.points == count and report.normals.shape == (count, 3)
    if count < 3:
        assert same_bits(result, points)


@pytest.mark.parametrize("wrong, advice", [
    (POINTS.tolist(), "numpy.asarray"), (None, "numpy.asarray"), ("text", "pointfair.read"), (pathlib.Path("scan.ply"), "pointfair.read"), (5, "^points is an int: give an array, numpy"), (object(), "^points is an object: give an array, numpy"),
    (POINTS.astype(int), "float32 or float64"), (POINTS.astype(np.float16), "float32 or float64"),
    (POINTS.astype(np.longdouble), "float32 or float64"), (POINTS.astype(complex), "float32 or float64"),
    (POINTS.astype(object), "float32 or float64"), (POINTS > 0, "float32 or float64"), (POINTS[:, :2], r"\(N, 3\)"),
    (POINTS[0], r"\(N, 3\)"), (POINTS.reshape(2, 2, 100, 3), r"\(H, W, 3\)"), (np.empty(()), r"\(N, 3\)"),
    (np.empty((5, 5)), r"\(N, 3\)"),
    (POINTS.T, r"points.T has a point in each row"), (np.empty((50, 6)), r"points\[:, :3\] has the coordinates"), (np.zeros(3, [("i", "u1"), ("x", "f4"), ("y", "f4"), ("z", "f4")]), r"numpy.column_stack\(\[points\['x'\], points\['y'\], points\['z'\]\]\)"),
    (POINTS.reshape(2, -1, 3).swapaxes(1, 2), r"numpy.transpose\(points, \(0, 2, 1\)\) has the coordinates last, and denoise_batch takes a batch"),
    (POINTS.reshape(2, -1, 3).transpose(2, 0, 1), r"numpy.transpose\(points, \(1, 2, 0\)\) has the coordinates last"),
])
def test_what_is_no_array_of_positions_is_refused_with_advice(wrong, advice):
    with pytest.raises(pf.UsageError, match=advice):
        pf.denoise(wrong)
    with pytest.raises(pf.UsageError, match=advice):
        pf.estimate(wrong)
    with pytest.raises(pf.UsageError, match=advice):
        pf.Pipeline("cpu").load(wrong)


class OnCard:
    """A tensor whose memory a host cannot read."""

    def __dlpack_device__(self):
        return (2, 0)


class Gradient:
    requires_grad = True


class DlpackOnly:
    """An array that only DLPack can see."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


def test_masks_on_a_card_and_tensors_of_a_graph_are_refused_with_what_to_do():
    with pytest.raises(pf.DeviceError, match=r"tensor.cpu\(\)"):
        pf.denoise(POINTS, mask=OnCard())
    with pytest.raises(pf.UsageError, match=r"tensor.detach\(\)"):
        pf.denoise(Gradient())


def test_dlpack_and_buffers_are_read_in_place():
    assert same_bits(pf.denoise(DlpackOnly(POINTS), k=10), EXPECTED[np.dtype(float)])
    assert same_bits(pf.denoise(memoryview(POINTS), k=10), EXPECTED[np.dtype(float)])


def test_torch_tensors_come_back_as_tensors():
    torch = pytest.importorskip("torch")
    tensor = torch.from_numpy(POINTS.copy())
    result = pf.denoise(tensor, k=10)
    assert isinstance(result, torch.Tensor) and same_bits(result.numpy(), EXPECTED[np.dtype(float)])
    assert pf.denoise(tensor, k=10, out=tensor) is tensor and torch.equal(tensor, result)
    with pytest.raises(pf.UsageError, match="detach"):
        pf.denoise(tensor.requires_grad_())
    with pytest.raises(pf.UsageError, match=r"bfloat16: give float32 or float64, .*points.float\(\)"):
        pf.denoise(tensor.detach().to(torch.bfloat16))
    assert torch.equal(pf.denoise(torch.from_numpy(POINTS.copy()), k=torch.tensor(10)), result)
    with pytest.raises(pf.UsageError, match=r"clouds has the shape \(1, 3, \d+\).*numpy.transpose\(clouds, \(0, 2, 1\)\)"):
        pf.denoise_batch(tensor.detach().T[None])


RANDOM_SHAPES = st.one_of(st.tuples(st.integers(0, 40), st.sampled_from([3, 3, 3, 4, 2, 5])),
                          st.tuples(st.integers(0, 5)), st.tuples(st.integers(0, 3), st.integers(0, 5), st.just(3)))
RANDOM_TYPES = st.sampled_from(["f4", "f8", ">f4", ">f8", "f2", "i4", "u1", "c8", "?"])


@st.composite
def arrays(draw):
    shape, dtype = draw(RANDOM_SHAPES), np.dtype(draw(RANDOM_TYPES))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    scale = draw(st.sampled_from([1e-30, 1e-3, 1, 1, 1, 1e4, 1e18, 1e30]))
    values = rng.normal(draw(st.sampled_from([0, 0, 1e3, 1e6])), 1, shape) * scale
    if draw(st.booleans()) and values.size:
        values.flat[:: draw(st.integers(1, 7))] = draw(st.sampled_from([np.nan, np.inf, -np.inf, 0, 1e300]))
    with np.errstate(all="ignore"):
        array = values.astype(dtype)
    steps = tuple(slice(None, None, draw(st.sampled_from([1, 1, 2, -1]))) for _ in shape[:1])
    return np.asarray(array, order=draw(st.sampled_from("CF")))[steps]


@settings(max_examples=1000, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(arrays(), st.sampled_from([{}, {"k": 5}, {"radius": 0.5}, {"iterations": 2, "k": 7}, {"strength": 0.5}]), st.booleans())
def test_random_arrays_give_the_result_of_a_plain_copy_or_a_sentence(array, arguments, in_place):
    before = array.copy()
    good = array.dtype.kind == "f" and array.dtype.itemsize in (4, 8) and array.ndim in (2, 3) and array.shape[-1] in (3, 4)
    try:
        result = pf.denoise(array, **arguments, out=array if in_place else None)
    except pf.UsageError as error:
        assert not good
        assert " " in str(error) and "\n" not in str(error)
        assert same_bits(array, before)
        return
    assert good
    assert result.shape == array.shape and result.dtype == array.dtype
    plain = before[..., :3].astype(before.dtype.newbyteorder("=")).reshape(-1, 3)
    empty = (plain == 0).all(axis=1) & (array.ndim == 3)
    expected = pf.denoise(np.where(empty[:, None], plain.dtype.type(np.nan), plain), **arguments)
    expected[empty] = 0
    assert same_bits(abs(result[..., :3].reshape(-1, 3)).astype(plain.dtype)[empty], expected[empty])
    assert same_bits(result[..., :3].reshape(-1, 3).astype(plain.dtype)[~empty], expected[~empty])
    broken = ~np.isfinite(before[..., :3]).all(axis=-1)
    assert same_bits(result[broken], before[broken])
    if not in_place:
        assert same_bits(array, before)


def test_a_vector_of_a_legacy_cloud_of_open3d_comes_back_as_one():
    class Vector3dVector:  # of open3d.utility: made of an array, and seen as one
        def __init__(self, array):
            self.array = np.array(array, np.float64)

        def __array__(self, dtype=None, copy=None):
            return self.array

    Vector3dVector.__module__ = "open3d.cpu.pybind.utility"
    result = pf.denoise(Vector3dVector(POINTS), k=10)
    assert type(result) is Vector3dVector and same_bits(result.array, EXPECTED[np.dtype(float)])


@pytest.mark.parametrize("call", [pf.denoise, pf.estimate, lambda array: pf.Pipeline("cpu").load(array), pf.Cloud])
def test_masked_elements_do_not_count_as_the_numbers_under_the_mask(call):
    masked = np.ma.masked_array(POINTS, np.zeros(POINTS.shape, bool))
    call(masked)
    masked[5] = np.ma.masked
    with pytest.raises(pf.UsageError, match=r"masked elements.*\.filled\(numpy\.nan\)"):
        call(masked)
    assert np.isnan(pf.denoise(masked.filled(np.nan), k=10)).sum() == 3
    with pytest.raises(pf.UsageError, match="mask has masked elements"):
        pf.denoise(POINTS, mask=np.ma.masked_array(np.ones(len(POINTS), bool), np.arange(len(POINTS)) == 3))


@pytest.mark.parametrize("part, advice", [("points", "points.points"), ("xyz", "points.xyz"), ("point", "points.point.positions")])
def test_objects_that_hold_positions_are_refused_with_the_name_of_these(part, advice):
    holder = type("PointCloud", (), {part: POINTS})()
    with pytest.raises(pf.UsageError, match=f"^points is a PointCloud: give its positions, {advice}$"):
        pf.denoise(holder)


def test_the_type_that_is_advised_keeps_all_digits():
    for kind, advised in ((np.int64, "float64"), (object, "float64"), (np.float16, "float32")):
        with pytest.raises(pf.UsageError, match=rf"astype\('{advised}'\)"):
            pf.denoise(POINTS.astype(kind))


@pytest.mark.parametrize("call", [pf.denoise, pf.estimate, pf.denoise_batch, lambda array: pf.Pipeline("cpu").load(array), pf.Cloud])
def test_arrays_without_memory_are_refused(call):
    class Meta:  # as a tensor of torch on the device "meta"
        shape, dtype, ndim = (5, 3), "float32", 2

        def __dlpack_device__(self):
            raise ValueError("Unknown device type meta for Dlpack")

    with pytest.raises(pf.UsageError, match="no memory that can be read.*give an array"):
        call(Meta())


def image(dtype, columns=3):
    """40 x 30 pixels of a camera that looks at a noisy sheet, some without a measurement."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:40, :30] / 30.0
    points = np.stack([x, y, 2 + 0.1 * np.sin(6 * x) + rng.normal(0, 0.01, x.shape), 7 * x][:columns], -1).astype(dtype)
    points[3, 5:9, :3], points[20:24, 10, :3] = np.nan, 0
    return points


INVALID = np.zeros((40, 30), bool)
INVALID[3, 5:9] = INVALID[20:24, 10] = True


@pytest.mark.parametrize("columns", [3, 4])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_image_of_points_keeps_its_shape_and_its_invalid_pixels(dtype, columns):
    points = image(dtype, columns)
    before = points.copy()
    result, report = pf.denoise(points, k=10, outliers="mark", normals=True, return_report=True)
    assert same_bits(points, before)
    assert same_bits(result[INVALID], points[INVALID]) and result.shape == points.shape and result.dtype == dtype
    assert report.unmoved.non_finite == 8 and report.points == 1200
    assert report.normals.shape == (40, 30, 3) and report.outliers.shape == (40, 30)
    rows = np.where(INVALID[..., None], np.nan, points[..., :3]).astype(dtype).reshape(-1, 3)
    expected = pf.denoise(rows, k=10, outliers="mark").reshape(40, 30, 3)
    assert same_bits(result[~INVALID][:, :3], expected[~INVALID])
    assert same_bits(result[..., 3:], points[..., 3:])
    assert pf.estimate(points).finite == 1192


def test_images_of_any_layout_and_a_mask_of_their_shape():
    points = image(np.float32)
    expected = pf.denoise(points, k=10)
    planes = np.moveaxis(np.ascontiguousarray(np.moveaxis(points, 2, 0)), 0, 2)
    for layout in (np.asfortranarray(points), planes, points[::-1][::-1], byte_swapped(points), unaligned(points)):
        assert same_bits(pf.denoise(layout, k=10).astype(np.float32), expected)
        out = layout.copy()
        assert pf.denoise(layout, k=10, out=out) is out and same_bits(out.astype(np.float32), expected)
    mask = np.arange(30) < 15
    half = pf.denoise(points, k=10, mask=np.broadcast_to(mask, (40, 30)))
    assert same_bits(half, np.where(mask[:, None], expected, points))
    with pytest.raises(pf.UsageError, match="mask has the shape"):
        pf.denoise(points, mask=np.ones((30, 40), bool))


def test_a_batch_in_place_of_an_image_is_told():
    batch = np.stack([waves(500, seed) for seed in range(4)]).astype(np.float32)
    pipeline = pf.Pipeline("cpu")
    for call in (pf.denoise, pf.estimate, pipeline.load):
        with pytest.warns(UserWarning, match=r"\(4, 500, 3\).*denoise_batch"):
            call(batch)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pf.denoise_batch(batch)
        frame = np.full((480, 640, 3), np.nan, np.float32)  # a camera that measured little
        frame[::7, ::9] = np.stack(np.broadcast_arrays(np.arange(0, 640, 9.0), np.arange(0, 480, 7.0)[:, None], 500.0), -1)
        for image_of_points in (image(np.float32), image(np.float64, 4), image(np.float32)[:1], frame, np.zeros((20, 30, 3)), batch[:, :5]):
            pf.denoise(image_of_points)


def test_a_pipeline_of_images():
    points = image(np.float32)
    pipeline = pf.Pipeline("cpu")
    pipeline.load(points)
    result = pipeline.run(k=10, outliers="mark")
    assert same_bits(result, pf.denoise(points, k=10, outliers="mark"))
    assert pipeline.report.unmoved.non_finite == 8 and pipeline.outliers().shape == (40, 30)
    assert pipeline.normals().shape == (40, 30, 3) and pipeline.noise().shape == (40, 30)
    pipeline.set_noise(np.full((40, 30), 0.02))
    pipeline.set_viewpoint(np.zeros((40, 30, 3)))
    assert abs(pipeline.estimates().noise - 0.02) < 1e-6
    moved = pipeline.run(along="ray")
    assert np.abs(np.cross(moved, points)[~INVALID]).max() < 1e-5
    pipeline.load(POINTS)
    assert pipeline.run(k=10).shape == (400, 3) and pipeline.normals().shape == (400, 3)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rows_of_zeros_are_points_where_nothing_names_a_sensor(tmp_path, dtype):
    """A turn of a lidar in a room, a fifth of whose rays came back empty: as an array, as rows of NaN, as a KITTI file."""
    rng = np.random.default_rng(7)
    around, up = rng.uniform(0, 2 * np.pi, 20000), rng.uniform(-0.4, 0.1, 20000)
    rays = np.c_[np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)]
    ranges = np.minimum(1.7 / np.maximum(-rays[:, 2], 1e-6), 9 / np.abs(rays[:, :2]).max(axis=1)) + rng.normal(0, 0.02, 20000)
    empty = rng.random(20000) < 0.2
    points = np.where(empty[:, None], 0, rays * ranges[:, None]).astype(np.float32).astype(dtype)
    as_points, counted = pf.denoise(points, return_report=True)
    left_out, told = pf.denoise(np.where(empty[:, None], np.nan, points).astype(dtype), return_report=True)
    assert same_bits(as_points[~empty], left_out[~empty]) and (as_points[~empty] != points[~empty]).any()
    assert (as_points[empty] == 0).all()  # one place, with nothing near it
    assert counted.unmoved.non_finite == 0 and told.unmoved.non_finite == empty.sum()
    assert counted.unmoved.too_few_neighbors == empty.sum() and told.unmoved.too_few_neighbors == 0
    np.c_[points, points[:, 2]].astype(np.float32).tofile(tmp_path / "turn.bin")
    of_file = pf.read(tmp_path / "turn.bin", format="kitti").denoise().xyz
    assert np.isnan(of_file[empty]).all()
    if dtype == np.float32:
        assert same_bits(of_file[~empty], left_out[~empty])


def test_files_and_batches_take_rows_and_say_how():
    for call in (pf.Cloud, lambda points: pf.denoise_batch([points])):
        with pytest.raises(pf.UsageError, match=r"reshape\(-1, 3\)"):
            call(image(np.float32))
