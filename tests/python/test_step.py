# SPDX-License-Identifier: Apache-2.0
"""Methods of one's own: the library's Laplacian step again in NumPy, what a step is given, and what limits do."""
import numpy as np
import pytest
from clouds import same_bits, waves

import pointfair as pf

POINTS = waves(2000)
SIGMA, RELAXATION = 0.03, 0.5


def laplacian(points, neighbors, normals, noise):
    """docs/methods.md, equations 11 and 12, with the closeness sigma SIGMA."""
    offsets = points[neighbors] - points[:, None]
    weights = np.exp(-(offsets**2).sum(axis=2) / (2 * SIGMA**2))
    return points + RELAXATION * (weights[..., None] * offsets).sum(axis=1) / weights.sum(axis=1)[:, None]


@pytest.mark.parametrize("iterations", [1, 3])
def test_a_laplacian_step_gives_what_the_method_gives(iterations):
    expected = pf.denoise(POINTS, method="laplacian", k=12, closeness_sigma=SIGMA, relaxation=RELAXATION, iterations=iterations,
                          outliers="off", displacement_limit=100)
    result = pf.denoise(POINTS, step=laplacian, k=12, iterations=iterations)
    moved = np.abs(expected - POINTS).max()
    assert moved > 0.01 and np.abs(result - expected).max() < 1e-4 * moved


def test_the_result_of_a_step_has_the_memory_order_of_the_points():
    points = np.asfortranarray(np.column_stack([POINTS, POINTS[:, 0]]))
    result = pf.denoise(points, step=laplacian)
    assert result.flags.f_contiguous and same_bits(result, pf.denoise(np.ascontiguousarray(points), step=laplacian))


def test_a_step_gets_neighbors_normals_and_noise():
    seen = []

    def step(points, neighbors, normals, noise):
        seen.append((points, neighbors, normals, noise))
        return points

    points = POINTS + (500000, 0, 0)
    assert same_bits(pf.denoise(points, step=step, iterations=2), points)
    assert len(seen) == 2
    moved, neighbors, normals, noise = seen[0]
    assert neighbors.shape == (2000, 24) and noise.shape == (2000,) and 0.005 < np.median(noise) < 0.02
    assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-5 and np.abs(normals[:, 2]).mean() > 0.8
    squares = ((moved[:, None] - moved[None]) ** 2).sum(axis=2)
    np.fill_diagonal(squares, np.inf)
    nearest = np.sort(squares, axis=1)[:, :24]
    assert np.allclose(np.take_along_axis(squares, neighbors, 1), nearest, atol=1e-7)


def test_images_invalid_pixels_and_what_is_not_finite_keep_their_place():
    points = POINTS.astype(np.float32).reshape(40, 50, 3)
    points[3, 5:9], points[20:24, 10] = np.nan, 0
    invalid = np.zeros((40, 50), bool)
    invalid[3, 5:9] = invalid[20:24, 10] = True

    def step(rows, neighbors, normals, noise):
        assert len(rows) == 1992 and (neighbors >= 0).all() and neighbors.max() < 1992
        moved = rows + (0, 0, 1)
        moved[7] = np.nan
        return moved

    result = pf.denoise(points, step=step)
    assert result.dtype == np.float32 and same_bits(result[invalid], points[invalid])
    assert same_bits(result[0, 7], points[0, 7])
    invalid[0, 7] = True
    assert np.allclose(result[~invalid], points[~invalid] + (0, 0, 1), atol=1e-6)


@pytest.mark.parametrize("step", [lambda points, *more: np.full_like(points, np.nan), lambda points, *more: points.copy()], ids=["NaN", "same"])
@pytest.mark.parametrize("offset", [0, 5, 1e6 / 3])
def test_points_that_a_step_leaves_keep_their_bits(step, offset):
    points = POINTS * (20, 20, 1) + offset
    points[::7, 2] = -0.0
    for given in (points, points.astype(np.float32)):
        assert same_bits(pf.denoise(given, step=step), given)
        assert same_bits(pf.denoise(given, step=step, strength=0.3), given)
        assert same_bits(pf.denoise(given, step=lambda rows, *more: rows + 1, strength=0), given)


def test_limits_act_on_the_result_as_in_other_runs():
    mask, box = POINTS[:, 1] < 0.5, ((0, 0, -1), (0.5, 1, 1))
    full = pf.denoise(POINTS, step=laplacian, k=12)
    half = pf.denoise(POINTS, step=laplacian, k=12, mask=mask, box=box, strength=0.5)
    inside = mask & (POINTS[:, 0] <= 0.5)
    assert same_bits(half[~inside], POINTS[~inside])
    assert np.allclose(half[inside], (POINTS[inside] + full[inside]) / 2, atol=1e-12)
    cloud = pf.Cloud(POINTS, {"class": np.arange(2000, dtype=np.uint16)})
    moved = cloud.denoise(k=12), pf.denoise(cloud, step=laplacian, k=12)
    assert np.allclose(moved[1].xyz, full, atol=1e-12) and (moved[1]["class"] == np.arange(2000)).all()


@pytest.mark.parametrize("arguments, message", [
    (dict(step=3), "step is an int"), (dict(step=lambda *a: None), "step returned"), (dict(step=lambda p, *a: p[1:]), "step returned"),
    (dict(step=laplacian, return_report=True), "return_report does not go with step"),
    (dict(step=laplacian, viewpoint=(0, 0, 0)), "viewpoint does not go with step"),
])
def test_wrong_steps_are_refused(arguments, message):
    with pytest.raises(pf.UsageError, match=message):
        pf.denoise(POINTS, **arguments)


@pytest.mark.parametrize("points", [POINTS, POINTS.astype(np.float32).reshape(40, 50, 3), pf.Cloud(POINTS)], ids=["array", "image", "cloud"])
def test_a_pipeline_takes_a_step_and_keeps_its_cloud(points):
    pipeline = pf.Pipeline("cpu")
    pipeline.load(points)
    arguments = dict(k=12, iterations=2, strength=0.5, box=((0, 0, -1), (0.5, 1, 1)))
    first, second = pipeline.run(step=laplacian, **arguments), pipeline.run(step=laplacian, **arguments)
    expected = pf.denoise(points, step=laplacian, **arguments)
    as_array = [getattr(one, "xyz", one) for one in (first, second, expected)]
    assert same_bits(as_array[0], as_array[2]) and same_bits(as_array[1], as_array[2])
    assert type(first) is type(points) and len(pipeline.normals().reshape(-1, 3)) == 2000


def test_a_step_leaves_nothing_unread_that_a_pipeline_was_given():
    pipeline = pf.Pipeline("cpu")
    pipeline.load(POINTS)
    pipeline.set_viewpoint((0, 0, 5))
    with pytest.raises(pf.UsageError, match="viewpoint does not go with step"):
        pipeline.run(step=laplacian)
    pipeline.set_viewpoint(None)
    pipeline.set_noise(np.full(2000, 0.01))
    with pytest.raises(pf.UsageError, match="noise of each point does not go with step"):
        pipeline.run(step=laplacian)
    pipeline.load(POINTS)
    assert pipeline.run(step=laplacian, k=12).shape == (2000, 3)
    with pytest.raises(pf.UsageError, match="where does not go with step"):
        pipeline.run(step=laplacian, where="x > 1")


@pytest.mark.parametrize("count", [0, 1, 3, 4])
def test_few_points(count):
    assert pf.denoise(POINTS[:count], step=lambda points, *more: points + 1).shape == (count, 3)


def test_neighbors_of_points_far_from_each_other_are_right_or_refused():
    one_far = np.r_[POINTS, [[1e9, 0, 0]]]
    assert (pf.nearest_neighbors(one_far, 8)[:2000] == pf.nearest_neighbors(POINTS, 8)).all()
    halves = np.r_[POINTS, POINTS + (3e6, 0, 0)]
    with pytest.raises(pf.UsageError, match="does not tell their neighbours"):
        pf.nearest_neighbors(halves, 8)
    with pytest.raises(pf.UsageError, match="too wide for normals"):
        pf.denoise(halves, step=laplacian)
    stages: list[str] = []
    for cloud in (halves, pf.Cloud(halves)):
        with pytest.raises(pf.UsageError, match="too wide for normals"):
            pf.denoise(cloud, normals=True, return_report=True, progress=lambda share, stage: stages.append(stage))
    assert stages == []  # before the run
    grid = np.stack(np.meshgrid(*[np.arange(10) * 1e6] * 3), -1).reshape(-1, 3)  # wide, and as sparse
    assert (np.linalg.norm(grid[pf.nearest_neighbors(grid, 3)] - grid[:, None], axis=2) == 1e6).all()


def test_nearest_neighbors_of_points_that_are_not_finite():
    points = np.array([[0, 0, 0], [np.nan, 0, 0], [1, 0, 0], [3, 0, 0]], np.float32)
    assert pf.nearest_neighbors(points, 3).tolist() == [[2, 3, -1], [-1, -1, -1], [0, 3, -1], [2, 0, -1]]
    with pytest.raises(pf.UsageError, match="k cannot be 0"):
        pf.nearest_neighbors(points, 0)
