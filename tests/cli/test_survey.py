# SPDX-License-Identifier: Apache-2.0
"""What surveyors ask for: classes, units, integer grids, normals that go stale."""
import csv
import json
import struct

from program import Case, positions, read_ply, run, sphere_points, write_ply
from survey_files import DEGREES, FEET, ground, las_grid, write_e57, write_las, write_old_las


class Survey(Case):
    def setUp(self):
        super().setUp()
        points = list(ground(2500))
        self.classes = [(2, 6, 7, 5)[i % 4] for i in range(len(points))]
        self.las = write_las(self.path("tile.las"), points, self.classes)

    def moved(self, *words):
        """Whether each point moved."""
        self.ok("run", self.las, self.path("out.las"), "--force", "-q", *words)
        return [a != b for a, b in zip(las_grid(self.las), las_grid(self.path("out.las")))]

    def is_built_in(self, *words):
        """False for what this build was made without."""
        result = run(*words)
        self.assertTrue(result.returncode == 0 or b"this build" in result.stderr, result.stderr)
        return result.returncode == 0

    def test_info_says_what_the_file_says(self):
        text = self.ok("info", self.las).stdout.decode()
        for part in ("LAS 1.4", "Somewhere, EPSG:25832", "made by a test", "a scanner", "0.001", "ground", "low noise", "625"):
            self.assertIn(part, text)
        file = self.report("info", self.las)["file"]
        self.assertEqual(file["classes"], {"2": 625, "5": 625, "6": 625, "7": 625})
        self.assertEqual(file["returns"], {"1": 2500})
        self.assertEqual(file["metres_per_unit"], 1)
        self.assertEqual(file["point_format"], "6")

    def test_a_cloud_in_degrees_is_refused_where_points_would_move(self):
        las = write_las(self.path("degrees.las"), ground(900), [2] * 900, crs=DEGREES)
        for words in ([self.path("out.las")], [self.path("out.las"), "--tiles", "3"], [self.path("out.las"), "--noise", "5mm"]):
            self.fails(3, "run", las, *words, says=["degrees.las: ", "in degrees", "project it"])
        self.fails(3, "tile", "plan", las, "--out", self.path("out.las"), "--work", self.path("work"), says="project it")
        self.assertIn("degrees: project it", self.ok("info", las).stdout.decode())
        self.assertIs(self.report("info", las)["file"]["geographic"], True)
        self.assertIs(self.report("info", self.las)["file"]["geographic"], False)
        self.ok("compare", las, las)
        self.ok("noise", las, self.path("noisy.las"))
        for words in ([], ["--tiles", "3"]):
            self.ok("run", las, self.path("out.las"), "--force", "--strength", "0", *words)
            self.assertEqual(self.path("out.las").read_bytes(), las.read_bytes())

    def test_clouds_in_feet_are_no_e57_files(self):
        feet = write_las(self.path("feet.las"), ground(900), [2] * 900, crs=FEET)
        degrees = write_las(self.path("degrees.las"), ground(900), [2] * 900, crs=DEGREES)
        for source, unit, words in ((feet, "0.3048 m", []), (degrees, "a degree", ["--strength", 0])):
            self.fails(2, "run", source, self.path("o.e57"), *words, says=["E57 files are in metres", unit])
            self.assertFalse(self.path("o.e57").exists())
        self.assertTrue(self.is_built_in("run", self.las, self.path("o.e57"), "-q"))

    def test_a_table_of_files_has_their_units(self):
        write_las(self.path("feet.las"), ground(900), [2] * 900, crs=FEET)
        write_las(self.path("none.las"), ground(900), [2] * 900, crs=b"")
        write_las(self.path("degrees.las"), ground(900), [2] * 900, crs=DEGREES)
        rows = self.ok("info", self.folder).stdout.decode().splitlines()
        units = {row.rsplit("/", 1)[-1]: row[46:56].strip() for row in rows[1:]}
        self.assertEqual(rows[0][46:56].strip(), "unit")
        self.assertEqual(units, {"degrees.las": "degrees", "feet.las": "0.3048 m", "none.las": "unknown", "tile.las": "1 m"})

    def test_reports_of_runs_have_the_unit(self):
        feet = write_las(self.path("feet.las"), ground(900), [2] * 900, crs=FEET)
        none = write_las(self.path("none.las"), ground(900), [2] * 900, crs=b"")
        units = ((feet, 0.3048), (none, None), (self.las, 1))
        for las, unit in units:
            for words in ([], ["--tiles", 3], ["--strength", 0]):
                report = self.report("run", las, self.path("out.las"), "--force", "-q", *words)
                self.assertEqual(report["metres_per_unit"], unit, words)
        for name in ("rows.csv", "rows.json"):
            words = ["--each", "--out-dir", self.path(name + ".d"), "--report", self.path(name), "-q"]
            self.ok("run", feet, none, self.las, *words)
        with open(self.path("rows.csv"), newline="") as file:
            self.assertEqual([row["metres_per_unit"] for row in csv.DictReader(file)], ["0.3048", "", "1"])
        rows = json.loads(self.path("rows.json").read_text())["files"]
        self.assertEqual([row["run"]["metres_per_unit"] for row in rows], [unit for _, unit in units])

    def test_heights_of_another_unit_are_told(self):
        wkt = b'COMPD_CS["both",PROJCS["UTM",UNIT["metre",1]],VERT_CS["heights",UNIT["US survey foot",0.304800609601219]]]'
        las = write_las(self.path("mixed.las"), ground(900), [2] * 900, crs=wkt)
        note = "heights are in units of 0.3048006096 m, X and Y in units of 1 m"
        for words in ([], ["--tiles", 3]):
            said = self.ok("run", las, self.path("out.las"), "--force", *words).stderr.decode()
            self.assertIn(note, said)
            self.assertIn('"Z = Z * 0.3048006096"', said)
        self.assertNotIn("heights", self.ok("run", las, self.path("out.las"), "--force", "--strength", 0).stderr.decode())
        self.assertNotIn("heights", self.ok("run", self.las, self.path("out.las"), "--force").stderr.decode())
        self.assertIn("unit of heights    0.3048006096 m", self.ok("info", las).stdout.decode())
        self.assertAlmostEqual(self.report("info", las)["file"]["metres_per_height"], 0.3048006)
        self.assertEqual(self.report("info", self.las)["file"]["metres_per_height"], 1)

    def test_distances_between_feet_and_metres_are_refused(self):
        feet = write_las(self.path("feet.las"), ground(2500), self.classes, crs=FEET)
        for words in (("compare", self.las, feet), ("certify", self.las, feet, "--report", self.path("r.html"))):
            self.fails(2, *words, says=["tile.las", "feet.las", "the unit of one is 1 m and that of the other 0.3048 m"])
        self.assertFalse(self.path("r.html").exists())

    def test_info_shows_bounds_with_the_digits_of_the_file(self):
        text = self.ok("info", self.las).stdout.decode()
        for axis, offset in enumerate((500000, 5400000, 100)):
            values = [point[axis] for point in las_grid(self.las)]
            self.assertIn("  {}  {:.10g} .. {:.10g}\n".format("xyz"[axis], *(offset + v / 1000 for v in (min(values), max(values)))), text)

    def test_wrong_outputs_are_refused_before_the_run(self):
        self.assertIn(b"fairing", self.ok("run", self.las, self.path("good.las"), "--progress", "plain").stderr)
        for words in (["out.las", "--las-scale", "0.003"], ["out.laz", "--encoding", "ascii"], ["out.stl"], ["out.glb"], ["out.kitti"]):
            result = run("run", self.las, self.path(words[0]), *words[1:], "--progress", "plain")
            self.assertNotIn(b"fairing", result.stderr)
            self.assertIn(result.returncode, (2, 3))

    def test_where_moves_only_such_points(self):
        for words, kinds in ((["--where", "classification=2"], {2}), (["--where", "classification=2,6"], {2, 6}),
                             (["--where", "classification=2-6", "--where", "classification=5-9"], {5, 6})):
            moved = self.moved(*words)
            self.assertEqual({kind for kind, m in zip(self.classes, moved) if m}, kinds)

    def test_others_are_still_neighbours(self):
        alone = self.moved("--where", "classification=2")
        grid = las_grid(self.path("out.las"))
        self.ok("run", self.las, self.path("all.las"), "-q")
        all_points = las_grid(self.path("all.las"))
        self.assertEqual([g for g, k in zip(grid, self.classes) if k == 2], [g for g, k in zip(all_points, self.classes) if k == 2])
        self.assertTrue(any(alone))

    def test_ignored_points_are_nobodys_neighbours(self):
        """Oracle: a file without them."""
        moved = self.moved("--ignore", "classification=7")
        self.assertFalse(any(m for m, kind in zip(moved, self.classes) if kind == 7))
        kept = [(p, k) for p, k in zip(ground(2500), self.classes) if k != 7]
        write_las(self.path("without.las"), [p for p, _ in kept], [k for _, k in kept])
        self.ok("run", self.path("without.las"), self.path("expected.las"), "-q")
        got = [g for g, kind in zip(las_grid(self.path("out.las")), self.classes) if kind != 7]
        expected = las_grid(self.path("expected.las"))
        # offsets from another origin round differently: one step
        self.assertLessEqual(max(abs(a - b) for g, e in zip(got, expected) for a, b in zip(g, e)), 1)
        report = self.report("run", self.las, self.path("r.las"), "--ignore", "classification=7", "--where", "classification=2")
        self.assertEqual(report["unmoved"]["ignored"], 625)
        self.assertEqual(report["unmoved"]["held"], 1250)
        self.assertEqual(report["unmoved"]["non_finite"], 0)

    def test_names_of_attributes_are_found_whatever_their_case(self):
        points, classes = list(ground(400)), [2, 6, 7, 5] * 100
        vegetation = write_ply(self.path("in.ply"), points, extra=[("uchar", "Classification", classes),
                                                                   ("float", "Sigma", [0.01] * 400)])
        text = self.path("in.csv")
        rows = ["%.3f,%.3f,%.3f,%.3f,.01\n" % (*p, kind) for p, kind in zip(points, classes)]
        text.write_text("X,Y,Z,Classification,Sigma\n" + "".join(rows))
        for source in (vegetation, text):
            for words in ([], ["--tiles", 2]):
                job = ["run", source, self.path("out" + source.suffix), "--force", *words]
                report = self.report(*job, "--ignore", "classification=5", "--where", "CLASSIFICATION=2", "--noise", "sigma")
                self.assertEqual((report["unmoved"]["ignored"], report["unmoved"]["held"]), (100, 200))
        text.write_text(text.read_text().replace("Sigma", "classification", 1).replace("Classification", "CLASSIFICATION", 1))
        self.fails(2, "run", text, self.path("out.csv"), "--force", "--where", "Classification=2",
                   says="it has CLASSIFICATION, classification")
        self.fails(2, "run", text, self.path("out.csv"), "--force", "--where", "classification=2",
                   says="not one integer a point")

    def test_marks_for_which_an_e57_file_has_no_place_are_refused_before_the_run(self):
        scan = write_e57(self.path("in.e57"), ground(900))
        if self.is_built_in("info", scan):
            job = ["run", scan, self.path("out.e57"), "--outliers", "mark"]
            self.fails(2, *job, says=["E57", "write PLY, PCD or LAZ", "--outliers keep"])
            self.assertNotIn(b"fairing", run(*job, "--progress", "plain").stderr)
            self.ok("run", scan, self.path("out.ply"), "--outliers", "mark", "-q")

    def test_wrong_selections_are_one_line(self):
        out = self.path("out.las")
        self.fails(2, "run", self.las, out, "--where", "classification", says="--where")
        self.fails(2, "run", self.las, out, "--ignore", "classification=ground", says="--ignore")
        self.fails(2, "run", self.las, out, "--where", "class=2", says="no attribute 'class'")
        self.fails(2, "run", self.las, out, "--where", "gps_time=2", says="gps_time")

    def test_lengths_carry_units_where_the_file_has_one(self):
        write_las(self.path("feet.las"), ground(2500), self.classes, crs=FEET)
        cases = [("tile.las", "5mm", 0.005), ("tile.las", "2cm", 0.02), ("feet.las", "1ft", 1), ("feet.las", "0.3048m", 1)]
        write_e57(self.path("scan.e57"), ground(900))
        if self.is_built_in("info", self.path("scan.e57")):
            cases.append(("scan.e57", "5mm", 0.005))
        for name, words, expected in cases:
            used = self.report("run", self.path(name), self.path("out" + name[-4:]), "--force", "--noise", words)["params"]
            self.assertAlmostEqual(used["noise"], expected)
        cloud = write_ply(self.path("in.ply"), sphere_points(300, 0.01))
        self.fails(2, "run", cloud, self.path("out.ply"), "--noise", "5mm", says=["--noise", "unit"])
        write_las(self.path("plain.las"), ground(900), self.classes, crs=b"")
        self.fails(2, "run", self.path("plain.las"), self.path("out2.las"), "--radius", "5cm", says=["--radius", "unit"])
        self.fails(2, "run", self.las, self.path("out2.las"), "--noise", "5km", says="--noise")

    def test_a_cloud_too_wide_for_floats_is_said(self):
        for name, apart, is_said in ("wide", 60_000, True), ("narrow", 60, False):
            rows = ["%.4f %.4f %.4f" % (4e5 + (i % 2) * apart + x, 5e6 + y, 100 + z)
                    for i, (x, y, z) in enumerate(ground(4000, noise=0.004))]
            self.path(f"{name}.xyz").write_text("\n".join(rows) + "\n")
            step = self.report("info", self.path(f"{name}.xyz"))["float_step"]
            self.assertEqual(step, 2 ** -8 if is_said else 2 ** -17)  # up to 34 km and 70 m from the origin
            for words in (["info"], ["run"], ["run", "--memory", "64M"]):
                out = [self.path("out.xyz"), "--force"] if words[0] == "run" else []
                result = self.ok(words[0], self.path(f"{name}.xyz"), *out, *words[1:])
                said = (result.stdout + result.stderr).decode()
                self.assertEqual("in steps of 0.003906" in said, is_said, said)

    def test_a_coarse_grid_is_said_and_refined(self):
        coarse = write_las(self.path("coarse.las"), ground(2500, noise=0.004), self.classes, scale=0.01)
        result = self.ok("run", coarse, self.path("out.las"))
        self.assertIn("--las-scale", result.stderr.decode())
        self.ok("run", coarse, self.path("fine.las"), "--las-scale", "0.001")
        self.assertEqual(self.report("info", self.path("fine.las"))["file"]["step"], 0.001)
        for name in ("r.las", "r.laz", "r.copc.laz"):
            report = self.report("run", self.las, self.path(name))
            self.assertAlmostEqual(report["rounding"]["rms"], 0.000288675, places=8)
        self.assertNotIn("--las-scale", self.ok("run", self.las, self.path("quiet.las")).stderr.decode())
        self.fails(2, "run", coarse, self.path("out3.las"), "--las-scale", "0.003", says="divided by a whole number")
        self.fails(2, "run", coarse, self.path("out3.las"), "--las-scale", "0", says="divided by a whole number")

    def test_copc_says_that_the_coordinate_system_stands_in_old_keys(self):
        keys = struct.pack("<8H", 1, 1, 0, 1, 3072, 0, 1, 25832)
        record = struct.pack("<H16sHH32s", 0, b"LASF_Projection", 34735, len(keys), b"")
        old = write_old_las(self.path("old.las"), ground(900))
        data = bytearray(old.read_bytes())
        struct.pack_into("<II", data, 96, 227 + len(record + keys), 1)
        old.write_bytes(bytes(data[:227]) + record + keys + bytes(data[227:]))
        self.assertIn("EPSG:25832", self.ok("info", old).stdout.decode())
        for source, is_old in ((old, True), (self.las, False)):
            if self.is_built_in("run", source, self.path("out.copc.laz"), "--force", "-q"):
                said = self.ok("run", source, self.path("out.copc.laz"), "--strength", "0", "--force").stderr.decode()
                self.assertEqual("stays in GeoTIFF keys" in said, is_old)

    def test_copc_says_that_the_order_changes(self):
        if self.is_built_in("run", self.las, self.path("out.copc.laz")):
            many = write_las(self.path("many.las"), list(ground(72 ** 2)), [2] * 72 ** 2)
            for las, changes in ((self.las, False), (many, True)):
                said = self.ok("run", las, self.path("again.copc.laz"), "--strength", "0", "--force").stderr.decode()
                self.assertEqual("note: COPC files keep their points in the order of an octree" in said, changes, said)
                self.ok("run", self.path("again.copc.laz"), self.path("back.las"), "--strength", "0", "-q", "--force")
                self.assertEqual(las_grid(self.path("back.las")) == las_grid(las), not changes)
                self.assertEqual(sorted(las_grid(self.path("back.las"))), sorted(las_grid(las)))


class Normals(Case):
    def setUp(self):
        super().setUp()
        points = sphere_points(800, 0.01)
        inward = [("float", "n" + axis, [-p[i] for p in points]) for i, axis in enumerate("xyz")]
        self.cloud = write_ply(self.path("in.ply"), points, extra=inward + [("int", "id", list(range(800)))])

    def normals(self, path):
        return [(p["nx"], p["ny"], p["nz"]) for p in read_ply(path)]

    def sides(self, path):
        """The cosines between normals and the way out."""
        return [sum(a * b for a, b in zip(p, n)) for p, n in zip(positions(path), self.normals(path))]

    def test_stale_normals_are_said_and_kept(self):
        result = self.ok("run", self.cloud, self.path("out.ply"))
        self.assertIn("--normals update", result.stderr.decode())
        self.assertEqual(self.normals(self.cloud), self.normals(self.path("out.ply")))
        self.assertNotIn("--normals", self.ok("run", self.cloud, self.path("out2.ply"), "--strength", "0").stderr.decode())

    def test_updated_normals_follow_and_keep_their_side(self):
        self.ok("run", self.cloud, self.path("out.ply"), "--normals", "update", "-q")
        self.assertTrue(all(abs(sum(v * v for v in n) - 1) < 1e-4 for n in self.normals(self.path("out.ply"))))
        self.assertLess(max(self.sides(self.path("out.ply"))), -0.8)  # inward, as before

    def test_a_file_without_normals(self):
        cloud = write_ply(self.path("plain.ply"), sphere_points(800, 0.01))
        self.fails(2, "run", cloud, self.path("out.ply"), "--normals", "update", says="--normals write")
        self.ok("run", cloud, self.path("out.ply"), "--normals", "write", "-q")
        self.assertGreater(min(self.sides(self.path("out.ply"))), 0.8)  # outward

    def test_points_outside_the_limits_keep_theirs(self):
        self.ok("run", self.cloud, self.path("out.ply"), "--normals", "update", "--where", "id=0-99", "-q")
        before, after = self.normals(self.cloud), self.normals(self.path("out.ply"))
        self.assertEqual(before[100:], after[100:])
        self.assertNotEqual(before[:100], after[:100])
