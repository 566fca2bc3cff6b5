# SPDX-License-Identifier: Apache-2.0
"""Runs in tiles on disk say the same of a run as runs in memory."""
import random

from program import Case, positions, run, write_ply
from survey_files import ground, write_e57, write_las, write_old_las


def scan_with_outliers(count=2500):
    """A ground with points above it, so that there is something to count."""
    points = list(ground(count))
    for i in range(0, len(points), 50):
        points[i] = (points[i][0], points[i][1], points[i][2] + 0.5)
    return points


class Reports(Case):
    """A run in tiles reports the numbers of the run in memory."""

    def of_both(self, source, *words, suffix):
        whole = self.report("run", source, self.path("whole" + suffix), "--force", *words)
        cut = self.report("run", source, self.path("cut" + suffix), "--force", "--tiles", 3, *words)
        self.assertEqual(self.path("whole" + suffix).read_bytes(), self.path("cut" + suffix).read_bytes())
        return whole, cut

    def test_points_that_a_writer_asks_for_twice_count_once(self):
        scan, tile = write_e57(self.path("in.e57"), scan_with_outliers()), self.path("in.las")
        write_las(tile, scan_with_outliers(), [2, 6] * 1250)
        for source in (scan, tile):
            if b"this build" in run("info", source).stderr:
                continue
            whole, cut = self.of_both(source, "--box", "0,0,-9,6e5,6e6,999", suffix=source.suffix)
            self.assertEqual(whole["unmoved"], cut["unmoved"])
            self.assertEqual(whole["outliers"], cut["outliers"])
            if source == scan:
                self.assertGreater(whole["unmoved"]["outliers"], 0)
        for source, box in ((scan, "0,0,-9,5,5,9"), (tile, "5e5,54e5,0,500005,5400005,999")):
            if b"this build" in run("info", source).stderr:
                continue
            whole, cut = self.of_both(source, "--box", box, suffix=source.suffix)
            self.assertGreater(whole["unmoved"]["held"], 0)
            self.assertEqual(whole["unmoved"], cut["unmoved"])

    def test_the_keys_are_those_of_the_run_in_memory(self):
        write_ply(self.path("in.ply"), scan_with_outliers())
        whole, cut = self.of_both(self.path("in.ply"), suffix=".ply")
        self.assertEqual(list(whole), list(cut))
        for key in ("device", "params", "noise", "unmoved", "outliers", "displacement", "peak_bytes"):
            self.assertEqual(list(whole[key]), list(cut[key]), key)
        self.assertEqual([step["name"] for step in cut["stages"]],
                         ["plan", "ingest", "measure", "denoise-1", "denoise-2", "emit"])
        self.assertAlmostEqual(sum(step["ms"] for step in cut["stages"]), cut["total_ms"], delta=1e-6 * cut["total_ms"])
        self.assertGreater(cut["peak_bytes"]["host"], 2 ** 20)

    def test_how_far_points_moved(self):
        source = write_las(self.path("in.las"), scan_with_outliers(), [2, 6] * 1250)
        for words in ([], ["--where", "classification=2"], ["--ignore", "classification=6"], ["--iterations", 2]):
            whole, cut = self.of_both(source, *words, suffix=".las")
            self.assertGreater(whole["displacement"]["mean"], 0)
            for name, within in (("mean", 1e-6), ("rms", 1e-5), ("p95", 1e-2), ("max", 1e-6)):
                expected = whole["displacement"][name]
                self.assertAlmostEqual(cut["displacement"][name], expected, delta=within * expected, msg=name)
            self.assertEqual(whole["rounding"], cut["rounding"])
            self.assertGreater(cut["total_ms"], 0)
            self.assertEqual(whole["unmoved"], cut["unmoved"])

    def test_how_far_points_moved_in_several_files_and_a_run_that_went_on(self):
        files = [write_las(self.path(f"{i}.las"), scan_with_outliers()[i * 1250:(i + 1) * 1250], [2] * 1250) for i in (0, 1)]
        joined = write_las(self.path("joined.las"), scan_with_outliers(), [2] * 2500)
        expected = self.report("run", joined, self.path("out.las"), "--tiles", 2)["displacement"]
        job = ["run", *files, "--out-dir", self.path("out"), "--work", self.path("work"), "--tiles", 2]
        self.assertEqual(self.report(*job)["displacement"], expected)
        self.assertEqual(self.report(*job)["displacement"], expected)  # from what was done
        report = self.report("tile", "merge", self.path("work"))
        self.assertEqual(report["displacement"], expected)
        self.assertEqual((report["stages"], report["total_ms"], report["peak_bytes"]["host"]), (None, None, None))

    def test_the_lines_say_how_far_points_moved(self):
        source = write_las(self.path("in.las"), scan_with_outliers(), [2] * 2500)
        lines = [self.ok("run", source, self.path("out.las"), "--force", *words).stderr.decode().splitlines()
                 for words in ([], ["--tiles", 3])]
        for line in (line for line in lines[0] if "points moved" in line or "rounding" in line):
            self.assertIn(line, lines[1])

    def test_points_that_moved_in_an_iteration_are_not_kept(self):
        source = write_ply(self.path("in.ply"), [(-44.3001, -1.1321, 0.3358), (-44.5069, -0.886, 0.3286),
                                                 (-44.4487, -0.886, 0.3694), (-44.9522, -1.3493, -0.6077)])
        for words in ([], ["--tiles", 3]):
            report = self.report("run", source, self.path("out.ply"), "--force", "--noise", "0.003", *words)
            moved = sum(a != b for a, b in zip(positions(source), positions(self.path("out.ply"))))
            kept = sum(report["unmoved"][reason] for reason in ("too_few_neighbors", "no_normal", "outliers"))
            self.assertGreater(moved, 0)
            self.assertLessEqual(moved + kept, 4)

    def test_outliers_that_are_pulled_in_are_counted(self):
        points = list(ground(2500))
        for i in random.Random(4).sample(range(2500), 25):
            points[i] = (*points[i][:2], points[i][2] + 3)
        source, words = write_ply(self.path("in.ply"), points), ["--outliers", "move"]
        whole, cut = self.of_both(source, *words, suffix=".ply")
        again = self.report("run", source, self.path("out.ply"), *words, "--iterations", 3, "--tiles", 2)
        for report in (whole, cut, again):
            self.assertIn(report["pulled"], range(22, 28))  # of 25
            self.assertEqual(sum(report["outliers"].values()), report["pulled"])
            self.assertEqual(report["outliers"], whole["outliers"])
            self.assertEqual(report["unmoved"]["outliers"], 0)
        for tiles in ([], ["--tiles", 3]):
            text = self.ok("run", source, self.path("out.ply"), "--force", *words, *tiles).stderr.decode()
            self.assertRegex(text, r"\n%d outliers pulled in: \d+ (isolated|off the surface)" % whole["pulled"])
        self.assertEqual(self.report("run", source, self.path("out.ply"), "--force")["pulled"], 0)
        rows = self.path("rows.csv")
        self.ok("run", "--each", source, "--out-dir", self.path("out"), "--report", rows, *words)
        self.assertIn(f",{whole['pulled']},", rows.read_text().splitlines()[1])

    def test_limits_that_select_nothing_are_said(self):
        points = list(ground(900))
        points[400] = (points[400][0], points[400][1], 9.0)  # an outlier, which is told as such
        source = write_las(self.path("in.las"), points, [2] * 900)
        for limit in (["--where", "classification=99"], ["--box", "0,0,0,1,1,1"], ["--ignore", "classification=2"]):
            for words in ([], ["--tiles", 3]):
                text = self.ok("run", source, self.path("out.las"), "--force", *limit, *words).stderr.decode()
                self.assertTrue(text.startswith("0 points denoised"), text)
                self.assertIn("note: the limits, such as --where and --box, leave no point to denoise", text)
                self.assertEqual(source.read_bytes(), self.path("out.las").read_bytes())
        text = self.ok("run", source, self.path("out.las"), "--force", "--box", "500000,5400000,0,500004,5400004,200").stderr.decode()
        self.assertNotIn("no point", text)
        self.assertNotIn("900 points denoised", text)

    def write_grid(self, path):
        """An organised PCD file of 50 x 50 points, some of which are outliers. Returns the path."""
        head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 50\nHEIGHT 50\nPOINTS 2500\nDATA ascii\n"
        rows = [(x, y, z + 5 * (i % 61 == 30)) for i, (x, y, z) in enumerate(ground(2500))]
        path.write_text(head + "".join("%.4f %.4f %.4f\n" % row for row in rows))
        return path

    def notes_of_both(self, source, output, *words):
        notes = [self.report("run", source, output, "--force", *words, *tiles)["notes"] for tiles in ([], ["--tiles", 3])]
        self.assertEqual(sorted(notes[0]), sorted(notes[1]))
        return "\n".join(notes[1])

    def write_mesh(self, path, head):
        """A grid of 20 x 20 points with faces that uses a picture or materials beside it. Returns the path."""
        points = list(ground(400))
        faces = [(i, i + 1, i + 20) for i in range(380) if i % 20 < 19]
        if path.suffix == ".ply":
            extra = [("float", name, [0.5] * 400) for name in ("texture_u", "texture_v")]
            write_ply(path, points, faces, extra=extra)
            path.write_text(path.read_text().replace("ascii 1.0\n", "ascii 1.0\n" + head, 1))
        else:
            rows = ["v %.4f %.4f %.4f" % p for p in points] + ["f %d %d %d" % tuple(i + 1 for i in face) for face in faces]
            path.write_text("\n".join([head, *rows, ""]))
        return path

    def test_what_stays_behind_and_is_not_followed_is_told_as_in_memory(self):
        for name in ("t.png", "m.mtl"):
            self.path(name).write_bytes(b"x")
        self.path("out").mkdir()
        for name, head in (("in.ply", "comment TextureFile t.png\n"), ("in.obj", "mtllib m.mtl")):
            source = self.write_mesh(self.path(name), head)
            told = self.notes_of_both(source, self.path("out") / name)
            self.assertIn("361 faces of the file are not followed", told)
            self.assertIn("beside the input only lies what the result names: " + head.split()[-1], told)
            self.assertNotIn("not followed", self.notes_of_both(source, self.path("out") / name, "--connectivity", "points"))
            copied = self.ok("run", source, self.path("out") / name, "--force", "--strength", 0).stderr.decode()
            self.assertIn("beside the input only", copied)
            self.assertNotIn("not followed", copied)
        grid = self.write_grid(self.path("grid.pcd"))
        told = self.notes_of_both(grid, self.path("out.pcd"))
        self.assertIn("its grid does not tell: --viewpoint x,y,z finds points between two surfaces", told)
        self.assertNotIn("its grid", self.notes_of_both(grid, self.path("out.pcd"), "--viewpoint", "none"))

    def test_verbose_runs_print_parameters_and_times(self):
        source = write_ply(self.path("in.ply"), scan_with_outliers())
        lines = [self.ok("run", source, self.path("out.ply"), "--force", "-v", *words).stderr.decode().splitlines()
                 for words in ([], ["--tiles", 3])]
        heads = [its[:[line.split()[0] for line in its].index("tangential") + 1] for its in lines]
        self.assertEqual(heads[0], heads[1])
        self.assertTrue(heads[1][0].startswith("device "), heads[1])
        steps = [line.split()[0] for line in lines[1] if line.endswith(" ms")]
        self.assertEqual(steps, ["plan", "ingest", "measure", "denoise-1", "denoise-2", "emit"])

    def test_noise_that_was_not_measured_is_not_told(self):
        rng = random.Random(1)
        source = write_ply(self.path("in.ply"), [[rng.gauss(0, 1) for _ in range(3)] for _ in range(300)])
        lengths = [word for flag in ("similarity-sigma", "closeness-sigma", "normal-sigma") for word in ("--" + flag, "1")]
        words = ["--k", 20, *lengths, "--outliers", "off", "--tiles", 2]
        said = self.ok("run", source, self.path("out.ply"), *words).stderr.decode()
        self.assertRegex(said, r"\nnote: moves of up to \d\S* are large against the cloud, whose diagonal is \d\S*; compare")

    def write_text(self, path):
        path.write_text("".join("%.4f %.4f %.4f\n" % p for p in scan_with_outliers()))
        return path

    def test_what_is_lost_is_told_and_refused_as_in_memory(self):
        normals = [("float", name, [float(name == "nz")] * 2500) for name in ("nx", "ny", "nz")]
        with_normals = write_ply(self.path("normals.ply"), scan_with_outliers(), extra=normals)
        indexed = write_las(self.path("indexed.las"), scan_with_outliers(), [2] * 2500)
        self.path("indexed.lax").write_bytes(b"an index")
        octree = self.path("octree.copc.laz")
        self.ok("run", indexed, octree, "--strength", 0, "-q")
        cases = [(self.write_grid(self.path("grid.pcd")), "out.pcd", "remove", "has gaps now", True),
                 (self.write_text(self.path("names.xyz")), "out.xyz", "mark", "do not name their columns", True),
                 (with_normals, "out.ply", "keep", "the normals in the file are", False),
                 (indexed, "out.las", "keep", "indexed.lax does not fit points that moved", True),
                 (octree, "out.laz", "keep", "the COPC index of the input", True)]
        for source, out, action, says, is_loss in cases:
            for words in ([], ["--tiles", 3]):
                job = ["run", source, self.path(out), "--outliers", action, *words]
                notes = [note for note in self.report(*job, "--force")["notes"] if says in note]
                self.assertEqual(len(notes), 1, job)
                self.path(out).unlink()
                if is_loss:
                    self.fails(3, *job, "--strict", says=[out, says, "--strict"])
                else:
                    self.ok(*job, "--strict", "-q")

    def test_what_does_not_come_to_be_is_no_loss(self):
        grid = self.write_grid(self.path("grid.pcd"))
        words = ["--outliers", "remove", "--box", "0,0,50,1,1,51", "--tiles", 3]
        notes = self.report("run", grid, self.path("out.pcd"), *words)["notes"]
        self.assertEqual([note for note in notes if "gaps" in note], [])
        self.assertEqual(grid.read_bytes(), self.path("out.pcd").read_bytes())

    def test_a_run_that_goes_on_may_become_strict(self):
        names, work = self.write_text(self.path("names.xyz")), ["--work", self.path("work"), "--tiles", 2]
        job = ["run", names, self.path("out.xyz"), "--outliers", "mark", *work]
        said = self.ok(*job).stderr.decode()
        self.assertIn("do not name their columns", said)
        self.assertIn("do not name their columns", self.ok(*job).stderr.decode())  # as the plan has it
        self.fails(3, *job, "--strict", says="do not name their columns")

    def test_of_many_files_not_every_one_is_told(self):
        points = scan_with_outliers(1024)
        for n in range(16):
            write_las(self.path(f"{n}.las"), points[64 * n:64 * n + 64], [2] * 64)
            self.path(f"{n}.lax").write_bytes(b"an index")
        files = [self.path(f"{n}.las") for n in range(16)]
        notes = self.report("run", *files, "--out-dir", self.path("out"))["notes"]
        self.assertEqual(len([note for note in notes if "does not fit points that moved" in note]), 10)
        self.assertIn("6 more notes of this kind are on other files", notes)

    def test_one_file_by_two_names_is_refused(self):
        source = write_las(self.path("in.las"), list(ground(900)), [2] * 900)
        link = self.path("link.las")
        link.symlink_to(source)
        self.path("out").mkdir()
        for other in (link, source):
            self.fails(2, "run", source, other, "--out-dir", self.path("out"), says=[f"{other}: ", str(source), "same file"])
        self.fails(2, "tile", "plan", source, link, "--out-dir", self.path("out"), "--work", self.path("work"), says="same file")
