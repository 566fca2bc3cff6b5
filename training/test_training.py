#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The generator: rays against sums by hand, and of each family that its truth is true. Skipped (77) without numpy, scipy
or g++."""
import pathlib
import re
import shutil
import sys
import unittest

try:
    import numpy as np
    from scipy.spatial import cKDTree
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)
if not shutil.which("g++"):
    print("skipped: no g++ for rays.cpp")
    sys.exit(77)

import cameras
import errors
import families
import object_families
import rays
import shapes
import switches
import tables
from measure import Truth, agreement
from scene import Scene

try:
    sys.path.append(str(pathlib.Path(__file__).resolve().parent / "net"))
    import coarse
    import data
    import spec
    import torch
except ImportError:
    torch = None

ARRAYS = ("points", "clean", "normal", "surface", "edge", "part", "spacing", "vertices", "triangles")


def hits_by_hand(vertices, triangles, origin, directions):
    """Nearest range by the determinant of each triangle and ray."""
    best = np.full(len(directions), np.inf)
    for a, b, c in vertices[triangles]:
        for k, d in enumerate(directions):
            matrix = np.stack([b - a, c - a, -d], 1)
            if abs(np.linalg.det(matrix)) > 1e-12:
                u, v, t = np.linalg.solve(matrix, origin - a)
                if min(u, v, 1 - u - v) >= 0 and t > 0:
                    best[k] = min(best[k], t)
    return best


class Rays(unittest.TestCase):
    def test_first_hits_are_those_of_every_triangle_tried(self):
        rng = np.random.default_rng(1)
        vertices, triangles = rng.normal(size=(90, 3)), rng.permutation(90).reshape(-1, 3)
        directions = rng.normal(size=(60, 3))
        ranges, _, ids = rays.Caster(vertices, triangles).cast(np.zeros(3), directions)
        expected = hits_by_hand(vertices, triangles, np.zeros(3), directions)
        self.assertGreater(np.isfinite(expected).sum(), 10)
        np.testing.assert_allclose(ranges, expected, rtol=1e-9)
        np.testing.assert_array_equal(ids >= 0, np.isfinite(expected))

    def test_distance_to_a_box_is_that_of_its_formula(self):
        points = np.random.default_rng(2).uniform(-3, 3, (2000, 3))
        half = np.array([1, .5, .25])
        off = np.abs(points) - half
        expected = np.abs(np.linalg.norm(np.maximum(off, 0), axis=1) + np.minimum(off.max(1), 0))
        found = rays.Caster(*shapes.box(-half, half)).distance(points)
        np.testing.assert_allclose(found, expected, atol=1e-12)

    def test_spread_points_keep_their_distance_and_leave_no_gap(self):
        points = np.random.default_rng(3).random((5000, 3)) * [1, 1, 0]
        kept = points[rays.spread(points, .05)]
        self.assertGreaterEqual(cKDTree(kept).query(kept, 2)[0][:, 1].min(), .05)
        self.assertLess(cKDTree(kept).query(points)[0].max(), .05)


class Shapes(unittest.TestCase):
    def test_a_level_set_of_a_ball_has_its_size_and_faces_outwards(self):
        axes = [np.linspace(-1.2, 1.2, n) for n in (40, 45, 50)]
        field = np.linalg.norm(np.stack(np.meshgrid(*axes, indexing="ij"), -1), axis=-1) - 1
        vertices, triangles = shapes.level_set(field, axes)
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        self.assertTrue(((normal * (a + b + c)).sum(1) > 0).all())
        np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1, atol=2e-3)
        self.assertAlmostEqual(np.linalg.norm(normal, axis=1).sum() / 2 / (4 * np.pi), 1, delta=.005)
        self.assertAlmostEqual((a * normal).sum() / 6 / (4 / 3 * np.pi), 1, delta=.005)

    def test_points_inside_of_another_part_are_out_of_sight(self):
        scene = Scene()
        scene.add("object", shapes.joined([shapes.box([-1, -1, -1], [1, 1, 1]), shapes.box([0, -.5, -.5], [2, .5, .5])]))
        scene.finish()
        rng = np.random.default_rng(6)
        points, _ = cameras.surface_points(scene, rng, 4000)
        in_first = (np.abs(points) < 1 - 1e-6).all(1)
        within = in_first | (np.abs(points - [1, 0, 0]) < np.array([1, .5, .5]) - 1e-6).all(1)
        np.testing.assert_array_equal(object_families.in_sight(scene, rng, points)[within], False)
        self.assertGreater(object_families.in_sight(scene, rng, points)[~within].mean(), .99)


class Families(unittest.TestCase):
    def test_every_family_gives_a_cloud_whose_truth_is_true(self):
        for name, family in families.FAMILIES.items():
            with self.subTest(family=name):
                cloud = families.draw(name, 3)
                count = len(cloud.points)
                self.assertTrue(250 <= count <= 320_000, count)
                for array in ("clean", "normal"):
                    self.assertEqual(getattr(cloud, array).shape, (count, 3))
                for array in ("points", "clean", "normal", "spacing", "vertices"):
                    self.assertTrue(np.isfinite(getattr(cloud, array)).all(), array)
                self.assertTrue(cloud.surface.any())
                on_mesh = cloud.caster().distance(cloud.clean[::7])
                extent = np.linalg.norm(np.ptp(cloud.vertices, axis=0))
                self.assertLess(on_mesh.max(), 1e-5 * extent)
                lengths = np.linalg.norm(cloud.normal[cloud.surface], axis=1)
                np.testing.assert_allclose(lengths, 1, atol=1e-3)
                self.assertEqual(cloud.sigma < 1e-4 * cloud.typical_spacing, family.group == "clean")

    def test_the_same_seed_gives_the_same_cloud_and_another_one_another(self):
        for name in ("stereo_windows", "object_white", "near_duplicates", "sparse_forest"):
            first, again, other = (families.draw(name, seed) for seed in (5, 5, 6))
            for array in ARRAYS:
                np.testing.assert_array_equal(getattr(first, array), getattr(again, array))
            self.assertFalse(np.array_equal(first.points, other.points))

    def test_noise_is_as_asked(self):
        for name in ("object_white", "object_even", "grid_noisy", "wires"):
            cloud = families.draw(name, 8)
            sigma = cloud.settings["sigma"]
            self.assertAlmostEqual(float(cloud.signed_error()[cloud.surface].std()) / sigma, 1, delta=.12)
            places = np.flatnonzero(cloud.surface)[::50]
            self.assertAlmostEqual(float(np.median(cloud.local_noise(places))) / sigma, 1, delta=.12)

    def test_much_noise_along_has_one_direction_and_the_size_that_is_asked(self):
        for seed in (8, 9):
            cloud = families.draw("much_noise_along", seed)
            error = (cloud.points - cloud.clean).astype(float)
            along, across, least = np.linalg.svd(error, compute_uv=False) / np.sqrt(len(error))
            sigma = cloud.settings["sigma"]
            self.assertTrue(.95 * sigma < along < 1.15 * sigma, along / sigma)
            self.assertTrue(.04 * sigma < least <= across < .42 * sigma, (least / sigma, across / sigma))

    def test_window_matched_errors_of_neighbouring_pixels_are_alike(self):
        field = errors.window_matched(np.random.default_rng(4), (300, 300), 12, passes=2)
        self.assertAlmostEqual(float(field.std()), 1, delta=1e-9)
        self.assertGreater(np.corrcoef(field[:, 1:].ravel(), field[:, :-1].ravel())[0, 1], .97)

    def test_copies_are_copies(self):
        cloud = families.draw("copies_exact", 4)
        once = np.unique(cloud.points, axis=0)
        self.assertLessEqual(len(once), len(cloud.points) / cloud.settings["times"])
        self.assertGreater(np.median(cloud.spacing), 0)


class Measures(unittest.TestCase):
    def test_the_clean_points_have_no_error_and_the_measured_ones_all_of_it(self):
        cloud = families.draw("object_white", 9)
        truth = Truth(cloud)
        before, kept, best = truth.facts(), truth.of(cloud.points, None), truth.of(cloud.clean, None)
        self.assertEqual((kept["mean"], kept["moved"], kept["worse"]), (before["mean"], 0, 0))
        self.assertLess(best["rms"], 1e-5)

    def test_true_noise_agrees_and_twice_of_it_does_not(self):
        true = np.full(10, .1)
        self.assertEqual(agreement(true, true, 1.0)["within_25"], 1)
        self.assertEqual(agreement(2 * true, true, 1.0)["within_50"], 0)
        self.assertEqual(agreement(np.zeros(10), np.zeros(10), 1.0)["log_rms"], 0)

    def test_errors_far_below_the_spacing_count_as_equal(self):
        row = {"before": {"spacing": 1.0}, "a": {"mean": 1e-9}, "b": {"mean": 1e-6}}
        self.assertEqual(tables.ratio(row, "a", "b"), 1)


class Switches(unittest.TestCase):
    def test_each_is_of_numbers_that_are_there(self):
        self.assertEqual({name for numbers in switches.SWITCHES.values() for name in numbers} - switches.names(), set())

    def test_none_is_of_a_number_that_compilers_need(self):
        """Numbers that are read from the environment are no constant expressions."""
        needed = re.compile(r"static_assert\((.*)\);|constexpr [^=]*=(.*);")
        for source in sorted((switches.ROOT / "src/estimate").glob("*.[ch]pp")):
            if source.name == "constants.hpp":
                continue
            for found in needed.finditer(source.read_text()):
                words = set(re.findall(r"\bk[A-Z]\w*", found[1] or found[2]))
                self.assertEqual(words & switches.names(), set(), f"{source.name}: {found[0]}")

    def test_wrong_words_are_told(self):
        self.assertEqual(switches.numbers_of("kDamage=.5,kFlatPercent0=100"), {"kDamage": .5, "kFlatPercent0": 100})
        for words, told in (("kNone=1", "kNone is no number"), ("kDamage", "could not convert")):
            with self.assertRaisesRegex(ValueError, told):
                switches.numbers_of(words)
        with self.assertRaisesRegex(ValueError, "none is no switch: choose from repeats"):
            switches.wanted_switches("none")


@unittest.skipUnless(torch, "no torch")
class CoarseLists(unittest.TestCase):
    def setUp(self):
        rng = np.random.default_rng(5)
        places = rng.normal(size=(2, 3000, 3)).astype(np.float32)
        places[:, 1000:1200] = places[:, :200]                       # copies
        cloud = np.repeat([0, 1, 2, -1], [2000, 700, 60, 240]).astype(np.int16)[None].repeat(2, 0)
        self.places, self.cloud = torch.from_numpy(places), torch.from_numpy(cloud)
        self.finest = torch.from_numpy(rng.integers(0, 3000, (2, 3000, 16)))
        self.salt = torch.tensor([3, 77])
        self.lists = coarse.lists_of(self.places, self.cloud, self.finest, self.salt).numpy()

    def test_each_list_has_the_nearest_members_of_the_own_cloud_or_is_the_finer_one(self):
        share = coarse.shares(self.places, self.salt[:, None]).numpy()
        kept = set()
        for piece, scale, number in [(p, s, c) for p in range(2) for s in range(1, len(spec.STRIDES)) for c in range(3)]:
            own = np.flatnonzero(self.cloud[piece].numpy() == number)
            members = own[share[piece, own] < 1 / spec.STRIDES[scale]]
            place = self.places[piece].numpy().astype(float)
            for point in own[::37]:
                others = members[members != point]
                found = self.lists[piece, scale, point]
                kept.add(len(others) < 16)
                if len(others) < 16:
                    np.testing.assert_array_equal(found, self.lists[piece, scale - 1, point])
                    continue
                away = np.sort(np.linalg.norm(place[others] - place[point], axis=1))[:16]
                self.assertTrue(set(found) <= set(others))
                np.testing.assert_allclose(np.linalg.norm(place[found] - place[point], axis=1), away, rtol=1e-5, atol=1e-6)
        self.assertEqual(kept, {True, False})

    def test_a_scale_holds_its_share_of_points_copies_together_and_others_with_another_salt(self):
        one, other = (coarse.shares(self.places, self.salt[:, None] + k).numpy() for k in (0, 1))
        np.testing.assert_array_equal(one[:, :200], one[:, 1000:1200])
        for stride in spec.STRIDES[1:]:
            spread = 4 * np.sqrt(6000 / stride)
            self.assertAlmostEqual((one < 1 / stride).sum(), 6000 / stride, delta=spread)
            self.assertAlmostEqual(((one < 1 / stride) & (other < 1 / stride)).sum(), 6000 / stride ** 2, delta=spread)


@unittest.skipUnless(torch, "no torch")
class ErrorsOfPieces(unittest.TestCase):
    """Points of a plane, each measured at the true place of another; five of them do not count."""

    def setUp(self):
        rng = np.random.default_rng(6)
        x, y = np.meshgrid(np.arange(32.), np.arange(32.))
        true = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)
        self.order = rng.permutation(1024)
        measured = true[self.order]
        sound = np.arange(1024) >= 5
        up = np.tile([0., 0, 1], (1024, 1))
        finest = cKDTree(measured).query(measured, 17)[1][:, 1:]
        columns = [measured, measured, up, np.full(1024, 3.), true, up, sound, np.ones(1024, bool), np.zeros(1024, np.int16), finest]
        kinds = [np.float32] * 6 + [bool, bool, np.int16, np.int16]
        self.piece = [torch.from_numpy(np.ascontiguousarray(c, kind)) for c, kind in zip(columns, kinds)]
        self.batch = data.Batch([("objects_plane", self.piece)] * 2)
        self.places = torch.from_numpy(measured.astype(np.float32)).repeat(2, 1)

    def test_places_that_are_those_of_the_truth_in_another_order_have_no_error(self):
        floor = data.FLOOR * self.batch.spacing
        mean, rms, chamfer = self.batch.errors(self.places)
        torch.testing.assert_close(mean, floor)
        torch.testing.assert_close(rms, floor)
        self.assertLess(float((chamfer - floor * floor).max()), 11 / 1019)

    def test_errors_are_distances_from_the_plane_and_to_the_nearest_places(self):
        mean, rms, chamfer = self.batch.errors(self.places + torch.tensor([0, 0, .25]))
        floor = data.FLOOR * self.batch.spacing
        torch.testing.assert_close(mean, .25 + floor)
        self.assertGreater(float(chamfer.min()), 2 * .0625)
        self.assertLess(float(chamfer.max()), 2 * .0625 + .03)


if __name__ == "__main__":
    unittest.main()
