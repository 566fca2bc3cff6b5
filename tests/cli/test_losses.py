# SPDX-License-Identifier: Apache-2.0
"""What a conversion loses is told, --strict refuses it, and options say what a text does not."""
from pathlib import Path

from program import Case, positions, sphere_points, write_ply
from survey_files import ground, write_old_las

DOCUMENTATION = Path(__file__).resolve().parents[2] / "docs" / "formats.md"
ROWS = "".join(f"{x % 10} {x // 10} 0.5\n" for x in range(100))


class Losses(Case):
    def put(self, name, text):
        self.path(name).write_text(text)
        return self.path(name)

    def notes(self, *words):
        text = self.ok("run", *words, "--device", "cpu", "--strength", "0").stderr.decode()
        return [line for line in text.splitlines() if line.startswith("note: ")]

    def test_every_loss_is_a_note(self):
        head = "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 100\nproperty float x\nproperty float y\nproperty float z\n"
        mesh = self.put("a.ply", head + "element face 1\nproperty list uchar int vertex_indices\nend_header\n" + ROWS + "3 0 1 11\n")
        notes = self.notes(mesh, self.path("b.pcd"))
        self.assertEqual(notes, ["note: PCD files have no place for 1 face", "note: PCD files have no place for 1 comment"])
        self.assertEqual(self.notes(mesh, self.path("b.ply")), [])

    def test_a_mark_that_the_file_has_no_place_for_is_a_note(self):
        rows = ROWS.splitlines()
        texts = {"a.obj": "".join(f"v {row}\n" for row in rows), "a.off": "OFF\n100 0 0\n" + ROWS,
                 "a.ptx": "100\n1\n0 0 9\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" + "".join(f"{row} 0.5\n" for row in rows)}
        for name, text in texts.items():
            notes = self.notes(self.put(name, text), self.path("b" + name[1:]), "--outliers", "mark")
            self.assertEqual([note for note in notes if "no place for the attribute outlier;" in note], notes[:1], name)
            self.assertEqual(len(notes), 1, name)

    def test_a_cloud_that_las_cannot_hold_is_named(self):
        cloud = self.put("a.xyz", "nan 1 2\n" + ROWS)
        says = ["a.xyz: a LAS file holds finite coordinates only"]
        self.fails(2, "run", cloud, self.path("b.las"), "--device", "cpu", says=says)

    def test_strict_refuses_a_loss_before_the_run(self):
        mesh = self.put("a.obj", "".join("v " + row + "\n" for row in ROWS.splitlines()) + "f 1 2 12\n")
        self.fails(3, "run", mesh, self.path("b.pcd"), "--strict", "--device", "cpu", says=["b.pcd", "no place for 1 face", "--strict"])
        self.ok("run", mesh, self.path("b.ply"), "--strict", "--device", "cpu")
        self.fails(2, "run", mesh, self.path("b.glb"), "--strict", "--device", "cpu", says="read, not written")

    def test_waveforms_in_capitals_come_along_and_missing_ones_are_told(self):
        scan = write_old_las(self.path("A.LAS"), ground(400))
        data = bytearray(scan.read_bytes())
        data[6] = 4  # the waveforms are in a file of their own
        scan.write_bytes(data)
        says = "waveforms are in a file of their own, and no .wdp file"
        for tiles in ([], ["--tiles", 2]):
            said = self.ok("run", scan, self.path("B.LAS"), "--force", *tiles).stderr.decode()
            self.assertIn(says, said)
            self.ok("run", scan, self.path("B.LAS"), "--force", "--strict", "-q", *tiles)  # the run loses nothing
        self.path("A.WDP").write_bytes(b"waves")
        for tiles in ([], ["--tiles", 2]):
            said = self.ok("run", scan, self.path("C.LAS"), "--force", *tiles).stderr.decode()
            self.assertNotIn(says, said)
            self.assertEqual(self.path("C.WDP").read_bytes(), b"waves")
            self.path("C.WDP").unlink()

    def test_a_scale_that_is_too_fine_is_refused_for_that(self):
        scan = write_old_las(self.path("a.las"), ground(400))
        said = self.fails(2, "run", scan, self.path("b.las"), "--las-scale", "1e-9",
                          says=["1e-09", "less than a million times finer", "0.001"])
        self.assertNotIn("whole number", said)
        self.fails(2, "run", scan, self.path("b.las"), "--las-scale", "0.0007", says="divided by a whole number")

    def test_new_las_files_reach_small_clouds_wherever_they_are(self):
        for size, place in ((0.05, 0.5), (1e-3, -0.7), (1e-6, 123.4), (3.0, 4.5e6), (1e-9, 0.999)):
            points = [tuple(place + size * share for share in at) for at in ((0, 0, 0), (1, 0.3, 0.7), (0.2, 1, 0.9))]
            cloud = write_ply(self.path("a.ply"), points, scalar="double")
            for words in (("b.las",), ("b.laz",), ("b.copc.laz",), ("b.las", "--las-scale", size * 1e-9)):
                with self.subTest(size=size, place=place, words=words):
                    self.ok("run", cloud, self.path(words[0]), *words[1:], "--strength", 0, "-q", "--force")
                    self.ok("run", self.path(words[0]), self.path("c.ply"), "--strength", 0, "-q", "--force")
                    for before, after in zip(points, positions(self.path("c.ply"))):
                        for p, q in zip(before, after):
                            self.assertLess(abs(p - q), 1e-8 * size + 4e-16 * abs(place))

    def test_the_scale_of_a_new_las_file_is_a_length(self):
        cloud = write_ply(self.path("a.ply"), sphere_points(100, 0.01))
        for scale in ("inf", "nan", "0", "-0.001"):
            self.fails(2, "run", cloud, self.path("b.las"), "--las-scale", scale, says=["scale cannot be", "such as 0.001"])

    def test_coordinates_that_are_integers_are_rounded_and_the_run_says_so(self):
        header = "ply\nformat ascii 1.0\nelement vertex 900\n" + "".join(f"property int {axis}\n" for axis in "xyz")
        rows = "".join(f"{10 * (i % 30)} {10 * (i // 30)} {i * i % 7 // 6}\n" for i in range(900))
        self.put("a.ply", header + "end_header\n" + rows)
        self.ok("run", self.path("a.ply"), self.path("b.ply"), "--encoding", "binary", "--strength", 0, "-q")
        for name in ("a.ply", "b.ply"):
            for words in ((), ("--tiles", 2)):
                said = self.ok("run", self.path(name), self.path("c.ply"), "--noise", 0.3, "--force", *words).stderr.decode()
                self.assertIn("coordinates are stored in steps of 1: rounding adds 0.29 on each axis", said)
                self.assertIn("the steps of 1 between stored coordinates are coarse against the noise of 0.3", said)
            self.assertEqual(self.report("info", self.path(name))["file"]["step"], 1)
        self.assertNotIn("steps", self.ok("run", self.path("a.ply"), self.path("c.pcd"), "--noise", 0.3).stderr.decode())

    def test_a_length_in_metres_is_not_repeated_in_a_unit_that_nobody_typed(self):
        said = self.fails(2, "run", self.put("a.xyz", ROWS), self.path("b.xyz"), "--noise", "3mm", says="how long its unit is")
        self.assertNotIn("0.003m", said)

    def test_new_normals_are_refused_where_the_old_ones_stay(self):
        mesh = self.put("a.obj", "".join(f"v {row}\nvn 0 0 1\n" for row in ROWS.splitlines()))
        self.fails(2, "run", mesh, self.path("b.obj"), "--normals", "update", "--device", "cpu", says="not renewed")
        self.ok("run", mesh, self.path("b.ply"), "--normals", "update", "--device", "cpu")

    def test_no_flag_is_advised_that_the_format_refuses(self):
        mesh = self.put("a.obj", "".join(f"v {x % 10} {x // 10} {x % 7 / 9}\nvn 0 0 1\n" for x in range(100)))
        said = [self.ok("run", mesh, self.path(name), "--noise", "1").stderr.decode() for name in ("b.obj", "b.ply")]
        self.assertIn("note: the normals in the file are those from before; OBJ files keep theirs: write PLY", said[0])
        self.assertIn("from before; --normals update replaces them", said[1])

    def test_normals_that_the_file_has_no_place_for_are_none_from_before(self):
        mesh = self.put("a.obj", "".join(f"v {x % 10} {x // 10} {x % 7 / 9}\nvn 0 0 1\n" for x in range(100)) +
                        "".join(f"f {x} {x + 1} {x + 11}\n" for x in range(1, 89)))
        for name in ("b.stl", "b.ptx"):
            said = self.ok("run", mesh, self.path(name), "--noise", "1").stderr.decode()
            self.assertIn("files have no place for the normals", said)
            self.assertNotIn("from before", said)

    def test_columns_and_lines_that_the_file_does_not_explain(self):
        text = "A;B;C;D\n" + "".join("7;" + row.replace(" ", ";") + "\n" for row in ROWS.splitlines())
        table = self.put("a.data", text)
        words = ["--in-format", "csv", "--columns", "i,x,y,z"]
        self.fails(3, "info", table, says="unknown format")
        self.fails(3, "info", table, "--in-format", "csv", says=["'A', 'B', 'C', 'D'", "--columns"])
        info = self.report("info", table, *words, "--device", "cpu")
        self.assertEqual([attribute["name"] for attribute in info["attributes"]], ["i"])
        self.ok("run", table, self.path("b.csv"), *words, "--strength", "0", "--device", "cpu")
        self.assertEqual(self.path("b.csv").read_text(), text)
        self.assertEqual(self.report("info", table, *words, "--skip", "11", "--device", "cpu")["points"], 90)
        self.fails(2, "info", table, "--columns", "x,y", says="x, y and z must be there")

    def test_the_documentation_has_the_table(self):
        table = self.ok("doctor", "--losses").stdout.decode()
        self.assertIn(table, DOCUMENTATION.read_text())
