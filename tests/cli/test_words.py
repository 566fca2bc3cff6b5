# SPDX-License-Identifier: Apache-2.0
"""What a run says of itself is so: where its noise comes from, why points stayed, when a result is doubtful."""
import math
import random
import re
import struct

from program import Case, sphere_points, write_ply


def shared_noise(window, side=90):
    """A plane whose noise, of 0.3 spacings, is the mean over a window."""
    rng = random.Random(4)
    white = [[rng.gauss(0, 0.3 * window) for _ in range(side + window)] for _ in range(side + window)]
    rows = [[sum(row[j:j + window]) / window for j in range(side)] for row in white]
    return [(x, y, sum(rows[x + i][y] for i in range(window)) / window) for x in range(side) for y in range(side)]


def rows_of_points(ratio, count, noise):
    """A plane in rows that lie `ratio` times as far apart as the points along them, 1 apart. Errors are independent."""
    rng = random.Random(2)
    side = round((count * ratio) ** 0.5)
    starts = [rng.random() for _ in range(side // ratio)]
    return [(row * ratio, start + y, rng.gauss(0, noise)) for row, start in enumerate(starts) for y in range(side)]


def forest():
    """Ground with noise of 0.1 spacings under crowns."""
    rng = random.Random(3)
    ground = [(rng.uniform(0, 30), rng.uniform(0, 30), rng.gauss(0, 0.03)) for _ in range(6000)]
    trees = [(rng.uniform(0, 30), rng.uniform(0, 30)) for _ in range(20)]
    crowns = [(x + rng.uniform(-2, 2), y + rng.uniform(-2, 2), rng.uniform(5, 10)) for x, y in trees for _ in range(600)]
    return ground + crowns


def walls_in_floats(at):
    """Two walls and a floor around a place, in coordinates that were stored as 32-bit floats there."""
    rng = random.Random(6)
    def single(value):
        return struct.unpack("f", struct.pack("f", value))[0]
    def point(side):
        u, v, noise = rng.uniform(0, 3), rng.uniform(0, 3), rng.gauss(0, 0.003)
        return [(u, v, noise), (u, noise, v), (noise, u, v)][side]
    return [tuple(single(a + b) for a, b in zip(at, point(i % 3))) for i in range(12000)]


def write_stl(path, points, side):
    """The grid of points as triangles, each with its own three corners."""
    faces = [face for x in range(side - 1) for y in range(x * side, x * side + side - 1)
             for face in ((y, y + side, y + 1), (y + side, y + side + 1, y + 1))]
    corners = b"".join(struct.pack("<12fH", 0, 0, 0, *(c for corner in face for c in points[corner]), 0) for face in faces)
    path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + corners)


class Words(Case):
    def said(self, *words):
        """What a run with these words says."""
        return self.ok("run", self.path("in.ply"), self.path("out.ply"), "--force", *words).stderr.decode()

    def test_noise_that_was_given_is_not_called_estimated(self):
        write_ply(self.path("in.ply"), sphere_points(2000, 0.01))
        for tiles in ([], ["--tiles", "2"]):
            self.assertRegex(self.said(*tiles), r"noise of the input 0\.0\d+ \(estimated\)")
            self.assertIn("noise of the input 0.05 (given)", self.said("--noise", "0.05", *tiles))
            given = self.report("run", self.path("in.ply"), self.path("out.ply"), "--force", "--noise", "0.05", *tiles)
            self.assertEqual(given["noise"]["given"], 0.05)

    def test_the_details_say_which_values_were_chosen(self):
        write_ply(self.path("in.ply"), sphere_points(2000, 0.01))
        self.assertRegex(self.said("-v"), r"outliers +auto \(keep\)\n")
        self.assertRegex(self.said("-v", "--outliers", "keep"), r"outliers +keep\n")

    def test_the_reasons_account_for_all_points_that_were_kept(self):
        points = sphere_points(3000, 0.01)
        for i in range(20):
            points[i] = tuple(2 * c for c in points[i])
        points[30:35] = [(float("nan"),) * 3] * 5
        write_ply(self.path("in.ply"), points)
        for tiles in ([], ["--tiles", "2"]):
            denoised, kept, reasons = re.search(r"^(\d+) points denoised.*, (\d+) kept as they were: (.*)$", self.said(*tiles), re.M).groups()
            counts = [int(count) for count in re.findall(r"(\d+) (?:not finite|with|without|isolated|off|mixed)", reasons)]
            self.assertEqual(sum(counts), int(kept))
            self.assertEqual(int(denoised) + int(kept), 3000)
            self.assertGreater(int(kept), 5 + 10)

    def test_an_outlier_that_the_limits_hold_is_counted_once(self):
        points = sphere_points(3000, 0.01)
        for i in range(0, 60, 2):
            points[i] = tuple(2 * c for c in points[i])
        write_ply(self.path("in.ply"), points, extra=[("uchar", "part", [i % 2 for i in range(3000)])])
        limits = ("--where", "part=1")  # outliers have 0
        for tiles in ([], ["--tiles", "2"]):
            said = self.said(*limits, *tiles)
            denoised, kept = map(int, re.search(r"^(\d+) points denoised.*, (\d+) kept as they were", said, re.M).groups())
            held = int(re.search(r"held (\d+) others in place", said).group(1))
            self.assertEqual([denoised, kept + held], [1500, 1500], said)
            self.assertGreater(kept, 20)
            counts = self.report("run", self.path("in.ply"), self.path("out.ply"), "--force", *limits, *tiles)["unmoved"]
            self.assertEqual(sum(counts.values()), 1500, counts)

    def test_the_time_of_a_run_with_limits_has_that_of_its_estimates(self):
        write_ply(self.path("in.ply"), sphere_points(3000, 0.01))
        for limits in ([], ["--box", "0,0,0,1,1,1"]):
            stages = self.report("run", self.path("in.ply"), self.path("out.ply"), "--force", *limits)["stages"]
            self.assertIn("estimate", [stage["name"] for stage in stages], limits)

    def test_no_unit_is_advised_where_the_file_has_none(self):
        write_ply(self.path("in.ply"), sphere_points(100, 0.01))
        self.assertNotIn("mm", self.fails(2, "run", self.path("in.ply"), self.path("out.ply"), "--radius", "wide", says="0.02 (file units)"))

    def test_a_folder_is_called_one(self):
        folder = self.path("stations")
        folder.mkdir()
        for name in ("a.ply", "b.ply"):
            write_ply(folder / name, sphere_points(100, 0.01))
        self.fails(3, "run", folder, self.path("out.ply"), says=["is a folder of 2 point clouds", "--out-dir", "--each"])
        said = self.fails(3, "run", folder, self.path("out"), "--each", says="--out-dir")
        self.assertNotIn("and --each", said)
        write_ply(self.path("in.ply"), sphere_points(100, 0.01))
        self.fails(3, "run", self.path("in.ply"), folder, says="is a folder")

    def test_a_cloud_too_sparse_for_its_noise_is_told(self):
        rng = random.Random(1)
        ground = [(x, y, (x * y) / 4000 + rng.gauss(0, 0.02)) for x, y in ((rng.uniform(0, 1000), rng.uniform(0, 1000)) for _ in range(3000))]
        write_ply(self.path("in.ply"), ground)
        for tiles in ([], ["--tiles", "2"]):
            self.assertRegex(self.said(*tiles), r"note: points are 1\d\.\d+ apart, \d+ times the noise of a typical place")
            self.assertIn("data sheet", self.said(*tiles))
            self.assertIn("; a larger --noise removes more\n", self.said("--noise", "0.01", *tiles))
            self.assertNotIn("so far apart", self.said("--noise", "1", *tiles))

    def test_moves_that_are_large_against_the_cloud_are_told(self):
        rng = random.Random(1)
        write_ply(self.path("in.ply"), [[rng.uniform(0, 1000) for _ in range(3)] for _ in range(300)])
        for tiles in ([], ["--tiles", "2"]):
            self.assertIn("large against the cloud", self.said(*tiles))

    def test_outliers_that_are_moved_far_are_told_as_such(self):
        rng = random.Random(1)
        plane = [(x / 50, y / 50, rng.gauss(0, 0.001)) for x in range(50) for y in range(50)]
        write_ply(self.path("in.ply"), plane + [(rng.random(), rng.random(), rng.uniform(-0.3, 0.3)) for _ in range(250)])
        for tiles in ([], ["--tiles", "2"]):
            said = self.said("--outliers", "move", *tiles)
            self.assertRegex(said, r"note: moves of up to \S+ are large against .*: --outliers move pulls outliers in")
            self.assertNotIn("too few", said)
            self.assertNotIn("large against", self.said("--outliers", "mark", *tiles))

    def test_noise_that_neighbours_share_is_told(self):
        write_ply(self.path("in.ply"), shared_noise(1))
        self.assertNotIn("long-wave", self.said())
        write_ply(self.path("in.ply"), shared_noise(7))
        for words in (["--report", self.path("r.html")], ["--tiles", "2"]):
            self.assertRegex(self.said(*words), "note: the noise looks long-wave: .*: measure a flat place before and after")
        self.assertIn("looks long-wave", self.path("r.html").read_text())
        for words in ([], ["--tiles", "2"]):
            self.assertNotIn("long-wave", self.said("--min-neighbors", "48", *words))

    def test_rows_and_bad_points_are_no_long_wave_noise(self):
        rng = random.Random(7)
        bad = [(rng.uniform(0, 90), rng.uniform(0, 90), rng.gauss(0, 0.03 * (20 if i % 10 == 0 else 1))) for i in range(9000)]
        for points in (rows_of_points(4, 9000, 0.6), rows_of_points(5, 9000, 0.6), bad):
            write_ply(self.path("in.ply"), points)
            for tiles in ([], ["--tiles", "2"]):
                self.assertNotIn("long-wave", self.said(*tiles))

    def test_rows_too_far_apart_for_neighbourhoods_are_told(self):
        for ratio, told in ((8, False), (60, True)):
            write_ply(self.path("in.ply"), rows_of_points(ratio, 20000, 0.6))
            for tiles in ([], ["--tiles", "2"]):
                self.assertEqual("does not reach the next row, and most of the noise is left" in self.said(*tiles), told)
        self.assertNotIn("next row", self.said("--method", "mls", "--radius", 1.2 * 60))

    def test_corners_of_faces_that_share_none_are_no_long_wave_noise(self):
        for window, told in ((1, False), (7, True)):
            write_stl(self.path("in.stl"), shared_noise(window), 90)
            for tiles in ([], ["--tiles", "2"]):
                said = self.ok("run", self.path("in.stl"), self.path("out.stl"), "--force", "-v", *tiles).stderr.decode()
                self.assertEqual("long-wave" in said, told, said)
                copies = int(re.search(r"note: (\d+) points repeat another one", said).group(1))
                self.assertEqual(copies, 3 * 2 * 89 * 89 - 90 * 90)

    def test_points_that_show_no_surface_are_told(self):
        rng = random.Random(2)
        ground = [(rng.uniform(0, 40), rng.uniform(0, 40), rng.gauss(0, 0.02)) for _ in range(6000)]
        write_ply(self.path("in.ply"), ground)
        self.assertNotIn("show no surface", self.said())
        write_ply(self.path("in.ply"), ground + [[rng.uniform(0, 40), rng.uniform(0, 40), rng.uniform(3, 12)] for _ in range(2000)])
        said = self.said("--report", self.path("r.html"))
        percent = re.search(r"note: (\d+) % of the points show no surface", said)
        kept = re.search(r", (\d+) kept as they were", said)
        self.assertAlmostEqual(int(percent.group(1)), 100 * int(kept.group(1)) / 8000, delta=2)
        self.assertIn(percent.group(0)[6:], self.path("r.html").read_text())

    def test_wires_without_any_surface_are_told(self):
        rng = random.Random(5)
        wires = [(10 * i + math.cos(a) * r, math.sin(a) * r, rng.uniform(0, 200)) for i in range(8) for _ in range(1250)
                 for a, r in [(rng.uniform(0, 2 * math.pi), rng.gauss(1, 0.1))]]
        write_ply(self.path("in.ply"), wires)
        for tiles in ([], ["--tiles", "2"]):
            self.assertIn("note: 100 % of the points show no surface and were not moved", self.said(*tiles))
            self.assertNotIn("show no surface", self.said("--noise", "0.1", *tiles))

    def test_what_moved_is_not_told_to_have_kept_its_place(self):
        write_ply(self.path("in.ply"), forest())
        for tiles in ([], ["--tiles", "2"]):
            self.assertRegex(self.said(*tiles), r"note: 6\d % of the points show no surface and were not moved")
            for words in (["--k", "16"], ["--relaxation", "1"], ["--method", "mls"]):  # which do not follow the noise of places
                said = self.said(*tiles, *words)
                kept = re.search(r", (\d+) kept as they were", said)
                percent = re.search(r"note: (\d+) % of the points show no surface", said)
                counted = 100 * int(kept.group(1)) / 18000 if kept else 0
                self.assertLessEqual(int(percent.group(1)) if percent else 0, counted + 1, said)

    def test_many_files_as_one_cloud_get_the_notes_of_the_cloud(self):
        for name, points in zip(("a.ply", "b.ply"), (shared_noise(7)[:4000], shared_noise(7)[4000:])):
            write_ply(self.path(name), points)
        said = self.ok("run", self.path("a.ply"), self.path("b.ply"), "--out-dir", self.path("out")).stderr.decode()
        self.assertIn("looks long-wave", said)

    def test_a_cloud_without_anything_to_see_says_that_alone(self):
        clouds = {"1 point is too few": [(1, 2, 3)], "2 points are too few": [(1, 2, 3), (2, 3, 4)], "all points lie at one place": [(1, 2, 3)] * 300}
        for says, points in clouds.items():
            write_ply(self.path("in.ply"), points)
            for tiles in ([], ["--tiles", "2"]):
                notes = [line for line in self.said(*tiles).splitlines() if line.startswith("note:")]
                self.assertEqual(len(notes), 1, notes)
                self.assertIn(says, notes[0])

    def test_floats_that_lost_their_digits_far_from_0_are_told(self):
        rng = random.Random(1)
        near = [(rng.random() * 20, rng.random() * 20, rng.gauss(0, 0.03)) for _ in range(3000)]
        far = [(x + 500_000, y + 5_800_000, z) for x, y, z in near]  # as in UTM
        for points, scalar, told in ((near, "float", False), (far, "float", True), (far, "double", False)):
            write_ply(self.path("text.ply"), points, scalar=scalar)
            self.ok("run", self.path("text.ply"), self.path("in.ply"), "--strength", "0", "--encoding", "binary", "--force")
            for tiles in ([], ["--tiles", "2"]):
                (self.assertIn if told else self.assertNotIn)("32-bit floats, which lie 0.5 apart so far from 0", self.said(*tiles))
            info = self.ok("info", self.path("in.ply")).stdout.decode()
            self.assertEqual("32-bit floats, which lie 0.5 apart" in info, told)
            self.assertIn("attributes  none", info)

    def test_steps_that_hide_all_noise_are_told(self):
        steps = "rounded to steps of up to 0.5, coarse against the noise of 0"
        for scalar, says in (("float", "32-bit floats, which lie 0.5 apart"), ("double", steps)):
            write_ply(self.path("text.ply"), walls_in_floats((500_000, 5_800_000, 100)), scalar=scalar)
            self.ok("run", self.path("text.ply"), self.path("in.ply"), "--strength", "0", "--encoding", "binary", "--force")
            for tiles in ([], ["--tiles", "2"]):
                said = self.said(*tiles)
                self.assertIn(says, said)
                self.assertEqual(said.count("coarse against"), 1, said)
                self.assertNotIn("long-wave", said)
            self.assertIn(says, self.ok("info", self.path("in.ply")).stdout.decode())
        grid = [(x, y, 0.01 * x * y) for x in range(60) for y in range(60)]  # whole numbers, by design
        for points in (walls_in_floats((0, 0, 0)), grid):
            write_ply(self.path("in.ply"), points, scalar="double")
            self.assertNotIn("coarse against", self.said())

    def test_steps_are_coarse_against_the_noise_that_was_given(self):
        rng = random.Random(1)
        write_ply(self.path("in.ply"), [(rng.random() * 20, rng.random() * 20, rng.gauss(0, 0.03)) for _ in range(3000)], scalar="double")
        self.ok("run", self.path("in.ply"), self.path("in.las"), "--strength", "0")
        step = max(struct.unpack_from("<3d", self.path("in.las").read_bytes(), 131))  # the header's scales
        for noise, told in ((step / 10, True), (10 * step, False)):
            for tiles in ([], ["--tiles", "2"]):
                said = self.ok("run", self.path("in.las"), self.path("out.las"), "--force", "--noise", noise, *tiles).stderr.decode()
                self.assertEqual("coarse against the noise of" in said, told, said)

    def test_a_plain_scan_gets_no_note(self):
        write_ply(self.path("in.ply"), sphere_points(5000, 0.01))
        for tiles in ([], ["--tiles", "2"]):
            self.assertNotIn("note", self.said(*tiles))
