#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the programs of examples/: what they print and write. test_examples.py FOLDER_OF_THE_PROGRAMS"""
import math
import pathlib
import random
import subprocess
import sys
import tempfile
import unittest

PROGRAMS = pathlib.Path(sys.argv.pop(1)).resolve()


def write_ply(path, points):
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}", *(f"property float {a}" for a in "xyz"), "end_header"]
    path.write_text("\n".join([*head, *("%.6g %.6g %.6g" % p for p in points), ""]))


def read_ply(path):
    """The header's properties and the rows of an ascii file."""
    head, body = path.read_text().split("end_header\n")
    names = [line.split()[-1] for line in head.splitlines() if line.startswith("property")]
    return names, [tuple(map(float, line.split())) for line in body.splitlines()]


def waves(seed, sigma=0.01, count=3000):
    generator = random.Random(seed)
    places = ((generator.random(), generator.random()) for _ in range(count))
    return [(x, y, 0.1 * math.sin(6 * x) + generator.gauss(0, sigma)) for x, y in places]


def off_surface(points):
    return math.sqrt(sum((z - 0.1 * math.sin(6 * x)) ** 2 for x, y, z, *_ in points) / len(points))


class Examples(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_example(self, name, *words):
        command = [PROGRAMS / name, *map(str, words)]
        return subprocess.run(command, check=True, capture_output=True, text=True, cwd=self.folder).stdout

    def test_denoise_file(self):
        write_ply(self.folder / "in.ply", waves(1))
        text = self.run_example("denoise_file", "in.ply", "out.ply")
        noise = float(text.split("noise ")[1].split(",")[0])
        self.assertAlmostEqual(noise, 0.01, delta=0.003)
        self.assertLess(off_surface(read_ply(self.folder / "out.ply")[1]), 0.006)
        missing = subprocess.run([PROGRAMS / "denoise_file", "no.ply", "out2.ply"], capture_output=True, text=True, cwd=self.folder)
        self.assertEqual(missing.returncode, 1)
        self.assertIn("no.ply", missing.stderr)

    def test_change_one_parameter_runs_the_later_stages_only(self):
        write_ply(self.folder / "in.ply", waves(2))
        lines = [line.split(":") for line in self.run_example("change_one_parameter", "in.ply").splitlines()]
        stages = {name: [s for s in rest.split() if s in ("index", "neighbors", "normals", "fairing")] for name, rest in lines}
        self.assertEqual(stages["similarity_sigma changed"], ["fairing"])
        self.assertEqual(stages["crease_angle changed"], ["normals", "fairing"])
        self.assertEqual(stages["radius changed"], ["neighbors", "normals", "fairing"])

    def test_many_frames_are_treated_alike(self):
        for i in range(3):
            write_ply(self.folder / f"frame{i}.ply", waves(10 + i))
        (self.folder / "out").mkdir()
        self.run_example("many_frames", "out", *(f"frame{i}.ply" for i in range(3)))
        for i in range(3):
            self.assertLess(off_surface(read_ply(self.folder / f"out/frame{i}.ply")[1]), 0.006)

    def test_limits_and_outliers(self):
        points = waves(3)
        generator = random.Random(4)
        lifted = range(30, 300, 30)  # at the left, off the surface
        for i in lifted:
            points[i] = (generator.uniform(0.1, 0.4), generator.uniform(0.1, 0.9), generator.choice((-1, 1)) * generator.uniform(0.3, 0.6))
        points[0], points[1] = (0.0, 0.5, 0.0), (1.0, 0.5, 0.1 * math.sin(6))  # so the middle is x = 0.5
        write_ply(self.folder / "in.ply", points)
        self.run_example("limits_and_outliers", "in.ply", "out.ply")
        names, rows = read_ply(self.folder / "out.ply")
        self.assertEqual(names, ["x", "y", "z", "outlier"])
        before = read_ply(self.folder / "in.ply")[1]
        moved = [row[:3] != start for row, start in zip(rows, before)]
        self.assertFalse(any(m for m, (x, *_) in zip(moved, before) if x > 0.5))
        self.assertGreater(sum(moved), 1000)
        marked = [i for i in lifted if rows[i][3] == 1]
        self.assertGreaterEqual(len(marked), 6)
        self.assertFalse(any(moved[i] for i in marked))
        self.assertLess(sum(row[3] for row in rows), 15)


if __name__ == "__main__":
    unittest.main()
