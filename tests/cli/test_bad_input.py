# SPDX-License-Identifier: Apache-2.0
"""Bad input: one clear line, the right exit code, nothing lost, nothing half-written."""
import json
import os
import resource
import shutil
import subprocess
import tempfile
import unittest

from program import BIN, CUBE_FACES, CUBE_VERTICES, SANITIZED, Case, positions, run, sphere_points, write_off, write_ply

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

    def test_a_cloud_without_a_finite_point_is_told_as_such(self):
        nan = float("nan")
        cloud = write_ply(self.path("nan.ply"), [(nan, nan, nan), (1.0, nan, 2.0), (float("inf"), 0.0, 0.0)])
        for words in ((), ("--tiles", "2"), ("--method", "learned")):
            said = self.ok("run", cloud, self.path("out.ply"), "--force", *words).stderr.decode()
            self.assertIn("3 not finite", said)
            self.assertEqual([line for line in said.splitlines() if line.startswith("note: ")],
                             ["note: there is no finite point to denoise, so none moved"])
            self.assertEqual(self.path("out.ply").read_bytes(), cloud.read_bytes())
        self.assertEqual(self.report("info", cloud)["notes"], [])
        self.assertEqual(self.report("info", write_ply(self.path("0.ply"), [(0.0, 0.0, 0.0)] * 20))["notes"], [])

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

    def test_more_points_promised_than_there_are(self):
        text = write_ply(self.path("in.ply"), sphere_points(20, 0.01)).read_text()
        self.refused(self.write("more.ply", text.replace("vertex 20", "vertex 21").encode()), says="21")

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

    @unittest.skipIf(SANITIZED or os.getuid() != 0, "needs root, to run as a user without processes")
    def test_no_thread_can_be_started(self):
        program, _ = self.as_nobody()
        cloud = write_ply(self.path("in.ply"), sphere_points(20, 0.01))
        alone = lambda: resource.setrlimit(resource.RLIMIT_NPROC, (1, 1))
        self.fails(1, "run", cloud, self.path("out.ply"), says="thread", executable=program, user=NOBODY - 700, preexec_fn=alone)


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

    def test_a_report_in_no_folder(self):
        self.fails(3, "run", self.cloud, self.path("out.ply"), "--report", self.path("none") / "r.json", says="r.json")

    def test_a_report_on_a_full_device(self):
        result = run("run", self.cloud, self.path("out.ply"), "--report", "/dev/full", "-q")
        self.assertEqual(result.returncode, 3)
        self.assert_one_line(result.stderr.decode())
        self.assertIn(b"/dev/full", result.stderr)
        self.assertEqual(len(positions(self.path("out.ply"))), 300)

    def test_a_report_is_never_written_over_a_cloud(self):
        out, other = self.path("out.json"), self.path("other.ply")
        other.write_bytes(self.cloud.read_bytes())
        for words in (["run", self.cloud, out, "--format", "ply", "--report", out],
                      ["run", self.cloud, out, "--format", "ply", "--report", self.folder / "." / "out.json"],
                      ["run", self.cloud, self.path("x.ply"), "--report", self.path("new.ply")],
                      ["run", self.cloud, other, "--out-dir", self.folder, "--force", "--report", other],
                      ["info", "--report", other, self.cloud, self.cloud], ["info", self.cloud, other, "--report", other],
                      ["compare", self.cloud, other, "--report", self.path("z.laz")]):
            self.fails(2, *words, says="--report")
        self.assertEqual(other.read_bytes(), self.cloud.read_bytes())
        table = self.path("table.csv")
        table.write_text("x,y,z\n1,2,3\n")
        self.fails(2, "run", table, "--out-dir", self.folder / "new", "--each", "--report", table, says="table.csv")
        self.assertEqual(table.read_text(), "x,y,z\n1,2,3\n")

    def test_a_report_has_any_name_that_a_file_can_have(self):
        longest = "r" * 250 + ".json"
        self.ok("run", self.cloud, self.path("out.ply"), "-q", "--report", self.path(longest))
        self.assertEqual(json.loads(self.path(longest).read_text())["points"], 300)
        self.fails(3, "run", self.cloud, self.path("new.ply"), "--report", self.path("r" + longest), says="too long")
        with tempfile.TemporaryDirectory() as folder:
            small = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10))
            said = self.fails(3, "info", self.cloud, "--report", f"{folder}/r.json", preexec_fn=small)
            self.assertTrue(said.startswith(f"pointfair: {folder}/r.json: cannot write: "), said)
            self.assertEqual(os.listdir(folder), [])

    def test_a_report_follows_links_and_keeps_permissions(self):
        cloud = write_ply(self.path("in.ply"), sphere_points(100, 0.01))
        self.path("real.json").write_text("old")
        self.path("real.json").chmod(0o600)
        self.path("link.json").symlink_to("real.json")
        self.ok("run", cloud, self.path("out.ply"), "-q", "--report", self.path("link.json"))
        self.assertTrue(self.path("link.json").is_symlink())
        self.assertEqual(json.loads(self.path("real.json").read_text())["points"], 100)
        self.assertEqual(self.path("real.json").stat().st_mode & 0o777, 0o600)

    def test_a_link_to_nothing_is_no_output(self):
        link = self.path("link.ply")
        link.symlink_to(self.path("nowhere.ply"))
        for words in ([], ["--force"]):
            self.fails(3, "run", self.cloud, link, *words, says=["link.ply", "nowhere.ply"])

    @unittest.skipIf(SANITIZED, "sanitizers reserve more address space than the limit allows")
    def test_memory(self):
        def little_memory():
            resource.setrlimit(resource.RLIMIT_AS, (2**31, 2**31))
        self.fails(4, "bench", "--points", 10**9, says="memory", preexec_fn=little_memory)
        self.fails(4, "bench", "--points", 2**62, says="memory", preexec_fn=little_memory)

    @unittest.skipIf(SANITIZED, "sanitizers reserve more address space than the limit allows")
    def test_a_corner_far_beyond_the_coordinates_of_an_obj_takes_no_memory(self):
        """A texture coordinate of so high a number took 250 MiB, a bit for each."""
        far = self.path("far.obj")
        far.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/2000000000 2/1 3/1\n")
        little = lambda: resource.setrlimit(resource.RLIMIT_DATA, (200 << 20,) * 2)
        self.ok("run", far, self.path("out.ply"), "-q", preexec_fn=little)


class Streams(Case):
    """Pipes and devices as inputs and outputs, and standard streams that are closed or full."""

    def setUp(self):
        super().setUp()
        write_ply(self.path("in.ply"), sphere_points(300, 0.01))
        self.ok("run", self.path("in.ply"), self.path("plain.ply"), "-q")
        self.expected = self.path("plain.ply").read_bytes()

    def shell(self, line):
        return subprocess.run(["bash", "-c", line], cwd=self.folder, env={**os.environ, "P": BIN}, capture_output=True, timeout=60)

    def test_pipes_and_devices_as_outputs_replace_nothing(self):
        for line in ('"$P" run -q in.ply /dev/stdout', '"$P" run -q in.ply /dev/fd/1', '"$P" run -q in.ply /dev/fd/3 3>&1 | cat',
                     '"$P" run -q in.ply >(cat) | cat', 'mkfifo f.ply; "$P" run -q in.ply f.ply & cat f.ply; wait'):
            with self.subTest(line):
                result = self.shell(line)
                self.assertEqual((result.stdout == self.expected, result.stderr), (True, b""))
        self.assertEqual(self.shell('"$P" run in.ply /dev/null').returncode, 0)

    def test_a_named_pipe_is_opened_once(self):
        mesh = write_off(self.path("a.off"), CUBE_VERTICES, CUBE_FACES)
        self.ok("run", mesh, self.path("a.obj"), "--strength", 0, "-q")
        result = self.shell('mkfifo in.obj; cat a.obj > in.obj & timeout 20 "$P" run in.obj out.obj; code=$?; wait; exit $code')
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_what_a_shell_redirects_to_is_written_behind_what_is_there(self):
        self.shell('{ echo before; "$P" run -q in.ply /dev/stdout; echo after; } > all')
        self.assertEqual(self.path("all").read_bytes(), b"before\n" + self.expected + b"after\n")
        self.shell('{ echo before; "$P" run -q in.ply out.ply --report=/dev/stdout; } > report')
        self.assertIn(b"before\n{", self.path("report").read_bytes())

    def test_messages_that_nobody_takes_stop_no_run_and_go_into_no_file(self):
        for streams in ("2>&-", "2>/dev/full", "<&- 2>&-", ">&- 2>&-", "<&- >&- 2>&-", "<&- >&-"):
            for words in ("-v", "--progress plain", "--progress bar"):
                with self.subTest(f"{words} {streams}"):
                    self.assertEqual(self.shell(f'"$P" run in.ply out.ply --force {words} {streams}').returncode, 0)
                    self.assertEqual(self.path("out.ply").read_bytes(), self.expected)
        for streams in ("2>&-", "2>/dev/full"):
            self.assertEqual(self.shell(f'"$P" run in.ply missing/out.ply {streams}').returncode, 3)
        self.assertEqual(self.shell('"$P" run in.ply out.ply --force -q --report - <&- >&-').returncode, 3)
        self.assertEqual(self.path("out.ply").read_bytes(), self.expected)

    def test_what_is_read_more_than_once_cannot_be_a_pipe(self):
        for line, says in (('run <(cat in.ply) out.ply --tiles 2', b"read twice"), ('run <(cat in.ply) --out-dir results', b"read twice"),
                           ('run <(cat in.ply) out.ply --memory 100M', b"leave out --memory"),
                           ('run <(cat in.ply) out.ply --report page.html', b"a page tells of two files"),
                           ('certify <(cat in.ply) plain.ply --report page.html', b"several times"),
                           ('compare - - < in.ply', b"name a file for the other")):
            with self.subTest(line):
                result = self.shell('"$P" ' + line)
                self.assertEqual(result.returncode, 2)
                self.assertIn(says, result.stderr)
                self.assert_one_line(result.stderr.decode())
