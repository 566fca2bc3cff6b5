# SPDX-License-Identifier: Apache-2.0
"""Arrays on a card. Without a card: what is refused, and with which sentence. With one and torch or CuPy: the bits of
NumPy, in place, on the caller's stream."""
import numpy as np
import pytest
from clouds import same_bits, waves

import pointfair as pf
from pointfair import _card

POINTS = waves(3000)
CARD = any(device.info.kind == "cuda" and device.usable for device in pf.devices())
needs_card = pytest.mark.skipif(not CARD, reason="no CUDA card can be used")


class OnCard:
    """An array that says it lies on a card; its memory is NumPy's."""

    def __init__(self, array, card=0):
        self.array, self.card = array, card
        self.shape, self.dtype = array.shape, array.dtype

    def __dlpack_device__(self):
        return (2, self.card)

    @property
    def __cuda_array_interface__(self):
        interface = dict(self.array.__array_interface__)
        return {**interface, "version": 3, "stream": None}

    def __getitem__(self, key):
        return OnCard(self.array[key], self.card)

    def __setitem__(self, key, value):
        self.array[key] = value.array if isinstance(value, OnCard) else value


@pytest.mark.parametrize("points, sentence", [
    (np.zeros((5, 3), np.int32), "has the type int32: give float32 or float64"),
    (np.zeros((5, 2), np.float32), r"has the shape \(5, 2\)"),
    (np.zeros((5, 3, 3), np.float32), r"has the shape \(5, 3, 3\)"),
])
def test_what_holds_no_positions_is_refused(points, sentence):
    with pytest.raises(pf.UsageError, match=sentence):
        pf.denoise(OnCard(points))


def test_what_does_not_belong_together_is_refused():
    points = OnCard(POINTS)
    with pytest.raises(pf.UsageError, match="lies on cuda:0 and device is 'cpu'"):
        pf.denoise(points, device="cpu")
    with pytest.raises(pf.UsageError, match="mask, box and strength"):
        pf.denoise(points, strength=0.5)
    with pytest.raises(pf.UsageError, match="need a Cloud"):
        pf.denoise(points, where="class=2")
    layout = _card.CardLayout(points)
    with pytest.raises(pf.UsageError, match="out lies in host memory"):
        layout.check_out(POINTS)
    with pytest.raises(pf.UsageError, match="they must agree"):
        layout.check_out(OnCard(POINTS[1:]))
    with pytest.raises(pf.UsageError, match="on cuda:1"):
        layout.check_out(OnCard(POINTS, 1))
    layout.check_out(OnCard(POINTS.copy()))


def test_a_gradient_is_refused():
    points = OnCard(POINTS)
    points.requires_grad = True
    with pytest.raises(pf.UsageError, match="requires a gradient"):
        pf.denoise(points)


@pytest.mark.skipif(CARD, reason="there is a card")
def test_without_a_card_the_reason_is_told():
    with pytest.raises(pf.DeviceError, match="cannot be used|not built with CUDA"):
        pf.denoise(OnCard(POINTS))
    with pytest.raises(pf.UsageError, match="computes on the CPU"):
        pf.Pipeline("cpu").load(OnCard(POINTS))


def test_a_kind_that_cannot_be_made_asks_for_out():
    with pytest.raises(pf.DeviceError, match="give out="):
        _card.empty_like(OnCard(POINTS))


def test_a_fourth_column_goes_to_the_result():
    like, out = OnCard(np.c_[POINTS, np.arange(len(POINTS))].astype(np.float32)), OnCard(np.zeros((len(POINTS), 4), np.float32))
    result = _card.CardResult(_card.CardLayout(like), like, out, 1)
    assert (result.array.array[:, 3] == like.array[:, 3]).all()


def packages():
    """(to the card, to NumPy, streams, synchronise) of the packages that are there."""
    found = {}
    if not CARD:
        return found
    try:
        import torch
        if torch.cuda.is_available():
            found["torch"] = (lambda a: torch.from_numpy(a.copy()).cuda(), lambda t: t.cpu().numpy())
    except ImportError:
        pass
    try:
        import cupy
        found["cupy"] = (lambda a: cupy.asarray(a), lambda t: t.get())
    except ImportError:
        pass
    return found


PACKAGES = packages()


@needs_card
@pytest.mark.parametrize("name", PACKAGES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("offset", [0, 4.5e5])
@pytest.mark.parametrize("params", [{}, {"k": 8}])
def test_tensors_have_the_bits_of_numpy(name, dtype, offset, params):
    to_card, to_numpy = PACKAGES[name]
    points = (POINTS + offset).astype(dtype)
    expected = pf.denoise(points, device="cuda", **params)
    tensor = to_card(points)
    result = pf.denoise(tensor, **params)
    assert type(result) is type(tensor) and result.dtype == tensor.dtype and result.device == tensor.device
    assert same_bits(to_numpy(result), expected) and same_bits(to_numpy(tensor), points)
    wide = to_card(np.c_[points, np.arange(len(points))].astype(dtype))
    assert same_bits(to_numpy(pf.denoise(wide, **params))[:, :3], expected)
    strided = to_card(np.asfortranarray(points)).T.T if name == "cupy" else to_card(np.ascontiguousarray(points.T)).T
    assert same_bits(np.ascontiguousarray(to_numpy(pf.denoise(strided, **params))), expected)
    assert pf.denoise(tensor, out=tensor, **params) is tensor
    assert same_bits(to_numpy(tensor), expected)


@needs_card
@pytest.mark.parametrize("name", PACKAGES)
def test_a_pipeline_streams_tensors(name):
    to_card, to_numpy = PACKAGES[name]
    pipeline, reference = pf.Pipeline("cuda:0"), pf.Pipeline("cuda:0")
    pipeline.load(to_card(POINTS))
    params = pipeline.resolve()
    for seed in range(3):
        points = waves(2000 + 100 * seed, seed=seed).astype(np.float32)
        pipeline.load(to_card(points))
        reference.load(points)
        assert same_bits(to_numpy(pipeline.run(params)), reference.run(params))
        normals = to_card(np.zeros_like(points))
        assert same_bits(to_numpy(pipeline.normals(normals)), reference.normals())
    smooth, report = pf.denoise(to_card(POINTS), return_report=True, normals=True)
    assert report.points == len(POINTS) and report.normals.shape == POINTS.shape
    assert pf.estimate(to_card(POINTS)).points == len(POINTS)


@needs_card
@pytest.mark.skipif("torch" not in PACKAGES, reason="torch is not there")
def test_the_current_stream_orders_the_call():
    import torch
    base = torch.from_numpy(POINTS.astype(np.float32)).cuda()
    expected = pf.denoise(base, k=8)
    for _ in range(5):
        stream = torch.cuda.Stream()
        tensor, late = torch.zeros_like(base), torch.zeros_like(base)
        torch.cuda.synchronize()
        with torch.cuda.stream(stream):
            torch.cuda._sleep(200_000_000)
            tensor.copy_(base)
            result = pf.denoise(tensor, k=8)
            late.copy_(result)
        stream.synchronize()
        assert torch.equal(torch.nan_to_num(late), torch.nan_to_num(expected))
    with pytest.raises(pf.UsageError, match="requires a gradient"):
        pf.denoise(base.clone().requires_grad_())
    with pytest.raises(pf.UsageError, match="type float16"):
        pf.denoise(base.half())


@needs_card
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("offset", [0, 4.5e5])
@pytest.mark.parametrize("params", [{}, {"k": 8}, {"k": 8, "normal_sigma": 0.2, "closeness_sigma": 0.1, "similarity_sigma": 0.03}])
def test_batches_on_the_card_have_the_bits_of_single_calls(dtype, offset, params):
    clouds = [waves(size, seed=size, dtype=dtype, centre=(offset if size % 2 else 0, 0, 0)) for size in (0, 3, 300, 1024, 1025, 5001)]
    results = pf.denoise_batch(clouds, device="cuda", **params)
    for cloud, result in zip(clouds, results):
        assert same_bits(result, pf.denoise(cloud, device="cuda", **params))
    with_reports, reports = pf.denoise_batch(clouds, device="cuda", return_report=True, **params)
    assert [report.points for report in reports] == [len(cloud) for cloud in clouds]
    assert all(same_bits(a, b) for a, b in zip(with_reports, results))


@needs_card
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("params", [{}, {"k": 8}])
def test_clouds_too_wide_for_floats_have_the_bits_of_the_cpu_also_in_a_batch(params, dtype):
    near, far = waves(3000, seed=1, dtype=dtype), waves(3000, seed=2, dtype=dtype, centre=(3e5, 1e5, 0))
    clouds = [near, np.concatenate([near, far]), far]
    results = pf.denoise_batch(clouds, device="cuda", **params)
    for cloud, result in zip(clouds, results):
        assert same_bits(result, pf.denoise(cloud, device="cuda", **params))
        assert same_bits(result, pf.denoise(cloud, device="cpu", **params))
    assert same_bits(pf.denoise_batch(clouds[1:2], device="cuda", **params)[0], results[1])


@needs_card
@pytest.mark.parametrize("name", PACKAGES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("params", [{"k": 8}, {"k": 8, "normal_sigma": 0.2, "closeness_sigma": 0.1, "similarity_sigma": 0.03}])
def test_batches_of_tensors_stay_on_the_card(name, dtype, params):
    to_card, to_numpy = PACKAGES[name]
    sizes = (0, 3, 300, 1024, 1025, 5001, 700)
    clouds = [waves(size, seed=size, dtype=dtype, centre=(4.5e5 if size == 300 else 0, 0, 0)) for size in sizes]
    expected = [pf.denoise(cloud, device="cuda", **params) for cloud in clouds]
    results = pf.denoise_batch([to_card(cloud) for cloud in clouds], **params)
    assert all(type(result) is type(to_card(clouds[1])) for result in results)
    assert all(same_bits(to_numpy(result), its) for result, its in zip(results, expected))
    packed = pf.denoise_batch(to_card(np.concatenate(clouds)), offsets=np.cumsum([0, *sizes]), **params)
    assert same_bits(to_numpy(packed), np.concatenate(expected))
    stack = np.stack([waves(900, seed=seed, dtype=dtype) for seed in range(4)])
    moved = pf.denoise_batch(to_card(stack), **params)
    assert same_bits(to_numpy(moved), np.stack([pf.denoise(cloud, device="cuda", **params) for cloud in stack]))
    with pytest.raises(pf.UsageError, match="leave return_report out"):
        pf.denoise_batch(to_card(stack), return_report=True)
