# SPDX-License-Identifier: Apache-2.0
"""Outliers in the words of the trade: LAS classes, the withheld flag, and marks with their reason."""
import math
import random
import struct
import unittest

from program import Case, read_ply, write_ply
from survey_files import ground, las_grid, write_las

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

    def test_las_files_lose_points_and_say_what_else(self):
        said = self.run_with("remove")
        self.assertEqual(len(records(self.out)), 3560)
        self.assertEqual([record[KINDS] for record in records(self.out)],
                         [kind for i, kind in enumerate(self.classes) if i not in self.low + self.high])
        self.assertIn("40 points are removed", said)
        self.ok("run", self.las, self.path("h.las"), "--outliers", "remove", "--where", "classification=5", "-q")
        self.assertEqual(len(records(self.path("h.las"))), 3600 - len(self.high))

    def test_what_cannot_be_is_refused(self):
        for words, says in (("classify=x", "0 to 255"), ("classify=256", "0 to 255"), ("classify=", "0 to 255"), ("classified", "--outliers")):
            self.fails(2, "run", self.las, self.out, "--outliers", words, says=says)
        self.fails(2, "run", self.las, self.out, "--outliers", "classify", "--tiles", "2", says=["classify", "--outliers mark", "--each"])
        self.fails(2, "run", self.las, self.out, "--outliers", "remove", "--tiles", "2", says="remove")
        self.fails(2, "run", self.las, self.path("o.off"), "--outliers", "classify", says="--outliers")


if __name__ == "__main__":
    unittest.main()
