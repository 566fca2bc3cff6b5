# SPDX-License-Identifier: Apache-2.0
"""Outliers in the words of the trade: LAS classes, the withheld flag, and marks with their reason."""
import math
import random
import struct

from program import Case, read_ply, run, write_ply
from survey_files import ground, las_grid, write_las, write_old_las

KINDS, FLAGS = 16, 15  # places in a record of point format 6


def records(path):
    data = path.read_bytes()
    begin, length = struct.unpack_from("<I", data, 96)[0], struct.unpack_from("<H", data, 105)[0]
    count = struct.unpack_from("<Q", data, 247)[0]
    return [data[begin + i * length:begin + (i + 1) * length] for i in range(count)]


class Classes(Case):
    def setUp(self):
        super().setUp()
        points = list(ground(3600))
        rng = random.Random(2)
        self.low = rng.sample(range(0, 3600, 2), 15)
        self.high = rng.sample(range(1, 3600, 2), 25)
        for i in self.low + self.high:
            x, y, z = points[i]
            points[i] = (x, y, z + rng.uniform(2, 9) * (1 if i in self.high else -1))
        self.classes = [(2, 5)[i % 2] for i in range(3600)]
        self.las = write_las(self.path("in.las"), points, self.classes)
        self.points, self.out = points, self.path("out.las")

    def run_with(self, words):
        return self.ok("run", self.las, self.out, "--force", "--outliers", words).stderr.decode()

    def test_low_and_high_noise_get_their_classes(self):
        said = self.run_with("classify")
        after = [record[KINDS] for record in records(self.out)]
        self.assertEqual({i for i, kind in enumerate(after) if kind == 7}, set(self.low))
        self.assertEqual({i for i, kind in enumerate(after) if kind == 18}, set(self.high))
        self.assertTrue(all(kind == own for kind, own in zip(after, self.classes) if kind not in (7, 18)))
        self.assertIn("15 outliers are in class 7 (low noise), 25 in class 18 (high noise)", said)

    def test_one_class_may_be_named(self):
        self.assertIn("40 outliers are in class 7", self.run_with("classify=7"))
        after = [record[KINDS] for record in records(self.out)]
        self.assertEqual({i for i, kind in enumerate(after) if kind == 7}, set(self.low + self.high))

    def test_the_withheld_flag_is_set(self):
        self.assertIn("40 outliers are flagged as withheld", self.run_with("withheld"))
        before, after = records(self.las), records(self.out)
        for i, (p, q) in enumerate(zip(before, after)):
            self.assertEqual(q[FLAGS], p[FLAGS] | (4 if i in self.low + self.high else 0))
            self.assertEqual(q[KINDS], p[KINDS])

    def test_nothing_else_changes(self):
        self.ok("run", self.las, self.path("kept.las"), "-q")
        self.run_with("classify")
        self.assertEqual(las_grid(self.out), las_grid(self.path("kept.las")))
        for p, q in zip(records(self.path("kept.las")), records(self.out)):
            self.assertEqual(p[:KINDS] + p[KINDS + 1:], q[:KINDS] + q[KINDS + 1:])

    def test_points_that_limits_hold_keep_their_class(self):
        self.ok("run", self.las, self.out, "--outliers", "classify=7", "--where", "classification=5", "-q")
        after = [record[KINDS] for record in records(self.out)]
        self.assertEqual({i for i, kind in enumerate(after) if kind == 7}, set(self.high))  # odd places are of class 5

    def test_noise_among_vegetation_is_told_with_what_to_do(self):
        for words in ("classify", "classify=7", "withheld", "remove"):
            said = self.run_with(words)
            self.assertIn("25 of them had a class of vegetation", said)  # odd places are of class 5
            self.assertIn("--ignore classification=3-5,13-16", said)
            again = self.ok("run", self.las, self.out, "--force", "--outliers", words, "--ignore", "classification=3-5,13-16").stderr.decode()
            self.assertNotIn("vegetation", again)
        write_las(self.las, self.points, [2] * 3600)
        self.assertNotIn("vegetation", self.run_with("classify"))

    def test_other_formats_get_an_attribute(self):
        write_ply(self.path("in.ply"), self.points)
        self.ok("run", self.path("in.ply"), self.path("out.ply"), "--outliers", "classify", "-q")
        kinds = [v["classification"] for v in read_ply(self.path("out.ply"))]
        self.assertEqual([kinds.count(kind) for kind in (0, 7, 18)], [3560, 15, 25])

    def test_marks_say_why_and_are_described(self):
        self.run_with("mark")
        data, names = self.out.read_bytes(), []
        at = data.index(b"LASF_Spec") - 2
        words = data[at + 54 + 160:at + 54 + 192].rstrip(b"\0").decode()
        self.assertEqual(words, "0 none 1 isolated 2 off 3 mixed")
        marks = [record[30] for record in records(self.out)]
        self.assertEqual({i for i, mark in enumerate(marks) if mark}, set(self.low + self.high))
        self.assertLessEqual(set(marks), {0, 1, 2})
        report = self.report("run", self.las, self.path("r.las"))["outliers"]
        self.assertEqual([marks.count(1), marks.count(2)], [report["isolated"], report["off_surface"]])

    def test_removed_points_are_gone_and_the_others_stay(self):
        ids = ("uchar", "part", [i % 251 for i in range(3600)])
        source = write_ply(self.path("in.ply"), self.points, extra=[ids])
        report = self.report("run", source, self.path("out.ply"), "--outliers", "remove")
        self.ok("run", source, self.path("kept.ply"), "-q")
        gone = set(self.low + self.high)
        def rows(name):
            return [struct.pack("<4f", *row.values()) for row in read_ply(self.path(name))]
        self.assertEqual(rows("out.ply"), [row for i, row in enumerate(rows("kept.ply")) if i not in gone])
        self.assertEqual([report["points"], report["removed"], sum(report["outliers"].values())], [3600, 40, 40])
        said = self.ok("run", source, self.path("o.ply"), "--outliers", "remove").stderr.decode()
        self.assertIn("40 points are removed as outliers (", said)
        self.assertIn("3560 are left", said)
        for tiles in ([], ["--tiles", "2"]):  # points that are gone were not kept
            said = self.ok("run", self.las, self.path("o.las"), "--outliers", "remove", "--force", *tiles).stderr.decode()
            self.assertRegex(said, r"^3560 points denoised .*, 0 kept as they were\n")

    def test_pcd_files_keep_all_but_the_removed_points(self):
        """Fields of all kinds, the place of the sensor and remarks. Oracle: the records of the file with them."""
        gone = set(self.low + self.high)
        head = ("# of a test\nVERSION 0.7\nFIELDS x y z rgba _ kind\nSIZE 8 8 8 4 1 2\nTYPE F F F U U U\nCOUNT 1 1 1 1 3 2\n"
                "WIDTH {}\nHEIGHT {}\nVIEWPOINT 5 6 900 1 0 0 0\nPOINTS {}\nDATA {}\n")
        rows = [struct.pack("<3dI3B2H", *point, 0xff000000 - i, 1, 2, 3, i, i % 7) for i, point in enumerate(self.points)]
        own = self.path("in.pcd")
        own.write_bytes(head.format(60, 60, 3600, "binary").encode() + b"".join(rows))
        for encoding in ("binary", "ascii", "binary_compressed"):
            source = own if encoding == "binary" else self.path(f"{encoding}.pcd")
            if source != own:
                self.ok("run", own, source, "--strength", "0", "--encoding", encoding.replace("_", "-"), "-q")
            said = self.ok("run", source, self.path("cut.pcd"), "--outliers", "remove", "--force").stderr.decode()
            self.assertIn("3560 are left", said)
            self.assertNotIn("place of the sensor", said)
            self.assertIn("the grid of 60 x 60 points has gaps now, so the points are one row", said)
            self.ok("run", source, self.path("all.pcd"), "--force", "-q")
            data = self.path("cut.pcd").read_bytes()
            begin = source.read_bytes().index(b"DATA") + len(f"DATA {encoding}\n")
            expected = source.read_bytes()[:begin].replace(b"WIDTH 60", b"WIDTH 3560").replace(b"HEIGHT 60", b"HEIGHT 1")
            expected = expected.replace(b"POINTS 3600", b"POINTS 3560")
            self.assertEqual(data[:len(expected)], expected)
            if encoding == "binary":
                size, body = len(rows[0]), self.path("all.pcd").read_bytes()[begin:]
                left = [body[i * size:(i + 1) * size] for i in range(3600) if i not in gone]
                self.assertEqual(data[len(expected):], b"".join(left))
            elif encoding == "ascii":
                left = [line for i, line in enumerate(self.path("all.pcd").read_bytes()[begin:].splitlines(True)) if i not in gone]
                self.assertEqual(data[len(expected):], b"".join(left))
            else:  # by way of the uncompressed one
                for name in ("cut", "all"):
                    self.ok("run", self.path(f"{name}.pcd"), self.path(f"{name}.csv"), "--strength", "0", "--force", "-q")
                whole = self.path("all.csv").read_text().splitlines()
                self.assertEqual(self.path("cut.csv").read_text().splitlines(),
                                 whole[:1] + [line for i, line in enumerate(whole[1:]) if i not in gone])
            if encoding != "binary_compressed":
                self.ok("run", source, self.path("tiles.pcd"), "--outliers", "remove", "--tiles", 2, "--force", "-q")
                self.assertEqual(self.path("tiles.pcd").read_bytes(), data)
        self.ok("run", own, self.path("text.pcd"), "--outliers", "remove", "--encoding", "ascii", "-q")
        text = self.path("text.pcd").read_text()
        self.assertIn("VIEWPOINT 5 6 900", text)
        self.assertEqual(len(text.split("DATA ascii\n")[1].splitlines()), 3560)

    def test_pcd_headers_in_small_letters_have_the_new_number_of_points(self):
        head = "version 0.7\nfields x y z\nsize 4 4 4\ntype F F F\ncount 1 1 1\nwidth {}\nheight {}\npoints {}\ndata binary\n"
        source, cut = self.path("in.pcd"), self.path("cut.pcd")
        source.write_bytes(head.format(60, 60, 3600).encode() + b"".join(struct.pack("<3f", *p) for p in self.points))
        self.ok("run", source, cut, "--outliers", "remove", "-q")
        self.assertTrue(cut.read_bytes().startswith(head.format(3560, 1, 3560).encode()))
        self.ok("info", cut)

    def test_the_page_on_a_result_without_its_outliers(self):
        ids = ("uchar", "classification", [i % 3 for i in range(3600)])
        source, page = write_ply(self.path("in.ply"), self.points, extra=[ids]), self.path("r.html")
        self.ok("run", source, self.path("out.ply"), "--outliers", "remove", "--report", page)
        html = page.read_text()
        for text in ("3,560, 40 removed as outliers, in the same order", "kept in place, or removed", "the same, byte for byte"):
            self.assertIn(text, html)
        moved = self.report("run", source, self.path("again.ply"))["displacement"]["max"]
        self.assertIn(f"{moved:.4g}"[:4], html)
        self.fails(3, "certify", source, self.path("out.ply"), says=["3600", "3560", "--report of that run makes the page"])

    def test_faces_of_removed_points_go_too(self):
        faces = [(i, i + 1, i + 60) for i in range(3540) if i % 60 < 59]
        self.ok("run", write_ply(self.path("in.ply"), self.points, faces), self.path("out.off"), "--outliers", "remove", "-q")
        lines = self.path("out.off").read_text().splitlines()
        counts = [int(word) for word in lines[1].split()] if lines[0].strip() == "OFF" else [int(word) for word in lines[0].split()[1:]]
        gone = set(self.low + self.high)
        place, kept = {}, [i for i in range(3600) if i not in gone]
        place = {i: number for number, i in enumerate(kept)}
        left = [tuple(place[i] for i in face) for face in faces if not gone & set(face)]
        self.assertEqual(counts[:2], [len(kept), len(left)])
        self.assertEqual([tuple(map(int, line.split()[1:])) for line in lines[-len(left):]], left)

    def test_a_file_without_outliers_is_copied_as_ever(self):
        corners = [(i, i + 1, i + 60) for i in range(1, 3541) if i % 60]
        text = "mtllib a.mtl\nusemtl skin\n" + "".join("v %f %f %f\n" % p for p in ground(3600)) + "".join("f %d %d %d\n" % c for c in corners)
        self.path("in.obj").write_text(text)
        said = self.ok("run", self.path("in.obj"), self.path("out.obj"), "--outliers", "remove").stderr.decode()
        self.assertIn("0 points are removed", said)
        self.assertNotIn("no place for", said)
        self.ok("run", self.path("in.obj"), self.path("kept.obj"), "-q")
        self.assertEqual(self.path("out.obj").read_bytes(), self.path("kept.obj").read_bytes())

    def test_obj_files_lose_points_and_their_faces_and_nothing_else(self):
        corners = [(i, i + 1, i + 60) for i in range(3540) if i % 60 < 59]
        def text(points, faces):
            lines = ["# a scan", "mtllib scan.mtl", "o ground"] + ["v " + p for p in points] + ["vt %d 0.5" % i for i in range(9)]
            for n, face in faces:
                lines += ["usemtl skin%d" % n] * (n % 500 == 0) + ["f " + " ".join("%d/%d" % (i + 1, n % 9 + 1) for i in face)]
            return "\n".join(lines) + "\n"
        faces = list(enumerate(corners))
        self.path("in.obj").write_text(text(["%.9g %.9g %.9g" % p for p in self.points], faces))
        self.ok("run", self.path("in.obj"), self.path("kept.obj"), "-q")
        kept = [line[2:] for line in self.path("kept.obj").read_text().splitlines() if line.startswith("v ")]
        gone = set(self.low + self.high)
        place = {i: number for number, i in enumerate(i for i in range(3600) if i not in gone)}
        left = [(n, [place[i] for i in face]) for n, face in faces if not gone & set(face)]
        lost = {n for n, face in faces if gone & set(face)}
        wanted = text([p for i, p in enumerate(kept) if i not in gone], left)
        for n in lost:  # the line stays where its first face goes
            self.assertNotEqual(n % 500, 0)
        said = self.ok("run", self.path("in.obj"), self.path("out.obj"), "--outliers", "remove", "--strict").stderr.decode()
        self.assertIn("40 points are removed", said)
        self.assertEqual(self.path("out.obj").read_text(), wanted)
        self.ok("run", self.path("in.obj"), self.path("cut.obj"), "--outliers", "remove", "--tiles", 3, "-q")
        self.assertEqual(self.path("cut.obj").read_bytes(), self.path("out.obj").read_bytes())

    def test_ply_files_lose_points_and_their_faces_and_nothing_else(self):
        faces = [(i, i + 1, i + 60) for i in range(3540) if i % 60 < 59]

        def text(points, faces):
            head = ["ply", "format ascii 1.0", "comment a scan", f"element vertex {len(points)}", *(f"property double {axis}" for axis in "xyz"),
                    f"element face {len(faces)}", "property list uchar int vertex_indices", "property uchar flags", "end_header"]
            return "\n".join(head + points + ["3 %d %d %d %d" % (*face, n % 200) for n, face in faces]) + "\n"
        self.path("in.ply").write_text(text(["%.17g %.17g %.17g" % p for p in self.points], list(enumerate(faces))))
        self.ok("run", self.path("in.ply"), self.path("kept.ply"), "-q", "--encoding", "binary")
        kept = ["{x!r} {y!r} {z!r}".format(**p) for p in read_ply(self.path("kept.ply"))]
        gone = set(self.low + self.high)
        place = {i: number for number, i in enumerate(i for i in range(3600) if i not in gone)}
        left = [(n, [place[i] for i in face]) for n, face in enumerate(faces) if not gone & set(face)]
        said = self.ok("run", self.path("in.ply"), self.path("out.ply"), "--outliers", "remove", "--strict", "--encoding", "binary").stderr.decode()
        self.assertIn("40 points are removed", said)
        self.ok("run", self.path("out.ply"), self.path("text.ply"), "--strength", 0, "--encoding", "ascii", "-q")
        wanted, found = (content.split("end_header\n") for content in
                         (text([p for i, p in enumerate(kept) if i not in gone], left), self.path("text.ply").read_text()))
        self.assertEqual(found[0], wanted[0])
        self.assertEqual([[float(word) for word in line.split()] for line in found[1].splitlines()],
                         [[float(word) for word in line.split()] for line in wanted[1].splitlines()])
        self.ok("run", self.path("in.ply"), self.path("cut.ply"), "--outliers", "remove", "--encoding", "binary", "--tiles", 3, "-q")
        self.assertEqual(self.path("cut.ply").read_bytes(), self.path("out.ply").read_bytes())

    def test_las_files_lose_points_and_nothing_else(self):
        self.ok("run", self.las, self.path("kept.las"), "-q")
        said = self.run_with("remove")
        gone = set(self.low + self.high)
        self.assertEqual(records(self.out), [row for i, row in enumerate(records(self.path("kept.las"))) if i not in gone])
        begin = struct.unpack_from("<I", self.las.read_bytes(), 96)[0]
        before, after = self.las.read_bytes()[:begin], self.out.read_bytes()[:begin]
        self.assertEqual(before[:179] + before[375:], after[:179] + after[375:])  # all but bounds and counts; the coordinate system
        self.assertEqual(struct.unpack_from("<QQ", after, 247), (3560, 3560))     # points, and first returns
        self.assertNotIn("no place for", said)
        self.ok("run", self.las, self.path("s.las"), "--outliers", "remove", "--strict", "-q")
        self.assertEqual(self.path("s.las").read_bytes(), self.out.read_bytes())
        self.assertEqual(len(records(self.out)), 3560)
        self.assertEqual([record[KINDS] for record in records(self.out)],
                         [kind for i, kind in enumerate(self.classes) if i not in self.low + self.high])
        self.assertIn("40 points are removed", said)
        self.ok("run", self.las, self.path("h.las"), "--outliers", "remove", "--where", "classification=5", "-q")
        self.assertEqual(len(records(self.path("h.las"))), 3600 - len(self.high))

    # the words, each with what the run in memory has, in one tile or in several
    ACTIONS = (["classify"], ["classify=9"], ["withheld"], ["remove"], ["mark"],
               ["classify", "--where", "classification=5"], ["classify", "--ignore", "classification=5"], ["remove", "--where", "classification=5"],
               ["classify", "--strength", "0.5", "--box", "500000,5400000,-1000,500008,5400011,1000"])

    def test_tiles_have_the_bytes_and_the_report_of_the_run_in_memory(self):
        sources = [self.las, self.path("in.laz")]
        if run("run", self.las, sources[1], "-q", "--strength", 0).returncode != 0:
            sources.pop()
        for source in sources:
            for words in self.ACTIONS:
                whole = self.report("run", source, self.path("whole" + source.suffix), "--force", "--outliers", *words)
                cut = self.report("run", source, self.path("cut" + source.suffix), "--force", "--tiles", 3, "--outliers", *words)
                self.assertEqual(self.path("whole" + source.suffix).read_bytes(), self.path("cut" + source.suffix).read_bytes(), words)
                for key in ("outliers", "removed", "unmoved", "points"):
                    self.assertEqual(whole[key], cut[key], words)
                self.assertGreater(sum(cut["outliers"].values()), 10)
                said = [self.ok("run", source, self.path("o" + source.suffix), "--force", "--outliers", *words, *more).stderr.decode()
                        for more in ([], ["--tiles", 3])]
                notes = [[line for line in text.splitlines() if "outlier" in line or "class 18" in line] for text in said]
                self.assertEqual(notes[0], notes[1])
        write_ply(self.path("in.ply"), self.points)
        for words in ("classify", "withheld"):
            self.ok("run", self.path("in.ply"), self.path("whole.ply"), "--force", "--outliers", words, "-q")
            self.ok("run", self.path("in.ply"), self.path("cut.ply"), "--force", "--outliers", words, "-q", "--tiles", 3)
            self.assertEqual(self.path("whole.ply").read_bytes(), self.path("cut.ply").read_bytes())

    def test_many_files_are_treated_as_one_cloud(self):
        joined = write_las(self.path("joined.las"), self.points, self.classes)
        order = sorted(range(3600), key=lambda i: (self.points[i][0] > 6, self.points[i][1] > 8))
        cuts = [0, 700, 1900, 2600, 3600]
        files = []
        for n, (first, last) in enumerate(zip(cuts, cuts[1:])):
            part = order[first:last]
            files.append(write_las(self.path(f"part{n}.las"), [self.points[i] for i in part], [self.classes[i] for i in part]))
        write_las(joined, [self.points[i] for i in order], [self.classes[i] for i in order])
        for words in self.ACTIONS[:4]:
            whole = self.report("run", joined, self.path("whole.las"), "--force", "--outliers", *words)
            seen = lambda path: [(row[:12], row[FLAGS], row[KINDS]) for row in records(path)]  # times and intensities count from each file's start
            wanted, many = seen(self.path("whole.las")), []
            job = ["run", *files, "--out-dir", self.path("out"), "--force", "--outliers", *words]
            cut = self.report(*job)
            for n in range(4):
                many += seen(self.path("out") / f"part{n}.las")
            self.assertEqual(many, wanted, words)
            for key in ("outliers", "removed", "points"):
                self.assertEqual(cut[key], whole[key])

    def test_a_run_goes_on_with_the_same_action_only(self):
        job = ["--out", self.out, "--work", self.path("work"), "--tiles", 2, "--outliers"]
        self.ok("tile", "plan", self.las, *job, "classify")
        steps = self.report("tile", "status", self.path("work"))["steps"]
        self.assertEqual([step["step"] for step in steps], ["ingest", "measure", "denoise-1", "denoise-2", "heights", "emit"])
        for step in steps:
            for task in range(step["tasks"]):
                self.ok("tile", "run", self.path("work"), "--task", f"{step['step']}:{task}")
        self.ok("run", self.las, self.path("whole.las"), "--outliers", "classify", "-q")
        self.assertEqual(self.out.read_bytes(), self.path("whole.las").read_bytes())
        again = ["run", self.las, self.out, "--work", self.path("work"), "--tiles", 2, "--outliers"]
        said = self.ok(*again, "classify").stderr.decode()
        self.assertIn("15 outliers are in class 7 (low noise), 25 in class 18 (high noise)", said)
        for other in ("classify=7", "remove", "mark"):
            self.fails(2, *again, other, says="--outliers")

    def test_a_file_of_nothing_but_outliers_is_refused_with_its_name(self):
        parts = [self.low + self.high, [i for i in range(3600) if i not in self.low + self.high]]
        files = [write_las(self.path(f"part{n}.las"), [self.points[i] for i in part], [2] * len(part)) for n, part in enumerate(parts)]
        result = run("run", *files, "--out-dir", self.path("out"), "--outliers", "remove")
        self.assertNotEqual(result.returncode, 0)
        self.assertIn("part0.las: none of its points would be left", result.stderr.decode())

    def test_a_class_that_the_point_format_has_not_is_refused_before_the_run(self):
        old = write_old_las(self.path("old.las"), self.points)
        for name in ("o.las", "o.laz", "o.copc.laz"):
            self.fails(2, "run", old, self.path(name), "--outliers", "classify=40",
                       says="point formats 0 to 5 hold classes 0 to 31")
        self.fails(2, "run", old, self.path("o.las"), "--outliers", "classify=32", "--tiles", 2,
                   says="point formats 0 to 5 hold classes 0 to 31")
        self.assertIn("40 outliers are in class 31", self.ok("run", old, self.out, "--outliers", "classify=31").stderr.decode())
        kinds = [self.out.read_bytes()[227 + 20 * i + 15] for i in range(3600)]
        self.assertEqual([kinds.count(kind) for kind in (2, 31)], [3560, 40])
        self.ok("run", self.las, self.out, "--outliers", "classify=40", "--force", "-q")
        self.ok("run", old, self.path("o.ply"), "--outliers", "classify=40", "-q")

    def test_point_formats_without_a_class_for_high_noise_get_the_class_of_noise(self):
        """The table of classes for point formats 0 to 5 has 7 for noise, and reserves 10, 11 and 13 to 31."""
        old = write_old_las(self.path("old.las"), self.points)
        kinds = lambda path: [path.read_bytes()[227 + 20 * i + 15] & 31 for i in range(3600)]
        for tiles in ([], ["--tiles", 3]):
            said = self.ok("run", old, self.out, "--force", "--outliers", "classify", *tiles).stderr.decode()
            self.assertIn("note: 40 outliers are in class 7 (noise); "
                          "point formats 0 to 5 of LAS have no class for high noise\n", said)
            self.assertEqual([kinds(self.out).count(kind) for kind in (2, 7, 18)], [3560, 40, 0])
        for value, is_reserved in ((7, False), (9, False), (11, True), (12, False), (18, True), (31, True)):
            said = self.ok("run", old, self.out, "--force", "--outliers", f"classify={value}").stderr.decode()
            told = f"class {value}, which LAS reserves in point formats 0 to 5; noise is class 7 there\n"
            self.assertEqual(told in said, is_reserved)
            self.assertEqual(kinds(self.out).count(value), 40)
        said = self.ok("run", self.las, self.out, "--force", "--outliers", "classify=31").stderr.decode()
        self.assertNotIn("reserves", said)

    def test_many_files_of_both_kinds_of_point_formats_are_told_in_one_line(self):
        beyond = [x > 6 for x, _, _ in self.points]
        as_they_are = [(x - 5e5, y - 5.4e6, z - 100) for (x, y, z), is_beyond in zip(self.points, beyond) if is_beyond]
        new = write_las(self.path("new.las"), as_they_are, [2] * len(as_they_are), scale=0.01)
        old = write_old_las(self.path("old.las"), [p for p, is_beyond in zip(self.points, beyond) if not is_beyond])
        said = self.ok("run", new, old, "--out-dir", self.path("out"), "--outliers", "classify").stderr.decode()
        self.assertRegex(said, r"note: \d+ outliers are in class 7 \(noise\), \d+ in class 18 \(high noise\); "
                               r"point formats 0 to 5 of LAS have no class")
        self.assertIn(18, [record[KINDS] for record in records(self.path("out") / "new.las")])

    def test_what_cannot_be_is_refused(self):
        for words, says in (("classify=x", "0 to 255"), ("classify=256", "0 to 255"), ("classify=", "0 to 255"), ("classified", "--outliers")):
            self.fails(2, "run", self.las, self.out, "--outliers", words, says=says)
        self.path("in.off").write_text(f"OFF\n{len(self.points)} 0 0\n" + "".join("%r %r %r\n" % p for p in self.points))
        self.fails(2, "run", self.path("in.off"), self.path("o.off"), "--outliers", "remove", "--tiles", "2",
                   says=["in.off", "LAS, LAZ, PCD, PLY, OBJ and text", "--each"])
        self.fails(2, "run", self.las, self.path("o.off"), "--outliers", "classify", says="--outliers")

    def test_a_refusal_of_tiles_says_why_and_what_does_it(self):
        rows = "".join("%r %r %r\n" % p for p in self.points)
        head = "ply\nformat ascii 1.0\nelement vertex 3600\n" + "".join(f"property double {c}\n" for c in "xyz")
        strips = self.path("strips.ply")
        head += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
        strips.write_text(head + rows + "4 0 1 60 61\n")
        said = self.fails(2, "run", strips, self.path("o.ply"), "--outliers", "remove", "--tiles", 2,
                          says=["strips.ply: what this file holds beside its points", "--outliers mark", "--each"])
        self.assertNotIn("text files only", said)
        off = self.path("in.off")
        off.write_text("OFF\n3600 0 0\n" + rows)
        said = self.fails(2, "run", off, self.path("o.off"), "--outliers", "remove", "--tiles", 2,
                          says=["PLY, OBJ and text files only", "--each"])
        self.assertNotIn("mark", said)
        pcd = self.path("in.pcd")
        self.ok("run", strips, pcd, "--strength", 0, "--encoding", "ascii", "-q")
        self.fails(2, "run", pcd, self.path("o.pcd"), "--tiles", 2, "--encoding", "binary",
                   says="keeps the encoding of its file")
        self.fails(2, "run", pcd, self.path("o.ply"), "--tiles", 2, says="is written as PCD; name the output so")
        self.ok("run", strips, self.path("in.npy"), "--strength", 0, "-q")
        self.fails(2, "run", self.path("in.npy"), self.path("o.npy"), "--tiles", 2, "--outliers", "mark",
                   says="no further attributes in NPY files")

    def test_classes_are_found_by_the_names_of_other_programs(self):
        """As PDAL writes them into text. Oracle: the LAS file with the same values."""
        names = "X,Y,Z,Intensity,ReturnNumber,NumberOfReturns,Classification,UserData,PointSourceId,GpsTime\n"
        table, own = self.path("in.csv"), records(self.las)
        rows = [(x + 5e5, y + 5.4e6, z + 100, 100 + i % 7, kind, i * 1e-5)
                for i, ((x, y, z), kind) in enumerate(zip(self.points, self.classes))]
        table.write_text(names + "".join("%.3f,%.3f,%.3f,%d,1,1,%d,5,1,%.5f\n" % row for row in rows))
        self.ok("run", table, self.out, "--strength", 0, "-q")
        for before, after in zip(own, records(self.out)):
            self.assertEqual(before[12:18] + before[20:22], after[12:18] + after[20:22])
            self.assertAlmostEqual(struct.unpack_from("<d", before, 22)[0], struct.unpack_from("<d", after, 22)[0], delta=1e-8)
        for tiles in ([], ["--tiles", 2]):
            said = self.ok("run", table, self.path("out.csv"), "--outliers", "classify", "--force", *tiles).stderr.decode()
            self.assertIn("25 of them had a class of vegetation", said)
            rows = self.path("out.csv").read_text().splitlines()
            self.assertEqual(rows[0] + "\n", names)
            kinds = [int(row.split(",")[6]) for row in rows[1:]]
            self.assertEqual({i for i, kind in enumerate(kinds) if kind == 18}, set(self.high))
        both = self.path("both.csv")  # the plain name goes before another one
        both.write_text("x,y,z,Classification,classification\n" + "".join("%.3f,%.3f,%.3f,9,6\n" % p for p in self.points))
        self.ok("run", both, self.path("both.las"), "--strength", 0, "-q")
        self.assertEqual({(row[KINDS], row[30]) for row in records(self.path("both.las"))}, {(6, 9)})
