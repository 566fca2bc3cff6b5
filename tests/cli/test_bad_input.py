# SPDX-License-Identifier: Apache-2.0
"""Bad input: one clear line, the right exit code, nothing lost, nothing half-written."""
import os
import resource
import shutil
import subprocess
import unittest
from pathlib import Path

from program import BIN, Case, positions, run, sphere_points, write_ply

SANITIZED = any(name in Path(BIN).read_bytes() for name in (b"__asan_init", b"__tsan_init"))
NAN, INF = float("nan"), float("inf")
NOBODY = 65534


class Files(Case):
    def refused(self, name, says=()):
        text = self.fails(3, "run", self.path(name), self.path("out.ply"), says=says)
        self.assertIn(name, text)
        self.fails(3, "info", self.path(name))

    def write(self, name, data):
        self.path(name).write_bytes(data)
        return name

    def test_missing(self):
        self.refused("nothing.ply")

    def test_empty(self):
        for name in ("empty.ply", "empty.pcd", "empty.off"):
            self.refused(self.write(name, b""))

    def test_no_points(self):
        write_ply(self.path("none.ply"), [])
        self.refused("none.ply", says="no points")
        self.refused(self.write("none.off", b"OFF\n0 0 0\n"), says="no points")

    def test_unknown_extension(self):
        self.refused(self.write("scan.shp", b"\0\0\x27\x0a" + bytes(300)))
        cloud = write_ply(self.path("in.ply"), sphere_points(20, 0.01))
        self.fails(3, "run", cloud, self.path("out.shp"), says="out.shp")

    def test_directory(self):
        self.path("folder.ply").mkdir()
        self.refused("folder.ply")
        cloud = write_ply(self.path("in.ply"), sphere_points(20, 0.01))
        self.fails(3, "run", cloud, self.path("folder.ply"), "--force", says="folder.ply")
        self.fails(3, "run", cloud, self.path("none") / "out.ply", says="none")

    def test_every_truncation_of_a_binary_file(self):
        self.ok("noise", write_ply(self.path("in.ply"), sphere_points(20, 0.01)), self.path("whole.ply"),
                "--encoding", "binary", "-q")
        whole = self.path("whole.ply").read_bytes()
        for length in (1, 3, 10, len(whole) - 240, len(whole) - 239, len(whole) - 1):
            self.refused(self.write("cut.ply", whole[:length]))

    def test_more_points_promised_than_there_are(self):
        text = write_ply(self.path("in.ply"), sphere_points(20, 0.01)).read_text()
        self.refused(self.write("more.ply", text.replace("vertex 20", "vertex 21").encode()), says="21")

    def test_points_beyond_all_memory(self):
        header = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        for count in (2**40, 2**62, 2**64 - 1, 10**30):
            for encoding in ("ascii", "binary_little_endian"):
                self.refused(self.write("huge.ply", header.format(encoding, count).encode() + bytes(36)))
        pcd = f"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {2**40}\nHEIGHT 1\nPOINTS {2**40}\nDATA binary\n"
        self.refused(self.write("huge.pcd", pcd.encode() + bytes(36)))

    def test_a_list_where_a_coordinate_should_be(self):
        header = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar float x\nproperty float y\nproperty float z\nend_header\n"
        self.refused(self.write("list.ply", header + b"1 0 0 0\n"))

    def test_words_where_numbers_should_be(self):
        self.refused(self.write("words.ply", write_ply(self.path("in.ply"), [(1.0, 2.0, 3.0)]).read_bytes()
                                .replace(b"2.0", b"two")))

    def as_nobody(self):
        """Options for a run without root's rights, which no permission stops; the program must be in reach."""
        os.chmod(self.folder, 0o777)
        if os.getuid() != 0:
            return BIN, {}
        return shutil.copy(BIN, self.path("program")), {"user": NOBODY, "group": NOBODY}

    def test_no_permission(self):
        program, options = self.as_nobody()
        cloud = write_ply(self.path("in.ply"), sphere_points(20, 0.01))
        secret = write_ply(self.path("secret.ply"), sphere_points(20, 0.01))
        os.chmod(secret, 0)
        locked = self.path("locked")
        locked.mkdir(mode=0o555)
        for words in ((secret, self.path("out.ply")), (cloud, locked / "out.ply")):
            self.fails(3, "run", *words, says="ermission", executable=program, **options)


class Outputs(Case):
    def setUp(self):
        super().setUp()
        self.cloud = write_ply(self.path("in.ply"), sphere_points(300, 0.01))

    def test_an_existing_file_is_kept_without_force(self):
        self.path("out.ply").write_bytes(b"precious")
        self.fails(3, "run", self.cloud, self.path("out.ply"), says="--force")
        self.fails(3, "noise", self.cloud, self.path("out.ply"), says="--force")
        self.assertEqual(self.path("out.ply").read_bytes(), b"precious")
        self.ok("run", self.cloud, self.path("out.ply"), "--force")
        self.assertEqual(len(positions(self.path("out.ply"))), 300)

    def test_output_equal_to_input(self):
        before = self.cloud.read_bytes()
        self.path("link.ply").symlink_to(self.cloud)
        os.link(self.cloud, self.path("hard.ply"))
        for other in (self.cloud, self.folder / "." / "in.ply", self.path("link.ply"), self.path("hard.ply")):
            self.fails(2, "run", self.cloud, other, says="--force")
        self.assertEqual(self.cloud.read_bytes(), before)
        self.ok("run", self.cloud, self.path("expected.ply"))
        self.ok("run", self.cloud, self.cloud, "--force")
        self.assertEqual(self.cloud.read_bytes(), self.path("expected.ply").read_bytes())

    def test_disk_full(self):
        def small_files():
            resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
        needed = len(self.ok("run", self.cloud, "-", "-q").stdout)
        self.fails(3, "run", self.cloud, self.path("out.ply"), says=["out.ply", f"{needed} bytes"], preexec_fn=small_files)
        self.path("old.ply").write_bytes(b"precious")
        self.fails(3, "run", self.cloud, self.path("old.ply"), "--force", says="old.ply", preexec_fn=small_files)
        self.assertEqual(self.path("old.ply").read_bytes(), b"precious")
        self.fails(3, "run", self.cloud, "/dev/full", "--format", "ply", "--force", says="/dev/full")

    def test_standard_output_full(self):
        for words in (["run", self.cloud, "-", "-q"], ["info", self.cloud], ["doctor", "--report", "-"], ["--help"]):
            with open("/dev/full", "wb") as full:
                result = subprocess.run([BIN, *map(str, words)], stdout=full, stderr=subprocess.PIPE)
            self.assertEqual(result.returncode, 3, words)
            self.assert_one_line(result.stderr.decode())

    def test_a_report_that_cannot_be_written(self):
        self.fails(3, "run", self.cloud, self.path("out.ply"), "--report", self.path("none") / "r.json", says="r.json")
        result = run("run", self.cloud, self.path("out.ply"), "--report", "/dev/full", "-q")
        self.assertEqual(result.returncode, 3)
        self.assert_one_line(result.stderr.decode())
        self.assertIn(b"/dev/full", result.stderr)
        self.assertEqual(len(positions(self.path("out.ply"))), 300)

    @unittest.skipIf(SANITIZED, "sanitizers reserve more address space than the limit allows")
    def test_memory(self):
        def little_memory():
            resource.setrlimit(resource.RLIMIT_AS, (2**31, 2**31))
        self.fails(4, "bench", "--points", 10**9, says="memory", preexec_fn=little_memory)
        self.fails(4, "bench", "--points", 2**62, says="memory", preexec_fn=little_memory)


class Shapes(Case):
    """Clouds that leave nothing to fair come back as they were, counted."""

    def fair(self, points, *words, scalar="float"):
        write_ply(self.path("in.ply"), points, scalar=scalar)
        report = self.report("run", self.path("in.ply"), self.path("out.ply"), "--force", *words)
        self.assertEqual(report["points"], len(points))
        self.assertEqual(len(positions(self.path("out.ply"))), len(points))
        return report

    def unchanged(self, points, reason, count=None, *words):
        report = self.fair(points, *words)
        self.assertEqual(self.path("in.ply").read_bytes(), self.path("out.ply").read_bytes())
        self.assertEqual(report["unmoved"][reason], len(points) if count is None else count)
        self.ok("info", self.path("in.ply"))

    def test_one_point(self):
        self.unchanged([(1.0, 2.0, 3.0)], "too_few_neighbors")

    def test_three_points(self):
        self.unchanged(sphere_points(3, 0.0), "too_few_neighbors")

    def test_fewer_than_k(self):
        self.fair(sphere_points(10, 0.01), "--k", 64)

    def test_all_identical(self):
        self.unchanged([(1.5, 2.5, 3.5)] * 100, "no_normal")

    def test_a_line(self):
        self.unchanged([(float(i), 0.0, 0.0) for i in range(100)], "no_normal")

    def test_a_plane_on_cell_borders(self):
        points = [(float(x), float(y), 4.0) for x in range(64) for y in range(64)]
        report = self.fair(points)
        self.assertEqual(report["displacement"]["max"], 0)
        self.assertEqual(self.path("in.ply").read_bytes(), self.path("out.ply").read_bytes())

    def test_not_numbers_and_beyond_all_bounds(self):
        points = sphere_points(500, 0.01)
        bad = {3: (NAN, 0.0, 0.0), 100: (0.0, INF, 0.0), 101: (0.0, 0.0, -INF), 499: (NAN, NAN, NAN),
               250: (1e30, 0.0, 0.0)}
        for i, point in bad.items():
            points[i] = point
        report = self.fair(points, "--k", 16)
        self.assertEqual(report["unmoved"]["non_finite"], len(bad))
        before, after = self.path("in.ply").read_text().splitlines(), self.path("out.ply").read_text().splitlines()
        head = before.index("end_header") + 1
        for i in bad:
            self.assertEqual(before[head + i], after[head + i])
        self.assertGreater(report["displacement"]["mean"], 0)
        self.assertLess(report["displacement"]["max"], 0.2)

    def test_all_far_beyond(self):
        self.unchanged([(1e30 * (i + 1), 0.0, 0.0) for i in range(20)], "non_finite")

    def test_utm_with_millimetres(self):
        centre = (431234.567, 5412345.678, 312.345)
        points = sphere_points(3000, 0.01, centre=centre)
        self.fair(points, scalar="double")
        near = sphere_points(3000, 0.01)
        after = positions(self.path("out.ply"))
        self.fair(near, scalar="double")
        # the rounded offsets have other bits, and so the estimates have other samples
        apart = [abs(p[axis] - (q[axis] - centre[axis]))
                 for p, q in zip(positions(self.path("out.ply")), after) for axis in range(3)]
        self.assertLess(sum(apart) / len(apart), 1e-4)
        self.assertLess(max(apart), 5e-3)

    def test_one_stray_point(self):
        points = sphere_points(500, 0.01) + [(1e7, 1e7, 1e7)]
        report = self.fair(points, "--k", 16)
        self.assertLess(report["displacement"]["mean"], 0.05)


if __name__ == "__main__":
    unittest.main()
