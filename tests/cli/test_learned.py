# SPDX-License-Identifier: Apache-2.0
"""--method learned on the command line: it moves points, takes a file of weights, and refuses what it cannot do."""
import pathlib
import random
import struct

from program import Case, positions, run, sphere_points, write_ply

WEIGHTS = pathlib.Path(__file__).resolve().parents[2] / "src" / "learned" / "weights.bin"


class Learned(Case):
    def setUp(self):
        super().setUp()
        self.source = write_ply(self.path("in.ply"), sphere_points(4000, 0.02))

    def result(self, *flags):
        out = self.path("out.ply")
        self.ok("run", self.source, out, "-q", "--force", *flags)
        return out.read_bytes()

    def refused(self, *flags):
        done = run("run", self.source, self.path("refused.ply"), "-q", *flags)
        self.assertNotEqual(done.returncode, 0)
        text = done.stderr.decode()
        self.assert_one_line(text)
        return text

    def test_it_differs_from_the_default_run_and_its_own_file_gives_the_same(self):
        learned = self.result("--method", "learned")
        self.assertNotEqual(learned, self.result())
        self.assertEqual(learned, self.result("--method", "learned", "--weights", WEIGHTS))
        self.assertEqual(learned, self.result("--method", "learned", "--threads", 3))

    def test_points_that_come_to_one_place_do_not_make_it_depend_on_their_order(self):
        def single(value):
            return struct.unpack("<f", struct.pack("<f", value))[0]
        foot = single(0.3048)
        for seed in (4, 22, 47):
            rng = random.Random(seed)
            points = [tuple(single(rng.gauss(0, 1) ** 3) for _ in range(3)) for _ in range(300)]
            points += [tuple(single(single(c / foot) * foot) for c in p) for p in points]  # most are the same, others a bit off
            results = []
            for order in (range(600), sorted(range(600), key=points.__getitem__), range(599, -1, -1)):
                write_ply(self.path("in.ply"), [points[i] for i in order])
                self.result("--method", "learned")
                results.append(dict(zip(order, positions(self.path("out.ply")))))
            self.assertEqual(results[0], results[1])
            self.assertEqual(results[0], results[2])

    def test_files_that_hold_no_weights_are_refused_in_one_line(self):
        self.assertIn("this is no file of weights", self.refused("--method", "learned", "--weights", self.source))
        cut = self.path("cut.bin")
        cut.write_bytes(WEIGHTS.read_bytes()[:1000])
        self.assertIn("cut.bin: the file of weights has 1000 bytes", self.refused("--method", "learned", "--weights", cut))
        self.assertIn("cannot be read", self.refused("--method", "learned", "--weights", self.path("none.bin")))

    def test_tiles_on_disk_and_rays_are_refused_in_one_line(self):
        self.assertIn("in tiles on disk", self.refused("--method", "learned", "--tiles", 4))
        self.assertIn("--along ray needs a method", self.refused("--method", "learned", "--along", "ray"))
