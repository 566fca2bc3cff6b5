# SPDX-License-Identifier: Apache-2.0
"""Many files, each on its own: a row each, failures at the end, and results as of single runs."""
import csv
import json
import os
import random
import shutil
import signal
import struct
import subprocess
import time

from program import BIN, Case, default_signals, payload, run, sphere_points, write_ply


class Each(Case):
    def setUp(self):
        super().setUp()
        self.stations, self.out = self.path("stations"), self.path("out")
        self.stations.mkdir()
        for n, name in enumerate(("a.ply", "b.ply", "c.ply")):
            write_ply(self.stations / name, sphere_points(1500 + 100 * n, 0.01, seed=n))

    def each(self, *words, code=0):
        result = run("run", self.stations, "--out-dir", self.out, "--each", *words)
        self.assertEqual(result.returncode, code, result.stderr.decode())
        return result.stderr.decode()

    def test_results_are_those_of_single_runs(self):
        said = self.each()
        self.assertIn("3 files, each on its own", said)
        self.assertIn("[2/3]", said)
        self.assertIn("3 of 3 files written", said)
        for name in ("a.ply", "b.ply", "c.ply"):
            self.ok("run", self.stations / name, self.path(name), "-q")
            self.assertEqual((self.out / name).read_bytes(), self.path(name).read_bytes())

    def test_a_folder_of_plain_floats_is_named_by_its_format(self):
        frames = self.path("frames")
        frames.mkdir()
        (frames / "times.txt").write_text("0.1 0.2 0.3\n")
        for name, radius in (("0.bin", 5), ("1.bin", 6)):
            frame = b"".join(struct.pack("<4f", *(radius * c for c in p), 0.5) for p in sphere_points(600, 0))
            (frames / name).write_bytes(frame)
        self.ok("run", frames, "--in-format", "kitti", "--each", "--out-dir", self.out, "-q")
        self.assertEqual(sorted(path.name for path in self.out.iterdir()), ["0.bin", "1.bin"])
        self.assertEqual(len(self.report("info", frames, "--in-format", "kitti")["files"]), 2)
        self.fails(3, "run", frames, self.path("o.ply"), "--in-format", "kitti", says="2 point clouds")
        (frames / "times.txt").unlink()
        self.fails(3, "run", frames, "--each", "--out-dir", self.out, says=["do not say what they hold", "--in-format kitti"])
        (frames / "0.bin").unlink()
        (frames / "1.bin").unlink()
        self.fails(3, "info", frames, "--in-format", "kitti", says="no .bin files")

    def test_without_it_all_are_one_cloud_and_the_run_says_so(self):
        result = self.ok("run", self.stations, "--out-dir", self.out)
        self.assertIn("3 files are one cloud; --each", result.stderr.decode())
        self.ok("run", self.stations / "a.ply", self.path("a.ply"), "-q")
        self.assertNotEqual(payload(self.out / "a.ply"), payload(self.path("a.ply")))

    def test_one_that_fails_does_not_stop_the_others(self):
        (self.stations / "b.ply").write_text("ply\nthis is none\n")
        report = self.path("rows.csv")
        said = self.each("--report", report, code=3)
        self.assertEqual(sorted(path.name for path in self.out.iterdir()), ["a.ply", "c.ply"])
        last = said.rstrip("\n").split("\n")[-2:]
        self.assertIn("b.ply", last[0])
        self.assertIn("1 of 3 files failed", last[1])
        with open(report, newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row["status"] for row in rows], ["done", "failed", "done"])
        self.assertEqual([row["points"] for row in rows], ["1500", "", "1700"])
        self.assertIn("b.ply", rows[1]["error"])
        self.assertAlmostEqual(float(rows[0]["noise"]), 0.01, delta=0.004)
        self.assertGreater(float(rows[0]["moved_mean"]), 0.001)
        self.assertEqual([row["metres_per_unit"] for row in rows], ["", "", ""])

    def test_one_without_points_is_copied_and_counts_as_done(self):
        empty = write_ply(self.stations / "b.ply", []).read_bytes()
        report = self.path("rows.csv")
        for words in ([], ["--memory", "64M"]):
            said = self.each("--report", report, *words)
            self.assertIn("b.ply: 0 points, written as they were\nnote: the file has no points and was copied\n", said)
            self.assertIn("3 of 3 files written, 0 skipped, 0 failed", said)
            self.assertEqual((self.out / "b.ply").read_bytes(), empty)
            with open(report, newline="") as file:
                self.assertEqual([row["status"] for row in csv.DictReader(file)], ["done"] * 3)
            said = self.each("--skip-existing", *words)
            self.assertIn("0 of 3 files written, 3 skipped, 0 failed", said)
            self.assertEqual((self.out / "b.ply").read_bytes(), empty)
            self.assertIn("exists already", self.each(*words, code=3))
            shutil.rmtree(self.out)
        self.each("--report", self.path("rows.json"), "-q")
        self.assertEqual(json.loads(self.path("rows.json").read_text())["files"][1]["run"]["points"], 0)
        shutil.rmtree(self.out)
        said = self.each("--format", "pcd", code=3)  # an empty file of another format cannot be made of it
        self.assertIn("b.ply: has no points", said)
        self.assertEqual(sorted(path.name for path in self.out.iterdir()), ["a.pcd", "c.pcd"])
        lines = self.ok("info", self.stations).stdout.decode().splitlines()
        self.assertEqual([line.split()[0] for line in lines[1:]], ["1500", "0", "1700"])

    def test_the_exit_code_is_what_failures_have_in_common(self):
        damaged = self.path("damaged.xyz")
        damaged.write_text("no row\n")
        two = [self.stations / "a.ply", damaged]
        for paths in (two, two[::-1]):
            result = run("info", *paths, "--columns", "x,y,z")
            self.assertIn("--columns and --skip are for text files", result.stderr.decode())
            self.assertIn("damaged.xyz: ", result.stderr.decode())
            self.assertEqual(result.returncode, 1)  # an argument of one, the file of the other
        self.assertEqual(run("info", damaged, damaged).returncode, 3)

    def test_rows_in_json_have_the_report_of_each(self):
        self.each("--report", self.path("rows.json"), "-q")
        rows = json.loads(self.path("rows.json").read_text())["files"]
        alone = self.report("run", self.stations / "b.ply", self.path("b.ply"))
        self.assertEqual(rows[1]["run"]["noise"], alone["noise"])
        self.assertEqual(rows[1]["run"]["displacement"], alone["displacement"])

    def test_what_is_there_is_skipped_on_request_and_kept_otherwise(self):
        self.out.mkdir()
        (self.out / "a.ply").write_text("mine")
        said = self.each(code=3)
        self.assertIn("exists already", said)
        self.assertEqual((self.out / "a.ply").read_text(), "mine")
        for name in ("b.ply", "c.ply"):
            (self.out / name).unlink()
        said = self.each("--skip-existing")
        self.assertIn("2 of 3 files written, 1 skipped, 0 failed", said)
        self.assertEqual((self.out / "a.ply").read_text(), "mine")

    def test_an_input_is_no_result_that_is_there(self):
        self.out = self.stations
        said = self.each("--skip-existing", code=2)
        self.assertEqual(said.count("is input and output at once"), 3)
        self.assertIn("3 of 3 files failed", said)

    def test_the_table_of_a_run_that_was_stopped_goes_on(self):
        (self.stations / "a.ply").rename(self.stations / 'a, the "first".ply')
        table = {name: self.path("rows" + name) for name in (".csv", ".json")}
        words = ["run", self.stations, "--out-dir", self.out, "--each", "--skip-existing", "-q", "--k", 400]
        numbers = ["points", "spacing", "noise", "moved_mean", "moved_max", "outliers"]
        for name, report in table.items():
            shutil.rmtree(self.out, ignore_errors=True)
            fifo = self.stations / "b.ply"
            kept = fifo.read_bytes()
            fifo.unlink()
            os.mkfifo(fifo)  # the second file never comes
            self.out.mkdir()
            paths = sorted(self.stations.iterdir())
            process = subprocess.Popen([BIN, *map(str, [words[0], *paths, *words[2:], "--report", report])], stderr=subprocess.PIPE,
                                       preexec_fn=default_signals)
            latest = time.monotonic() + 20
            while not report.exists():
                self.assertIsNone(process.poll())
                if time.monotonic() > latest:
                    process.kill()
                    self.fail("no table while the run goes on")
                time.sleep(0.001)
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=60)
            self.assertEqual(process.returncode, 130)
            fifo.unlink()
            fifo.write_bytes(kept)
            if name == ".csv":
                with open(report, newline="") as file:
                    rows = list(csv.DictReader(file))
                self.assertEqual([row["status"] for row in rows], ["done", "waiting", "waiting"])
            self.ok(*words, "--report", report)
            self.ok(*words, "--report", report)  # nothing is left to do
            if name == ".csv":
                with open(report, newline="") as file:
                    again = list(csv.DictReader(file))
                self.assertEqual([row["status"] for row in again], ["skipped"] * 3)
                self.assertEqual([again[0][key] for key in numbers], [rows[0][key] for key in numbers])
                self.assertEqual([row["points"] for row in again], ["1500", "1600", "1700"])
            else:
                files = json.loads(report.read_text())["files"]
                self.assertEqual([row["status"] for row in files], ["skipped"] * 3)
                self.assertEqual([row["run"]["points"] for row in files], [1500, 1600, 1700])

    def test_what_was_not_measured_has_no_number(self):
        self.each("--strength", 0, "--report", self.path("rows.csv"))
        rows = list(csv.DictReader(self.path("rows.csv").read_text().splitlines()))
        self.assertEqual({(row["spacing"], row["noise"]) for row in rows}, {("", "")})

    def test_files_in_tiles_have_numbers_and_notes(self):
        large = self.path("large.ply")
        count = 400_000
        points = random.Random(1)
        rows = b"".join(struct.pack("<6f", points.random(), points.random(), points.gauss(0, 1e-3), 0, 0, 1) for _ in range(count))
        names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
        large.write_bytes(f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{names}end_header\n".encode() + rows)
        for report in (self.path("rows.csv"), self.path("rows.json")):
            said = self.ok("run", large, self.stations / "a.ply", "--each", "--out-dir", self.out, "--preset", "paper", "--memory",
                           "64M", "--progress", "plain", "--report", report, "--force").stderr.decode()
            self.assertIn("[1/2]", said)
            self.assertIn(f"large.ply: {count} points, noise 0.00", said)
            self.assertIn("the normals in the file are those from before", said)
            self.assertIn("1/2 denoise-1\n", said)
        row = next(csv.DictReader(self.path("rows.csv").read_text().splitlines()))
        self.assertEqual((row["status"], row["points"]), ("done", str(count)))
        self.assertTrue(all(float(row[name]) > 0 for name in ("spacing", "noise", "moved_mean", "moved_max", "milliseconds")), row)
        its = json.loads(self.path("rows.json").read_text())["files"][0]["run"]
        self.assertEqual((its["points"], its["displacement"]["mean"] > 0), (count, True))
        self.assertTrue(any("normals" in note for note in its["notes"]), its["notes"])

    def test_progress_is_over_all(self):
        lines = [json.loads(line) for line in self.each("--progress", "json").splitlines() if line.startswith("{")]
        shares = [line["share"] for line in lines]
        self.assertEqual(shares, sorted(shares))
        self.assertTrue(any(line["stage"].startswith("3/3 ") for line in lines))
        self.assertGreater(shares[-1], 0.6)

    def test_results_in_another_format_have_its_extension(self):
        self.each("--format", "obj", "-q")
        self.assertEqual(sorted(path.name for path in self.out.iterdir()), ["a.obj", "b.obj", "c.obj"])
        self.assertTrue((self.out / "a.obj").read_text().startswith("v "))
        (self.stations / "b.ply").rename(self.stations / "b.2.day")  # no extension of a format
        self.ok("run", self.stations / "b.2.day", "--out-dir", self.path("day"), "--each", "--format", "pcd", "-q")
        self.assertEqual([path.name for path in self.path("day").iterdir()], ["b.2.day.pcd"])
        self.ok("run", self.stations / "a.ply", self.stations / "a.obj", "--strength", 0, "-q")
        self.out = self.path("none")
        said = self.each("--format", "pcd", code=2)
        self.assert_one_line(said)
        for part in ("a.obj", "a.ply", "a.pcd", "same name"):
            self.assertIn(part, said)
        self.assertFalse(self.out.exists())

    def test_octrees_in_another_format_have_its_extension(self):
        self.each("--format", "copc", "-q")
        self.assertEqual(sorted(path.name for path in self.out.iterdir()), ["a.copc.laz", "b.copc.laz", "c.copc.laz"])
        for name in ("copc", "laz"):
            self.ok("run", self.out, "--out-dir", self.path(name), "--each", "--format", name, "--strength", 0, "-q")
        self.assertEqual(sorted(path.name for path in self.path("copc").iterdir()), ["a.copc.laz", "b.copc.laz", "c.copc.laz"])
        self.assertEqual(sorted(path.name for path in self.path("laz").iterdir()), ["a.laz", "b.laz", "c.laz"])

    def test_every_error_names_its_file(self):
        said = self.each("--connectivity", "mesh", "-q", "--report", self.path("rows.json"), code=2).splitlines()
        for name, line in zip(("a.ply", "b.ply", "c.ply"), said):
            self.assertEqual(line.count(str(self.stations / name)), 1, line)
            self.assertIn("needs faces", line)
        self.assertIn("a.ply", json.loads(self.path("rows.json").read_text())["files"][0]["error"])

    def test_what_one_cloud_of_several_files_cannot_do_leads_here(self):
        for words in (["--connectivity", "mesh"], ["--normals", "write"]):
            result = run("run", self.stations, "--out-dir", self.out, *words)
            self.assertEqual(result.returncode, 2)
            self.assertIn("--each treats every file on its own", result.stderr.decode())
            self.assertNotIn("give it the memory", result.stderr.decode())

    def test_wrong_command_lines(self):
        scan = self.stations / "a.ply"
        self.fails(2, "run", scan, self.path("o.ply"), "--each", says="--out-dir")
        self.fails(2, "run", scan, "--out-dir", self.out, "--skip-existing", says="--each")
        self.fails(2, "run", self.stations, "--out-dir", self.out, "--each", "--report", self.path("r.html"), says="certify")
        self.fails(2, "run", scan, scan, "--out-dir", self.out, "--each", says="same name")
        self.fails(2, "run", scan, "--out-dir", self.out, "--each", "--tiles", "2", says="--tiles")

    def test_info_takes_many(self):
        text = self.ok("info", self.stations).stdout.decode().splitlines()
        self.assertEqual(len(text), 4)
        self.assertEqual([line.split()[0] for line in text[1:]], ["1500", "1600", "1700"])
        self.ok("info", self.stations / "a.ply", self.stations / "c.ply", "--report", self.path("r.json"))
        rows = json.loads(self.path("r.json").read_text())["files"]
        self.assertEqual([row["points"] for row in rows], [1500, 1700])
        (self.stations / "b.ply").write_text("none")
        result = run("info", self.stations)
        self.assertEqual(result.returncode, 3)
        self.assertEqual(len(result.stdout.splitlines()), 3)
        self.assertIn("1 of 3 files failed", result.stderr.decode())
