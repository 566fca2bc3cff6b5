# SPDX-License-Identifier: Apache-2.0
"""pointfair noise: what it samples, the statistics of what it adds, and that a seed fixes every byte."""
import hashlib
import math
import statistics

from program import CUBE_FACES, CUBE_VERTICES, Case, payload, positions, read_ply, sphere_points, write_off, write_ply


class Sampling(Case):
    def cube(self):
        return write_off(self.path("cube.off"), CUBE_VERTICES, CUBE_FACES)

    def sample(self, mesh, *words):
        self.ok("noise", mesh, self.path("out.ply"), *words, "-q")
        return positions(self.path("out.ply"))

    def test_points_lie_on_the_faces_uniformly_by_area(self):
        # A long box: the areas of its sides are 10, 10, 1 in pairs.
        box = write_off(self.path("box.off"), [(10 * x, y, z) for x, y, z in CUBE_VERTICES], CUBE_FACES)
        points = self.sample(box, "--points", 42000)
        self.assertEqual(len(points), 42000)
        sides = {}
        for x, y, z in points:
            off = {"x": min(abs(x), abs(x - 10)), "y": min(abs(y), abs(y - 1)), "z": min(abs(z), abs(z - 1))}
            side = min(off, key=off.get)
            self.assertLess(off[side], 1e-6)
            sides[side] = sides.get(side, 0) + 1
        for side, expected in {"x": 2000, "y": 20000, "z": 20000}.items():
            self.assertLess(abs(sides[side] - expected), 5 * math.sqrt(expected), sides)
        along = [x / 10 for x, y, z in points if 1e-6 < x < 10 - 1e-6]
        self.assertLess(abs(statistics.mean(along) - 0.5), 5 / math.sqrt(12 * len(along)))
        self.assertLess(abs(statistics.variance(along) - 1 / 12), 0.002)

    def test_uneven_density_grows_geometrically_along_the_longest_axis(self):
        box = write_off(self.path("box.off"), [(x, 4 * y, z) for x, y, z in CUBE_VERTICES], CUBE_FACES)
        points = self.sample(box, "--points", 40000, "--uneven", 50)
        along = [y / 4 for x, y, z in points if 1e-6 < y < 4 - 1e-6]
        ratio = 50
        for upto in (0.25, 0.5, 0.75):  # the integral of ratio^t
            expected = (ratio**upto - 1) / (ratio - 1)
            share = sum(t < upto for t in along) / len(along)
            self.assertLess(abs(share - expected), 5 * math.sqrt(expected / len(along)))

    def test_noise_is_gaussian_isotropic_and_of_the_asked_width(self):
        points = sphere_points(20000, 0.0)
        write_ply(self.path("in.ply"), points)
        self.ok("noise", self.path("in.ply"), self.path("out.ply"), "--sigma", 0.01, "-q")
        before, after = positions(self.path("in.ply")), positions(self.path("out.ply"))
        normal = statistics.NormalDist(0, 0.01)
        axes = [[q[a] - p[a] for p, q in zip(before, after)] for a in range(3)]
        for values in axes:
            self.assertLess(abs(statistics.mean(values)), 5 * 0.01 / math.sqrt(len(values)))
            ordered = sorted(values)
            distance = max(abs(normal.cdf(v) - (i + 0.5) / len(ordered)) for i, v in enumerate(ordered))
            self.assertLess(distance, 1.95 / math.sqrt(len(ordered)))  # Kolmogorov and Smirnov, 0.1 %
        for a, b in ((0, 1), (0, 2), (1, 2)):
            self.assertLess(abs(statistics.correlation(axes[a], axes[b])), 5 / math.sqrt(len(points)))
        self.assertGreater(max(abs(v) for v in axes[0]), 0.03)  # tails: 3.7 sigma is usual in 20000

    def test_sigma_in_percent_is_of_the_diagonal_of_the_input(self):
        clean = self.sample(self.cube(), "--points", 20000)
        self.path("out.ply").unlink()
        noisy = self.sample(self.cube(), "--points", 20000, "--sigma", "1%")
        squares = [math.dist(p, q) ** 2 / 3 for p, q in zip(clean, noisy)]
        self.assertAlmostEqual(math.sqrt(statistics.mean(squares)), 0.01 * math.sqrt(3), delta=0.0002)

    def test_sigma_in_spacings(self):
        # On a square grid of width 1 the 6 nearest lie at 1, 1, 1, 1, sqrt 2, sqrt 2.
        grid = [(float(x), float(y), 0.0) for x in range(120) for y in range(120)]
        write_ply(self.path("in.ply"), grid)
        moved = self.sample(self.path("in.ply"), "--sigma", "2s")
        width = math.sqrt(statistics.mean(math.dist(p, q) ** 2 / 3 for p, q in zip(grid, moved)))
        self.assertAlmostEqual(width, 2 * (4 + 2 * math.sqrt(2)) / 6, delta=0.1)

    def test_outliers_are_the_asked_share_uniform_in_the_grown_box(self):
        points = sphere_points(20000, 0.0)
        write_ply(self.path("in.ply"), points)
        moved = self.sample(self.path("in.ply"), "--outliers", "10%")
        changed = [q for p, q in zip(positions(self.path("in.ply")), moved) if p != q]
        self.assertEqual(len(changed), 2000)
        for axis in range(3):
            values = [q[axis] for q in changed]
            self.assertLess(max(values), 1.101)
            self.assertGreater(max(values), 1.05)
            self.assertGreater(min(values), -1.101)
            self.assertLess(abs(statistics.mean(values)), 5 * 1.1 / math.sqrt(3 * len(values)))

    def test_a_cloud_keeps_its_attributes_and_its_points_that_are_not_numbers(self):
        points = sphere_points(100, 0.0)
        points[7] = (float("nan"), 1.0, 2.0)
        labels = list(range(100))
        write_ply(self.path("in.ply"), points, extra=[("int", "label", labels)])
        self.ok("noise", self.path("in.ply"), self.path("out.ply"), "--sigma", 0.01, "-q")
        after = read_ply(self.path("out.ply"))
        self.assertEqual([p["label"] for p in after], labels)
        self.assertTrue(math.isnan(after[7]["x"]))
        self.assertEqual((after[7]["y"], after[7]["z"]), (1.0, 2.0))
        self.assertTrue(all(after[i]["x"] != points[i][0] for i in range(100) if i != 7))

    def test_nothing_asked_is_the_same_file(self):
        write_ply(self.path("in.ply"), sphere_points(50, 0.1))
        self.ok("noise", self.path("in.ply"), self.path("out.ply"), "-q")
        self.assertEqual(self.path("in.ply").read_bytes(), self.path("out.ply").read_bytes())

    def test_the_same_seed_gives_these_bytes_on_any_machine(self):
        words = ["--points", 5000, "--sigma", "0.3%", "--uneven", 50, "--outliers", "1%", "--seed", 42, "-q"]
        self.ok("noise", self.cube(), self.path("a.ply"), *words, "--threads", 1)
        self.ok("noise", self.cube(), self.path("b.ply"), *words, "--threads", 3)
        self.assertEqual(self.path("a.ply").read_bytes(), self.path("b.ply").read_bytes())
        self.assertEqual(len(payload(self.path("a.ply"))), 5000 * 12)
        self.assertEqual(hashlib.sha256(payload(self.path("a.ply"))).hexdigest(), "fd36bd911370729950b66bf32437994e97ea5e6a9224505f3424750bc9ae3efa")

    def test_another_seed_gives_other_points(self):
        first = self.sample(self.cube(), "--points", 100, "--seed", 1)
        second = self.sample(self.cube(), "--points", 100, "--seed", 2, "--force")
        self.assertTrue(all(p != q for p, q in zip(first, second)))


class Refusals(Case):
    def test_wrong_values(self):
        mesh = write_off(self.path("cube.off"), CUBE_VERTICES, CUBE_FACES)
        out = self.path("out.ply")
        self.fails(2, "noise", mesh, out, "--points", 10, "--sigma", "-1%", says="sigma")
        self.fails(2, "noise", mesh, out, "--points", 10, "--sigma", "wide", says="wide")
        self.fails(2, "noise", mesh, out, "--points", 10, "--outliers", "101%", says="outliers")
        for ratio in ("0.5", "nan"):
            self.fails(2, "noise", mesh, out, "--points", 10, "--uneven", ratio, says=["--uneven", "from 1 to 1000000"])
        self.fails(2, "noise", mesh, out, "--points", "many", says="points")
        self.fails(2, "noise", mesh, out, "--uneven", "50", says="--points")

    def test_a_cloud_cannot_be_sampled(self):
        cloud = write_ply(self.path("in.ply"), sphere_points(10, 0.0))
        self.fails(2, "noise", cloud, self.path("out.ply"), "--points", 10, says="no faces")

    def test_a_mesh_without_area(self):
        mesh = write_off(self.path("flat.off"), [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)], [(0, 1, 2)])
        self.fails(1, "noise", mesh, self.path("out.ply"), "--points", 10, says="area")
