# SPDX-License-Identifier: Apache-2.0
"""Pipelines, batches, reports, limits."""
import copy
import pathlib
import pickle
import subprocess
import sys

import numpy as np
import pytest
from clouds import same_bits, waves

import pointfair as pf

POINTS = waves()


def stages(pipeline):
    return [stage.name for stage in pipeline.report.stages]


def test_a_run_repeats_only_what_changed():
    pipeline = pf.Pipeline("cpu")
    pipeline.load(POINTS)
    first = pipeline.run(k=12, iterations=1, similarity_sigma=0.03)
    second = pipeline.run(k=12, iterations=1, similarity_sigma=0.02)
    assert "neighbors" not in stages(pipeline) and "fairing" in stages(pipeline)
    assert same_bits(first, pf.denoise(POINTS, k=12, iterations=1, similarity_sigma=0.03))
    assert same_bits(second, pf.denoise(POINTS, k=12, iterations=1, similarity_sigma=0.02))


def test_frames_with_parameters_resolved_once():
    pipeline = pf.Pipeline("cpu")
    pipeline.load(POINTS)
    params = pipeline.resolve()
    assert params.noise == pipeline.estimates().noise and isinstance(params.radius, float)
    frame = waves(2500, seed=2, dtype=np.float32)
    pipeline.load(frame)
    out = np.empty_like(frame)
    assert pipeline.run(params, out=out) is out
    assert same_bits(out, pf.denoise(frame, params))
    assert len(pipeline) == 2500 and "2500 points" in repr(pipeline)


def test_notes_are_those_of_the_last_run():
    rng = np.random.default_rng(1)
    cube = 1000 * rng.random((300, 3))
    pipeline = pf.Pipeline("cpu")
    pipeline.load(POINTS)
    pipeline.run()
    assert pipeline.notes() == []
    pipeline.run(min_neighbors=48)
    assert pipeline.notes() == []  # given, not chosen
    with pytest.raises(pf.UsageError, match="moved is a str: give how far points moved"):
        pipeline.notes("far")
    pipeline.load(cube)
    moved = np.linalg.norm(pipeline.run() - cube, axis=1)
    told = [note for note in pipeline.notes(moved) if "large against the cloud" in note]
    assert len(told) == 1 and f"{moved.max():.4g}" in told[0]


def test_floats_that_lost_their_digits_far_from_0_are_noted():
    rng = np.random.default_rng(1)
    far = np.c_[20 * rng.random((3000, 2)), rng.normal(0, 0.03, 3000)] + (500_000, 5_800_000, 0)
    pipeline = pf.Pipeline("cpu")
    for points, told in ((far.astype(np.float32), True), (far, False), (far.astype(np.float32) - np.float32((5e5, 58e5, 0)), False)):
        pipeline.load(points)
        pipeline.run()
        assert any("32-bit floats, which lie 0.5 apart" in note for note in pipeline.notes()) == told


def test_a_loaded_array_may_change_afterwards():
    for points in (POINTS.copy(), POINTS.astype(np.float32), np.c_[POINTS, POINTS[:, 0]]):
        pipeline = pf.Pipeline("cpu")
        pipeline.load(points)
        before, expected = points.copy(), pf.denoise(points, k=10, strength=0.5)
        points[...] = 0
        assert same_bits(pipeline.run(k=10, strength=0.5), expected)
        assert same_bits(pipeline.run(k=10, mask=np.zeros(len(points), bool)), before)


def test_a_pipeline_says_when_there_is_nothing_to_run():
    pipeline = pf.Pipeline("cpu")
    with pytest.raises(pf.UsageError, match="call load first"):
        pipeline.run()
    pipeline.load(POINTS)
    with pytest.raises(pf.UsageError):
        pipeline.normals()


NOTHING_TO_MEASURE = {
    "invalid": np.full((500, 3), np.nan), "empty": np.empty((0, 3), np.float32), "one place": np.ones((500, 3), np.float32),
    "one point": np.ones((1, 3)), "three points": np.eye(3), "a line": np.linspace(0, 1, 300)[:, None] * (1.0, 2.0, 3.0)}


@pytest.mark.parametrize("points", NOTHING_TO_MEASURE.values(), ids=NOTHING_TO_MEASURE)
def test_no_parameters_are_resolved_where_nothing_can_be_measured(points):
    pipeline = pf.Pipeline("cpu")
    pipeline.load(points)
    for parameters in ({}, {"k": 16}):
        with pytest.raises(pf.UsageError, match="nothing to measure in this cloud.*resolve the parameters on a cloud"):
            pipeline.resolve(**parameters)
    given = {"k": 8, "iterations": 1, "noise": 0.01, "normal_sigma": 0.1, "closeness_sigma": 0.1, "similarity_sigma": 0.03}
    assert pipeline.resolve(**given).noise == 0.01
    assert same_bits(pipeline.run(), points) and pipeline.estimates().points == len(points)
    pipeline.load(POINTS)
    assert same_bits(pipeline.run(pipeline.resolve()), pf.denoise(POINTS, pipeline.resolve()))


@pytest.mark.parametrize("points", NOTHING_TO_MEASURE.values(), ids=NOTHING_TO_MEASURE)
def test_there_is_a_report_where_nothing_can_be_measured(points):
    lengths = ["noise", "radius", "normal_sigma", "closeness_sigma", "similarity_sigma", "rho", "delta", "outlier_distance",
               "outlier_radius", "displacement_limit"]
    for name in lengths:
        for length in ("1%", "2s"):
            for more in ({}, {"constraint": True, "k": 12}, {"outliers": "mark"}):
                result, report = pf.denoise(points, return_report=True, **{name: length}, **more)
                assert same_bits(result, points) and report.points == len(points)
                assert pf.denoise_batch([points], return_report=True, **{name: length}, **more)[1][0].params == report.params


def test_a_pipeline_that_holds_no_cloud_says_so_everywhere():
    pipeline = pf.Pipeline("cpu")
    assert len(pipeline) == 0 and "no cloud" in repr(pipeline)
    for call in (pipeline.run, pipeline.resolve, pipeline.estimates, pipeline.normals, pipeline.noise,
                 lambda: pipeline.set_noise(None), lambda: pipeline.set_noise(np.ones(5)), lambda: pipeline.set_viewpoint((0, 0, 0)),
                 lambda: pipeline.run(mask=np.ones(5, bool))):
        with pytest.raises(pf.UsageError, match="the pipeline holds no cloud: call load first"):
            call()


@pytest.mark.parametrize("refused, arguments", [
    (POINTS.astype(int), {}), (POINTS[:, :2], {}), ("points", {}), (POINTS, {"ignore": "kind=0"}),
    (pf.Cloud(POINTS), {"ignore": "kind=0"}), (pf.Cloud(POINTS), {"ignore": "kind"}), (pf.Cloud(POINTS), {"ignore": 3})])
@pytest.mark.parametrize("held", [POINTS, np.c_[POINTS, POINTS[:, 0]].astype(np.float32), pf.Cloud(POINTS)])
def test_a_load_that_is_refused_leaves_everything_as_it_was(held, refused, arguments):
    pipeline = pf.Pipeline("cpu")
    pipeline.load(held)
    before, estimates = pipeline.run(k=8), pipeline.estimates()
    with pytest.raises(pf.UsageError):
        pipeline.load(refused, **arguments)
    after = pipeline.run(k=8)
    assert same_bits(after.xyz, before.xyz) if isinstance(held, pf.Cloud) else same_bits(after, before)
    assert len(pipeline) == 3000 and pipeline.estimates() == estimates


def test_a_load_that_fails_on_the_way_leaves_no_cloud():
    code = """if True:
        import resource, numpy as np, pointfair as pf
        pipeline = pf.Pipeline("cpu", threads=1)
        pipeline.load(np.random.default_rng(1).random((1000, 3)))
        pipeline.run(k=8)
        many = np.zeros((30_000_000, 3), np.float32) + np.float32(1e6)
        now = next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmSize")) * 1024
        resource.setrlimit(resource.RLIMIT_AS, (now + (64 << 20), resource.RLIM_INFINITY))
        try:
            pipeline.load(many)
        except pf.OutOfMemory:
            print(len(pipeline), repr(pipeline))
        for call in (pipeline.run, pipeline.resolve, pipeline.estimates):
            try:
                call()
            except pf.UsageError as error:
                print(error)
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines() == ["0 <pointfair.Pipeline on cpu, no cloud>", *["the pipeline holds no cloud: call load first"] * 3]


def test_normals_are_of_unit_length_and_of_the_surface():
    smooth, report = pf.denoise(POINTS, normals=True, return_report=True)
    slope = 0.6 * np.cos(6 * smooth[:, 0])
    expected = np.c_[-slope, np.zeros(len(smooth)), np.ones(len(smooth))] / np.sqrt(1 + slope**2)[:, None]
    assert np.abs(np.linalg.norm(report.normals, axis=1) - 1).max() < 1e-5
    assert np.median(np.abs((report.normals * expected).sum(1))) > 0.98
    with pytest.raises(pf.UsageError, match="return_report=True"):
        pf.denoise(POINTS, normals=True)


def test_the_noise_at_each_point_is_told_and_given():
    rng = np.random.default_rng(3)
    right = rng.random(20000) < 0.5
    truth = np.where(right, 0.004, 0.001)
    points = np.c_[right * 0.5 + rng.random(20000) * 0.5, rng.random(20000), rng.normal(0, 1, 20000) * truth]
    points[7, 1] = np.nan
    apart = np.abs(points[:, 0] - 0.5) > 0.1
    pipeline = pf.Pipeline("cpu")
    pipeline.load(points)
    noise = pipeline.noise()
    assert noise.dtype == np.float32 and noise.shape == (20000,) and np.flatnonzero(np.isnan(noise)).tolist() == [7]
    ratio = noise[apart] / truth[apart]
    assert np.nanmean((ratio > 0.8) & (ratio < 1.25)) > 0.9
    estimated = pipeline.estimates().noise
    assert np.allclose(pipeline.noise(noise=3 * estimated), 3 * noise, rtol=1e-5, equal_nan=True)
    automatic = pipeline.run()
    for sigmas in (truth, truth.astype(np.float32), truth.astype(">f8")):
        pipeline.set_noise(sigmas)
        assert np.nanmax(np.abs(pipeline.noise()[apart] / truth[apart] - 1)) < 0.02
        assert pipeline.estimates().noise == pytest.approx(np.median(truth), rel=1e-6)
    assert not same_bits(pipeline.run(), automatic)
    pipeline.set_noise(None)
    assert pipeline.estimates().noise == estimated and same_bits(pipeline.run(), automatic)


@pytest.mark.parametrize("sigmas, advice", [
    (np.ones(5), "shape"), (np.zeros(3000), "positive"), (np.full(3000, np.nan), "positive"), ([0.01], "array"),
    (np.ones((3000, 1)), "shape"), (np.ones(3000, bool), "type"), (np.ones(3000, complex), "type"), (0.01, "one for each of the 3000 points.*noise=0.01"),
])
def test_a_noise_that_is_none_is_refused(sigmas, advice):
    pipeline = pf.Pipeline("cpu")
    pipeline.load(POINTS)
    with pytest.raises(pf.UsageError, match=advice):
        pipeline.set_noise(sigmas)


def test_a_cloud_goes_through_a_pipeline():
    pipeline = pf.Pipeline("cpu")
    pipeline.load(pf.Cloud(POINTS))
    result = pipeline.run(k=10, strength=0.5)
    assert isinstance(result, pf.Cloud) and same_bits(result.xyz, pf.denoise(POINTS, k=10, strength=0.5))
    with pytest.raises(pf.UsageError, match="out="):
        pipeline.run(out=POINTS)


def test_masked_points_move_and_the_others_count_as_neighbours():
    mask = POINTS[:, 0] < 0.5
    for dtype in (np.float32, np.float64):
        points = POINTS.astype(dtype)
        whole, part = pf.denoise(points, k=10), pf.denoise(points, k=10, mask=mask)
        assert same_bits(part[mask], whole[mask]) and same_bits(part[~mask], points[~mask])
    box = ((-1, -1, -1), (0.5, 2, 1))
    assert same_bits(pf.denoise(points, k=10, box=box)[mask], whole[mask])
    both = pf.denoise(points, k=10, box=box, mask=points[:, 1] < 0.5)
    inside = mask & (points[:, 1] < 0.5)
    assert same_bits(both[inside], whole[inside]) and same_bits(both[~inside], points[~inside])


def test_strength_blends():
    whole, half = pf.denoise(POINTS, k=10), pf.denoise(POINTS, k=10, strength=0.5)
    assert np.abs(half - (whole + POINTS) / 2).max() < 1e-6
    assert same_bits(pf.denoise(POINTS, k=10, strength=0), POINTS)


@pytest.mark.parametrize("arguments, advice", [
    ({"mask": np.ones(5, bool)}, "mask has the shape"), ({"mask": np.ones(3000)}, "booleans"), ({"mask": [True]}, r"numpy.asarray\(mask, bool\)"),
    ({"strength": 2}, "strength"), ({"strength": "x"}, "strength"), ({"strength": np.nan}, "strength"), ({"box": 3}, "box"),
    ({"box": ((0, 0, 0), (1, 1, -1))}, "box"), ({"box": ((0, 0, np.nan), (1, 1, 1))}, "box"), ({"device": "gpu"}, "device"),
    ({"device": 3}, "device"), ({"device": "\ud800"}, "device"), ({"device": []}, "device"), ({"device": "cuda:x"}, "device"), ({"threads": -1}, "threads"), ({"threads": 1.5}, "threads"),
    ({"threads": True}, "threads"), ({"threads": 1.0}, "threads"), ({"threads": np.ones(2, int)}, "threads"), ({"progress": 3}, "progress"), ({"params": {"k": 3}}, "Params"),
])
def test_a_wrong_argument_is_refused_with_what_to_give(arguments, advice):
    pf.denoise(POINTS, threads=1)  # whose pipeline waits for the next call
    with pytest.raises(pf.UsageError, match=advice):
        pf.denoise(POINTS, **arguments)


def test_a_card_that_is_not_there_is_a_device_error():
    cards = [status for status in pf.devices() if status.info.kind == "cuda" and status.usable]
    assert pf.devices()[0].info.kind == "cpu" and pf.devices()[0].usable
    with pytest.raises(pf.DeviceError):
        pf.Pipeline(f"cuda:{len(cards)}")


def test_reports_survive_pickling_and_have_nothing_left_to_choose():
    smooth, report = pf.denoise(POINTS, normals=True, outliers="mark", device="cpu", return_report=True)
    again = pickle.loads(pickle.dumps(report))
    assert again == report and same_bits(again.normals, report.normals)
    assert abs(report.noise - 0.01) < 0.003 and report.points == 3000 and report.tiles == 1
    assert report.params.noise == report.noise and report.params.iterations >= 1
    assert report.device.kind == "cpu" and report.milliseconds > 0 and report.peak_host_bytes > 0
    chosen = report.params.changed()
    assert {"noise", "radius", "similarity_sigma", "iterations", "displacement_limit"} <= set(chosen) and "auto" not in chosen.values()
    assert same_bits(pf.denoise(POINTS, outliers="mark"), smooth)


def test_pipelines_and_clouds_say_what_to_send_to_another_process():
    with pytest.raises(TypeError, match="make one in each process"):
        pickle.dumps(pf.Pipeline("cpu"))
    with pytest.raises(TypeError, match="make one in each process"):
        copy.copy(pf.Pipeline("cpu"))  # both would change one cloud
    with pytest.raises(TypeError, match="pass the path"):
        pickle.dumps(pf.Cloud(POINTS))


def test_estimates_are_in_the_coordinates_of_the_array():
    centre = np.array([500000.0, 5.8e6, 100.0])
    found = pf.estimate(POINTS + centre)
    assert np.abs(np.array(found.min) - (POINTS.min(0) + centre)).max() < 1e-5
    assert np.abs(np.array(found.max) - (POINTS.max(0) + centre)).max() < 1e-5
    assert found.noise_quantiles == tuple(sorted(found.noise_quantiles)) and found.noise_quantiles[0] > 0
    assert found.points == found.finite == 3000 and abs(found.noise - 0.01) < 0.003
    assert pf.estimate(pf.Cloud(POINTS)) == pf.estimate(POINTS)


BATCH = [waves(count, seed=count, dtype=dtype) for count, dtype in
         ((500, np.float32), (0, np.float32), (700, np.float64), (3, np.float64), (500, np.float32))]


@pytest.mark.parametrize("arguments", [{}, {"k": 9, "noise": 0.01}, {"params": pf.Params.paper()}])
def test_a_batch_is_a_call_for_each(arguments):
    for threads in (0, 1):
        results, reports = pf.denoise_batch(BATCH, threads=threads, return_report=True, **arguments)
        for given, result, report in zip(BATCH, results, reports):
            single, its_report = pf.denoise(given, return_report=True, **arguments)
            assert same_bits(result, single)
            assert report.points == len(given) and report.params == its_report.params


def test_batches_of_one_array():
    clouds = np.stack([waves(300, seed=i) for i in range(4)])
    expected = [pf.denoise(cloud, k=9) for cloud in clouds]
    assert same_bits(pf.denoise_batch(clouds, k=9), np.stack(expected))
    packed = pf.denoise_batch(clouds.reshape(-1, 3), offsets=[0, 300, 600, 900, 1200], k=9)
    assert same_bits(packed, np.concatenate(expected))
    assert pf.denoise_batch([]) == [] and pf.denoise_batch(np.empty((0, 5, 3))).shape == (0, 5, 3)


@pytest.mark.parametrize("clouds, arguments, error, advice", [
    (np.zeros((5, 3)), {}, pf.UsageError, "offsets"), (np.zeros((5, 3)), {"offsets": [0, 4]}, pf.UsageError, "offsets must"),
    (np.zeros((5, 3)), {"offsets": [0, 4, 3, 5]}, pf.UsageError, "must not decrease"),
    (np.zeros((5, 3)), {"offsets": [0.0, 5.0]}, pf.UsageError, "whole numbers"),
    (np.zeros((5, 3)), {"offsets": []}, pf.UsageError, "whole numbers"),
    (np.zeros((5, 3)), {"offsets": [[0, 1], [2]]}, pf.UsageError, "whole numbers"),
    ([np.zeros((5, 3)), np.zeros((5, 2))], {}, pf.UsageError, r"clouds\[1\] has"), ([np.zeros((5, 3)), 7], {}, pf.UsageError, r"clouds\[1\] is an int"),
    ([pf.Cloud(np.zeros((5, 3)))], {}, pf.UsageError, r"clouds\[0\]\.xyz"), ((np.zeros((5, 3)) for _ in range(2)), {}, pf.UsageError, r"list\(clouds\)"),
    ([np.zeros((5, 3))], {"offsets": [0, 5]}, pf.UsageError, "leave them out"),
    ([np.zeros((5, 3))], {"device": "cuda:99"}, pf.DeviceError, "CUDA"),
])
def test_batches_that_cannot_be_are_refused(clouds, arguments, error, advice):
    with pytest.raises(error, match=advice):
        pf.denoise_batch(clouds, **arguments)


def test_weights_of_the_method_learned(tmp_path):
    own = pathlib.Path(__file__).resolve().parents[2] / "src" / "learned" / "weights.bin"
    expected = pf.denoise(POINTS, method="learned")
    assert not same_bits(expected, pf.denoise(POINTS))
    assert same_bits(expected, pf.denoise(POINTS, method="learned", weights=own))
    assert same_bits(expected, pf.Cloud(POINTS).denoise(method="learned", weights=str(own)).xyz)
    content = own.read_bytes()
    other = bytearray(content)
    other[24:28] = np.float32(.5).tobytes()  # steps of half a noise at most
    held = pf.denoise(POINTS, method="learned", weights=bytes(other))
    assert not same_bits(expected, held) and same_bits(expected, pf.denoise(POINTS, method="learned"))
    pipeline = pf.Pipeline("cpu", weights=bytes(other))
    for _ in range(2):  # of all clouds
        pipeline.load(POINTS)
        assert same_bits(held, pipeline.run(method="learned"))
    cut = tmp_path / "cut.bin"
    cut.write_bytes(content[:1000])
    for weights, message in ((cut, "cut.bin: the file of weights has 1000 bytes"), (b"x" * 50, "weights: this is no file"),
                             (b"", "weights: this is no file"), (tmp_path / "none.bin", "none.bin: cannot be read: No such")):
        with pytest.raises(pf.FileError, match=message):
            pf.denoise(POINTS, weights=weights)
    with pytest.raises(pf.UsageError, match="weights is an int: give a file's path"):
        pf.Pipeline("cpu", weights=3)
