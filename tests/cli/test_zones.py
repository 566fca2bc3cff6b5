# SPDX-License-Identifier: Apache-2.0
"""Clouds that are too wide for floats around one origin are computed in zones, and no bit depends on the tiles."""
import math
import random
import shutil
import signal
import struct
import subprocess
import time

from program import BIN, Case, read_ply, run
from survey_files import ground, las_grid, write_las
from test_tiled import write_binary

NAN = float("nan")


def wide_survey(count=1600, noise=0.02):
    """Ground in four places 300 km apart, one of them across borders of zones, whose sides are powers of two."""
    rows = list(ground(count, noise))
    for dx, dy in ((-150000, 140000), (150000, -140000), (499712 - 500000 - 5, 5406720 - 5400000 - 5), (149990, 149990)):
        yield from ((x + dx, y + dy, z + 0.3 * x) for x, y, z in rows)


class Zones(Case):
    """Clouds too wide for floats around one origin: zones have origins of their own."""

    def setUp(self):
        super().setUp()
        self.rows = list(wide_survey())
        self.rows += [(-3e5, 2e5, 50.0), (2e5, 3e5, 1e5), (0.0, -3e5, -9e4)]  # strays, in zones of their own
        random.Random(2).shuffle(self.rows)
        self.wide = write_las(self.path("wide.las"), self.rows, [(2, 2, 2, 7, 6)[i % 5] for i in range(len(self.rows))])

    def same(self, *flags, ways):
        """One result, however the work is cut."""
        whole, cut = self.path("whole.las"), self.path("cut.las")
        self.ok("run", self.wide, whole, "-q", "--force", *flags)
        self.assertNotEqual(las_grid(whole), las_grid(self.wide))
        for way in ways:
            with self.subTest(flags=flags, way=way):
                self.ok("run", self.wide, cut, "-q", "--force", *way, *flags)
                self.assertEqual(whole.read_bytes(), cut.read_bytes())

    def test_no_bit_depends_on_tiles_and_memory(self):
        ways = [["--tiles", 1, "--work", self.path("work")], ["--tiles", 7], ["--tiles", 60], ["--memory", "64M"]]
        self.same(ways=ways)
        shutil.rmtree(self.path("work"))
        self.same("--k", 8, ways=ways)
        for flags in (["--radius", 0.9], ["--outliers", "mark"], ["--method", "mls"], ["--strength", 0.4],
                      ["--where", "classification=2,6", "--ignore", "classification=7"],
                      ["--viewpoint", "500000,5400000,9000", "--along", "ray"],
                      ["--k", 12, "--constraint", "on", "--iterations", 3]):
            self.same(*flags, ways=[["--tiles", 23]])

    def test_points_that_repeat_others_have_the_same_bits_in_any_tiles(self):
        """Near copies, of which some follow a point of another zone, and some lie in zones of a few points."""
        generator = random.Random(3)
        side = 0.05 * math.sqrt(2000)
        rows = [(generator.random() * side + dx, generator.random() * side + dy, generator.gauss(0, 0.005) + dz)
                for dx, dy, dz in ((-1, -1, 0), (3e5, 3e5, 100), (-3e5, 2e5, 50)) for _ in range(2000)]
        few = [(x + 20 * i, y, z) for i, (x, y, z) in enumerate(generator.sample(rows, 40))]
        rows += few
        whole, cut = self.path("whole.ply"), self.path("cut.ply")
        for apart in (1e-4, 1e-8):  # many floats, and less than one
            copied = [tuple(c + generator.gauss(0, apart) for c in p) for p in generator.sample(rows, 1500) + few]
            wide = write_binary(self.path("copies.ply"), rows + copied, "double")
            self.assertGreater(self.report("run", wide, whole, "-q", "--force")["copies"], 1000)
            for tiles in (2, 5, 9, 14):
                with self.subTest(apart=apart, tiles=tiles):
                    self.ok("run", wide, cut, "-q", "--force", "--tiles", tiles)
                    self.assertEqual(whole.read_bytes(), cut.read_bytes())

    def test_limits_have_the_same_bits_in_tiles_near_the_middle_of_a_zone(self):
        """There offsets are finer than the doubles of positions. The ground stands upright, at the middle along y."""
        def places(middle):
            rows = [(x + apart, middle + h, z) for apart in (-3e5, 0, 3e5) for x, z, h in ground(900)]
            return write_binary(self.path("double.ply"), rows, "double")
        side = self.report("info", places(54e5))["float_step"] * 2**25
        cloud = places((54e5 // side + 0.5) * side)
        self.assertEqual(self.report("info", cloud)["float_step"] * 2**25, side)
        for flags in (["--strength", 0.4], ["--strength", 0.4, "--ignore", "number=3-900"], ["--ignore", "number=3-900"]):
            self.ok("run", cloud, self.path("whole.ply"), "-q", "--force", *flags)
            with self.subTest(flags=flags):
                self.ok("run", cloud, self.path("cut.ply"), "-q", "--force", "--tiles", 3, *flags)
                self.assertEqual(self.path("whole.ply").read_bytes(), self.path("cut.ply").read_bytes())

    def test_several_files_are_one_cloud(self):
        self.ok("run", self.wide, self.path("whole.las"), "-q")
        third = len(self.rows) // 3 + 1
        parts = [write_las(self.path(f"part{i}.las"), self.rows[i * third:(i + 1) * third], [2] * third) for i in range(3)]
        self.ok("run", *parts, "--out-dir", self.path("fair"), "-q", "--tiles", 5)
        found = [p for part in parts for p in las_grid(self.path("fair") / part.name)]
        self.assertEqual(found, las_grid(self.path("whole.las")))

    def test_a_run_that_was_killed_goes_on(self):
        self.ok("run", self.wide, self.path("whole.las"), "-q")
        begin = time.monotonic()
        self.ok("run", self.wide, self.path("tiled.las"), "--tiles", 9, "-q")
        duration = time.monotonic() - begin
        self.ok("tile", "plan", self.wide, "--out", self.path("out.las"), "--work", self.path("work"), "--tiles", 9)
        generator = random.Random(5)
        for _ in range(60):
            worker = subprocess.Popen([BIN, "tile", "run", self.path("work"), "--all", "-q"])
            try:
                if worker.wait(generator.uniform(0, duration)) == 0:
                    break
            except subprocess.TimeoutExpired:
                worker.send_signal(signal.SIGKILL)
                worker.wait()
        self.assertEqual(worker.returncode, 0)
        self.assertEqual(self.path("out.las").read_bytes(), self.path("whole.las").read_bytes())

    def test_zones_follow_from_the_points_whatever_the_plan_guessed(self):
        self.ok("run", self.wide, self.path("wide-whole.las"), "-q")
        narrow = write_las(self.path("narrow.las"), ground(4000), [2] * 4000)
        self.ok("run", narrow, self.path("narrow-whole.las"), "-q")
        for cloud, guess in ((self.wide, "0x0p+0"), (self.wide, "0x1p+11"), (narrow, "0x1p+4")):
            out, work = self.path("out.las"), self.path("work")
            self.ok("tile", "plan", cloud, "--out", out, "--work", work, "--tiles", 6, "--force")
            plan = (work / "plan.txt").read_text()
            before, after = plan.split("\nzones ")
            (work / "plan.txt").write_text(before + "\nzones " + guess + after[after.index(" "):])
            self.ok("tile", "run", work, "--all", "-q")
            self.assertEqual(out.read_bytes(), self.path(cloud.stem + "-whole.las").read_bytes())
            shutil.rmtree(work)

    def test_far_places_are_denoised_as_near_ones(self):
        """Oracle: the plane of the ground. Floats around one origin step by 16 mm there."""
        flat = [(x + dx, y + dx, 0.7 * x + noise) for dx in (-149000, 0, 149000) for (x, y, _), (_, _, noise) in
                zip(ground(2500), ((0, 0, random.Random(i).gauss(0, 0.02)) for i in range(2500)))]
        cloud = write_las(self.path("flat.las"), flat, [2] * len(flat))
        self.ok("run", cloud, self.path("out.las"), "-q")
        errors = []
        for place, dx in enumerate((-149000, 0, 149000)):
            part = las_grid(self.path("out.las"))[place * 2500:(place + 1) * 2500]
            errors.append(math.sqrt(sum((0.001 * z - 0.7 * (0.001 * x - dx)) ** 2 for x, _, z in part) / 2500))
        self.assertLess(max(errors), 1.05 * errors[1], errors)
        self.assertLess(errors[1], 0.008)

    def test_zones_are_said_and_floats_are_fine_in_them(self):
        result = self.ok("run", self.wide, self.path("out.las"))
        self.assertIn("in zones", result.stderr.decode())
        self.assertNotIn("coarse against", result.stderr.decode())
        steps = [self.report("run", self.wide, self.path("out.las"), "--force", "-q", "--tiles", tiles)["float_step"] for tiles in (1, 5)]
        steps.append(self.report("info", self.wide)["float_step"])
        self.assertEqual(len(set(steps)), 1)
        self.assertLess(steps[0], 0.0003)

    def test_what_else_is_written_changes_no_position(self):
        self.ok("run", self.wide, self.path("alone.las"), "--k", 8, "-q")
        for words in (["--write-noise"], ["--write-displacement"]):
            result = self.ok("run", self.wide, self.path("more.las"), "--force", "--k", 8, *words)
            self.assertIn("in zones where", result.stderr.decode())
            self.assertNotIn("around one origin all the same", result.stderr.decode())
            self.assertEqual(las_grid(self.path("more.las")), las_grid(self.path("alone.las")))
        result = self.ok("run", self.wide, self.path("normals.ply"), "--k", 8, "--normals", "write")
        self.assertIn("around one origin all the same", result.stderr.decode())

    def test_the_noise_of_each_point_follows_zones_and_normals_that_would_mean_nothing_are_refused(self):
        """Two planes 10,000 km apart, where floats around one origin step by a metre."""
        generator = random.Random(4)
        points = [(dx + generator.uniform(0, 7), generator.uniform(0, 7), generator.gauss(0, 0.02))
                  for dx in (0, 1e7) for _ in range(20000)]
        cloud = write_binary(self.path("two.ply"), points, "double")
        for words, expected in (([], 0.02), (["--noise", 0.03], 0.03), (["--noise", "0.4s"], 0.02)):
            self.ok("run", cloud, self.path("noise.ply"), "-q", "--force", "--write-noise", *words)
            noise = [row["noise"] for row in read_ply(self.path("noise.ply"))]
            self.assertGreater(min(noise), 0.7 * expected, words)
            self.assertLess(max(noise), 1.4 * expected, words)
        self.fails(2, "run", cloud, self.path("normals.ply"), "--normals", "write", says=["too wide for normals", "less wide"])
        words = ["run", cloud, self.path("normals.ply"), "--normals", "write", "--progress", "plain"]
        before_the_run = run(*words).stderr.decode()
        self.assertIn("reading", before_the_run)
        self.assertNotIn("denoise", before_the_run)

    def test_what_follows_no_zones_is_done_around_one_origin(self):
        result = self.ok("run", self.wide, self.path("out.las"), "--method", "learned")
        self.assertNotIn("in zones where", result.stderr.decode())

    def test_files_that_lie_far_apart_are_one_run(self):
        near, far = ([(x + 5e5 + apart, y + 5.4e6, z) for x, y, z in ground(900)] for apart in (0, 4e6))
        far[5], far[8] = (NAN, 5e6, 3.0), (1e25, 5e6, 3.0)
        files = [write_binary(self.path(f"{name}.ply"), points, "double") for name, points in (("near", near), ("far", far))]
        report = self.report("run", *files, "--out-dir", self.path("fair"), "-q")
        self.assertLess(report["float_step"], 0.002)
        alone = write_binary(self.path("twice.ply"), near + far, "double")
        self.ok("run", alone, self.path("out.ply"), "-q", "--tiles", 6)
        found = [self.path("fair") / file.name for file in files]
        bodies = [path.read_bytes().split(b"end_header\n", 1)[1] for path in found + [self.path("out.ply")]]
        rows = [[body[i:i + 24] for i in range(0, len(body), 28)] for body in bodies]  # without the numbers
        self.assertEqual(rows[1][8], struct.pack("<3d", *far[8]))
        self.assertEqual(rows[0] + rows[1], rows[2])
