# SPDX-License-Identifier: Apache-2.0
"""The noise at each point: written by --write-noise, read by --noise NAME."""
import math
import random
import struct

from program import Case, positions, read_ply, run, write_ply
from survey_files import ground, write_e57, write_las, write_old_las

QUIET, LOUD = 0.0005, 0.003


def halves(count=6000):
    """A plane whose right half is six times as noisy as the left; and the noise of each point."""
    generator = random.Random(3)
    points, sigmas = [], []
    for _ in range(count):
        x, y = generator.random(), generator.random()
        sigmas.append(QUIET if x < 0.5 else LOUD)
        points.append((x, y, generator.gauss(0, sigmas[-1])))
    return points, sigmas


def median(values):
    return sorted(values)[len(values) // 2]


def by_half(points, values):
    """The medians left and right of the middle, where the noise changes."""
    return [median([v for p, v in zip(points, values) if side(p[0])]) for side in (lambda x: x < 0.4, lambda x: x > 0.6)]


class PointNoise(Case):
    def setUp(self):
        super().setUp()
        self.points, self.sigmas = halves()
        self.cloud = write_ply(self.path("in.ply"), self.points, extra=[("float", "sigma", self.sigmas)])

    def noise(self, path, name="noise"):
        return [row[name] for row in read_ply(path)]

    def test_written_is_the_noise_at_each_point(self):
        self.ok("run", self.cloud, self.path("out.ply"), "--write-noise", "-q")
        quiet, loud = by_half(self.points, self.noise(self.path("out.ply")))
        self.assertLess(abs(math.log(quiet / QUIET)), math.log(1.25))
        self.assertLess(abs(math.log(loud / LOUD)), math.log(1.25))
        report = self.report("info", self.cloud)
        written = self.noise(self.path("out.ply"))
        self.assertGreaterEqual(min(written), 0.5 * report["noise_quantiles"][0])
        self.assertLessEqual(max(written), 2 * report["noise_quantiles"][2])
        self.assertEqual(self.noise(self.path("out.ply"), "sigma"), self.noise(self.cloud, "sigma"), "others stay")

    def test_it_changes_nothing_else(self):
        self.ok("run", self.cloud, self.path("with.ply"), "--write-noise", "-q")
        self.ok("run", self.cloud, self.path("without.ply"), "-q")
        self.assertEqual(positions(self.path("with.ply")), positions(self.path("without.ply")))

    def test_written_under_the_name_that_is_given_into_each_format_that_takes_it(self):
        for name in ("out.ply", "out.pcd", "out.las", "out.laz", "out.xyz", "out.txt", "out.csv", "out.pts"):
            with self.subTest(name):
                out = self.path(name)
                self.ok("run", self.cloud, out, "--write-noise=sd", "-q")
                self.ok("run", out, self.path("back.ply"), "--strength", "0", "--encoding", "ascii", "--force", "-q")
                rows = read_ply(self.path("back.ply"))
                column = "sd" if "sd" in rows[0] else list(rows[0])[-1]  # some text formats have no names
                quiet, loud = by_half(self.points, [row[column] for row in rows])
                self.assertLess(abs(math.log(quiet / QUIET)), math.log(1.25))
                self.assertLess(abs(math.log(loud / LOUD)), math.log(1.25))

    def test_las_keeps_what_it_has(self):
        points = list(ground(2500))
        las = write_las(self.path("in.las"), points, [(2, 6, 7, 5)[i % 4] for i in range(len(points))])
        self.ok("run", las, self.path("out.las"), "--write-noise", "-q")
        attributes = {row["name"]: row["type"] for row in self.report("info", self.path("out.las"))["attributes"]}
        self.assertEqual(attributes["noise"], "float32")
        self.assertIn("classification", attributes)

    def test_points_that_are_not_there_or_ignored_have_none(self):
        points = [(math.nan, 0.0, 0.0) if i == 5 else p for i, p in enumerate(self.points)]
        kinds = [7 if i % 10 == 0 else 1 for i in range(len(points))]
        cloud = write_ply(self.path("holes.ply"), points, extra=[("uchar", "kind", kinds)])
        self.ok("run", cloud, self.path("out.ply"), "--write-noise", "--ignore", "kind=7", "-q")
        for i, value in enumerate(self.noise(self.path("out.ply"))):
            self.assertEqual(math.isnan(value), i == 5 or i % 10 == 0)

    def test_a_noise_that_is_given_is_that_of_a_typical_place(self):
        estimated = self.report("info", self.cloud)["noise"]
        self.ok("run", self.cloud, self.path("a.ply"), "--write-noise", "-q")
        self.ok("run", self.cloud, self.path("b.ply"), "--write-noise", "--noise", repr(2 * estimated), "-q")
        for a, b in zip(self.noise(self.path("a.ply")), self.noise(self.path("b.ply"))):
            self.assertAlmostEqual(b / a, 2, delta=1e-5)

    def test_a_second_run_replaces_what_the_first_wrote(self):
        self.ok("run", self.cloud, self.path("once.ply"), "--write-noise", "-q")
        self.ok("run", self.path("once.ply"), self.path("twice.ply"), "--write-noise", "-q")
        once, twice = read_ply(self.path("once.ply")), read_ply(self.path("twice.ply"))
        self.assertEqual(list(once[0]), list(twice[0]))
        self.assertLess(median([row["noise"] for row in twice]), median([row["noise"] for row in once]))

    def test_what_cannot_be_written_is_one_line_before_the_run(self):
        for name in ("out.off", "out.obj"):
            self.fails(2, "run", self.cloud, self.path(name), "--write-noise", says=["--write-noise", "PLY"])
        scan = self.path("scan.e57")
        write_e57(scan, ground(400))
        if run("info", scan).returncode == 0:  # this build reads E57
            self.fails(2, "run", scan, self.path("out.e57"), "--write-noise", says=["--write-noise", "PLY"])
        for name in ("x", "Z", "two words", "a,b", "n" * 33, "sigma\u00b2"):
            self.fails(2, "run", self.cloud, self.path("out.ply"), f"--write-noise={name}", says="--write-noise")
        taken = write_ply(self.path("taken.ply"), self.points[:50], extra=[("int", "noise", range(50))])
        self.fails(2, "run", taken, self.path("out.ply"), "--write-noise", says=["--write-noise", "noise_2"])

    def test_scaled_integers_are_no_place_for_floats(self):
        """Extra bytes of uint16 with steps of 0.01 from 5 on, which are shown as doubles."""
        described = bytearray(192)
        struct.pack_into("<xxBB32s", described, 0, 3, 8 | 16, b"amp")
        struct.pack_into("<d", described, 112, 0.01)
        struct.pack_into("<d", described, 136, 5)
        scan = write_old_las(self.path("scan.las"), ground(400), bytes(described), struct.pack("<H", 123))
        self.assertIn({"name": "amp", "type": "float64", "components": 1}, self.report("info", scan)["attributes"])
        for flag in ("--write-noise", "--write-displacement"):
            self.fails(2, "run", scan, self.path("out.las"), f"{flag}=amp", says=[flag, "amp_2"])
        self.ok("run", scan, self.path("out.las"), "--write-noise=amp_2", "-q")

    def test_an_attribute_takes_the_place_of_the_estimate(self):
        report = self.report("run", self.cloud, self.path("out.ply"), "--noise", "sigma", "--write-noise")
        self.assertEqual(report["noise"]["attribute"], "sigma")
        self.assertIn(round(report["noise"]["before"], 6), (QUIET, LOUD))
        self.assertAlmostEqual(report["noise"]["quantiles"][0], QUIET, delta=1e-8)
        self.assertAlmostEqual(report["noise"]["quantiles"][2], LOUD, delta=1e-8)
        self.assertEqual(report["params"]["noise"], report["noise"]["before"])
        quiet, loud = by_half(self.points, self.noise(self.path("out.ply")))
        self.assertAlmostEqual(quiet / QUIET, 1, delta=0.02)
        self.assertAlmostEqual(loud / LOUD, 1, delta=0.02)
        text = self.ok("run", self.cloud, self.path("said.ply"), "--noise", "sigma").stderr.decode()
        self.assertIn("median of 'sigma'", text)

    def test_points_move_as_their_attribute_says(self):
        """The noise is the same everywhere; the attribute says that the left half is exact, as far as levels go."""
        generator = random.Random(4)
        points = [(x, y, generator.gauss(0, LOUD)) for x, y, _ in self.points]
        cloud = write_ply(self.path("even.ply"), points, extra=[("double", "sd", [1e-9 if p[0] < 0.45 else LOUD for p in points])])

        def moved(*words):
            self.ok("run", cloud, self.path("out.ply"), "--force", "-q", *words)
            motion = [(p[0], abs(q[2] - p[2])) for p, q in zip(points, positions(self.path("out.ply")))]
            return [sum(m for x, m in motion if x < 0.35), sum(m for x, m in motion if x > 0.55)]

        (left, right), (plain_left, plain_right) = moved("--noise", "sd"), moved()
        self.assertLess(left, 0.6 * plain_left)
        self.assertGreater(right, 0.9 * plain_right)

    def test_whole_numbers_will_do_and_the_last_noise_counts(self):
        cloud = write_ply(self.path("ints.ply"), [(1000 * x, 1000 * y, 1000 * z) for x, y, z in self.points],
                          extra=[("uchar", "mm", [round(max(1, 1000 * s)) for s in self.sigmas])])
        used = self.report("run", cloud, self.path("out.ply"), "--noise", "0.1", "--noise", "mm")["params"]
        self.assertIn(used["noise"], (1, 3))
        used = self.report("run", cloud, self.path("out2.ply"), "--noise", "mm", "--noise", "0.25")["params"]
        self.assertEqual(used["noise"], 0.25)

    def test_an_attribute_that_is_no_noise_is_one_line(self):
        out = self.path("out.ply")
        self.fails(2, "run", self.cloud, out, "--noise", "sigmas", says=["--noise", "in.ply", "'sigmas'", "sigma", "length"])
        none = write_ply(self.path("none.ply"), self.points[:50])
        self.fails(2, "run", none, out, "--noise", "atuo", says=["'atuo'", "none"])
        zero = write_ply(self.path("zero.ply"), self.points[:50], extra=[("float", "sd", [0.0] * 49 + [-1.0])])
        self.fails(2, "run", zero, out, "--noise", "sd", says=["--noise sd", "positive"])
        self.fails(2, "run", self.cloud, out, "--noise", "-1", says="--noise")
        self.fails(2, "run", self.cloud, out, "--noise", "5km", says="--noise")
