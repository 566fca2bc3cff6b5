# SPDX-License-Identifier: Apache-2.0
"""Runs in tiles on disk have the bits of the run in memory, whatever is killed on the way."""
import math
import random
import resource
import shutil
import signal
import struct
import subprocess
import time
import unittest

from program import BIN, SANITIZED, Case, default_signals, run, sphere_points
from survey_files import ground, las_grid, write_e57, write_las

NAN = float("nan")


def write_binary(path, points, scalar="float"):
    """A little-endian PLY with an attribute that tells the points apart."""
    head = "\n".join(["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"] +
                     [f"property {scalar} {axis}" for axis in "xyz"] + ["property int number", "end_header", ""])
    code = "<3fi" if scalar == "float" else "<3di"
    path.write_bytes(head.encode() + b"".join(struct.pack(code, *p, i) for i, p in enumerate(points)))
    return path


def lattice(side):
    """Points on planes of the axes, full of ties: a box's faces."""
    return [(x * 0.125, y * 0.125, z * 0.125) for x in range(side) for y in range(side) for z in range(side)
            if 0 in (x, y, z) or side - 1 in (x, y, z)]


def in_feet_and_back(point):
    """As another program has it that keeps floats: most coordinates are the same, others one bit off."""
    def single(value):
        return struct.unpack("<f", struct.pack("<f", value))[0]
    foot = single(.3048)
    return tuple(single(single(single(value) / foot) * foot) for value in point)


def clouds():
    noisy = sphere_points(12000, 0.01)
    generator = random.Random(3)
    yield "random order", noisy, "float"
    yield "spatial order", sorted(noisy), "float"
    doubled = list(noisy)
    for i in range(0, len(doubled), 9):
        doubled[i] = doubled[generator.randrange(50)]
    for i in range(0, len(doubled), 101):
        doubled[i] = (NAN, doubled[i][1], 2.0)
    doubled[7] = (1e25, 0.0, 0.0)
    yield "duplicates and NaN", doubled, "float"
    yield "a part twice", noisy + noisy[:3000], "float"
    yield "twice, rounded otherwise", noisy + [in_feet_and_back(p) for p in noisy], "float"
    yield "planes", lattice(40), "float"
    yield "a stray point", noisy + [(40.0, -3.0, 8.0)], "float"
    uneven = noisy[:6000] + [(p[0] * 0.02 + 1, p[1] * 0.02, p[2] * 0.02) for p in noisy[6000:]]
    yield "density 2500 to 1", uneven, "float"
    yield "far from zero", [(p[0] * 30 + 512345.678, p[1] * 30 + 5412345.678, p[2] * 30 + 87) for p in noisy], "double"


class Bits(Case):
    def same(self, source, *flags, tiles=(1, 7, 60), suffix=".ply"):
        whole = self.path("whole" + suffix)
        self.ok("run", source, whole, "-q", "--force", *flags)
        for count in tiles:
            with self.subTest(source=source.name, flags=flags, tiles=count):
                cut = self.path("cut" + suffix)
                self.ok("run", source, cut, "-q", "--work", self.path("work"), "--tiles", count, *flags)
                self.assertEqual(whole.read_bytes(), cut.read_bytes())
                cut.unlink()
                shutil.rmtree(self.path("work"))

    def test_clouds_have_the_bits_of_the_run_in_memory(self):
        for name, points, scalar in clouds():
            source = write_binary(self.path(name.replace(" ", "_") + ".ply"), points, scalar)
            self.same(source)
            self.same(source, "--k", 8)

    def test_methods_have_the_bits_of_the_run_in_memory(self):
        source = write_binary(self.path("in.ply"), sphere_points(6000, 0.01))
        for method in ("laplacian", "taubin", "hc-laplacian", "mls", "wiener", "mollified"):
            self.same(source, "--method", method, tiles=(5,))
        self.same(source, "--k", 12, "--constraint", "on", "--area-weight", "squared", "--iterations", 3, tiles=(5,))
        self.same(source, "--radius", 0.05, "--outliers", "move", tiles=(5,))
        self.same(source, "--outliers", "off", "--iterations", 1, tiles=(5,))

    def test_formats_have_the_bits_of_the_run_in_memory(self):
        points = sphere_points(4000, 0.01)
        text = self.path("in.xyz")
        text.write_text("# a comment\n" + "".join(f"{x:.6f} {y:.6f} {z:.6f} {i}\n" for i, (x, y, z) in enumerate(points)))
        self.same(text, tiles=(5,), suffix=".xyz")
        las = write_las(self.path("in.las"), ground(4000), [2] * 4000)
        self.same(las, tiles=(5,), suffix=".las")
        self.same(las, "--las-scale", 0.0001, tiles=(5,), suffix=".las")
        if run("run", las, self.path("in.laz"), "-q", "--strength", 0).returncode == 0:
            self.same(self.path("in.laz"), tiles=(5,), suffix=".laz")
            self.same(self.path("in.laz"), tiles=(5,), suffix=".las")
        e57 = write_e57(self.path("in.e57"), points[:2000])
        if e57 is not None and run("info", self.path("in.e57")).returncode == 0:
            self.same(self.path("in.e57"), tiles=(5,), suffix=".e57")

    def test_points_far_off_in_little_memory_have_the_bits_of_the_run_in_memory(self):
        mesh, cloud, count = self.path("octahedron.off"), self.path("cloud.ply"), 600000
        corners = [(sign * (a == 0), sign * (a == 1), sign * (a == 2)) for a in range(3) for sign in (1, -1)]
        faces = [(x, y, z) for x in (0, 1) for y in (2, 3) for z in (4, 5)]
        mesh.write_text("\n".join(["OFF", "6 8 0"] + [" ".join(map(str, c)) for c in corners] +
                                  [" ".join(map(str, (3, *f))) for f in faces]) + "\n")
        self.ok("noise", mesh, cloud, "--points", count, "--sigma", "0.1%", "--seed", 1)
        head, points = cloud.read_bytes().split(b"end_header\n", 1)
        strays = [(300.0, 200.0, 100.0), (0.0, 0.0, 9000.0), (-40.0, 30.0, 0.0)]
        source, whole, cut = self.path("strays.ply"), self.path("whole.ply"), self.path("cut.ply")
        source.write_bytes(head.replace(str(count).encode(), str(count + 3).encode()) + b"end_header\n" + points +
                           b"".join(struct.pack("<3f", *p) + bytes(len(points) // count - 12) for p in strays))
        self.ok("run", source, whole, "-q")
        self.ok("run", source, cut, "-q", "--memory", "64M")
        self.assertEqual(whole.read_bytes(), cut.read_bytes())
        self.assertNotEqual(whole.read_bytes(), source.read_bytes())

    def test_limits_have_the_bits_of_the_run_in_memory(self):
        rows = list(ground(6000))
        las = write_las(self.path("in.las"), rows, [(2, 2, 2, 7, 6)[i % 5] for i in range(len(rows))])
        for flags in (["--where", "classification=2"], ["--ignore", "classification=7"], ["--strength", 0.4],
                      ["--box", "500000,5400000,-1000,500008,5400011,1000"],
                      ["--where", "classification=2,6", "--ignore", "classification=7;return_number=3", "--strength", 0.7]):
            self.same(las, *flags, tiles=(5,), suffix=".las")
        flags = ["--where", "classification=2", "--ignore", "classification=7"]
        whole = self.report("run", las, self.path("a.las"), "-q", *flags)
        cut = self.report("run", las, self.path("b.las"), "-q", "--tiles", 5, *flags)
        self.assertGreater(cut["unmoved"]["ignored"], 0)
        self.assertGreater(cut["unmoved"]["held"], 0)
        self.assertEqual(whole["unmoved"], cut["unmoved"])
        text = self.path("in.csv")
        text.write_text("x,y,z,kind\n" + "".join(f"{x:.6f},{y:.6f},{z:.6f},{i % 3}\n"
                                                for i, (x, y, z) in enumerate(sphere_points(4000, 0.01))))
        self.same(text, "--where", "kind=1-2", tiles=(5,), suffix=".csv")
        self.same(text, "--ignore", "kind=0", tiles=(5,), suffix=".csv")
        self.fails(2, "run", las, self.path("no.las"), "--tiles", 5, "--where", "colour=2", says="no attribute")
        self.assertFalse(self.path("no.las").exists())

    def test_marked_outliers_have_the_bits_of_the_run_in_memory(self):
        points = sphere_points(6000, 0.01)
        for i in range(0, len(points), 300):
            points[i] = tuple(1.2 * c for c in points[i])
        source = write_binary(self.path("in.ply"), points)
        self.same(source, "--outliers", "mark")
        whole = self.report("run", source, self.path("a.ply"), "-q", "--outliers", "mark")
        cut = self.report("run", source, self.path("b.ply"), "-q", "--outliers", "mark", "--tiles", 5)
        self.assertGreater(cut["unmoved"]["outliers"], 0)
        self.assertEqual(whole["unmoved"], cut["unmoved"])
        rows = list(ground(4000))
        las = write_las(self.path("in.las"), rows, [2] * len(rows))
        self.same(las, "--outliers", "mark", "--ignore", "classification=7", tiles=(5,), suffix=".las")

    def test_the_noise_of_each_point_has_the_bits_of_the_run_in_memory(self):
        points = sphere_points(6000, 0.01) + [(NAN, 0.0, 1.0)]
        source = self.path("in.ply")
        head = "\n".join(["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"] +
                         [f"property float {name}" for name in ("x", "y", "z", "sigma")] + ["end_header", ""])
        values = [0.004 + 0.012 * abs(p[0]) if i % 50 else -1.0 for i, p in enumerate(points)]
        source.write_bytes(head.encode() + b"".join(struct.pack("<4f", *p, v) for p, v in zip(points, values)))
        self.same(source, "--noise", "sigma")
        self.same(source, "--noise", "sigma", "--k", 12, tiles=(5,))
        whole = self.report("run", source, self.path("a.ply"), "-q", "--noise", "sigma")
        cut = self.report("run", source, self.path("b.ply"), "-q", "--noise", "sigma", "--tiles", 5)
        self.assertEqual(whole["noise"], cut["noise"])
        self.assertEqual(whole["params"], cut["params"])
        self.fails(2, "run", source, self.path("no.ply"), "--noise", "sigmas", "--tiles", 5, says="no attribute")

    def test_a_file_far_from_the_others_is_refused_when_planning(self):
        near = [write_binary(self.path(f"{i}.ply"), [(x + i, y, z) for x, y, z in sphere_points(500, 0.01)]) for i in (0, 1)]
        far = write_binary(self.path("far.ply"), [(x, y + 900, z) for x, y, z in sphere_points(500, 0.01)])
        self.path("fair").mkdir()
        self.fails(2, "run", near[0], far, near[1], "--out-dir", self.path("fair"), says="far.ply: lies")
        self.ok("run", *near, "--out-dir", self.path("fair"), "-q")

    @unittest.skipIf(SANITIZED, "sanitizers reserve more memory than the limit allows")
    def test_a_cloud_that_would_not_fit_is_computed_in_tiles_and_one_line_says_so(self):
        points = sphere_points(3000, 0.01) * 400  # each place often, so that little is computed
        source = write_binary(self.path("in.ply"), points[:1200000])
        flags = ["--k", 4, "--iterations", 1, "--noise", 0.01, "--outliers", "off"]
        whole, cut = self.path("whole.ply"), self.path("cut.ply")
        said = self.ok("run", source, whole, *flags).stderr
        self.assertNotIn(b"in tiles", said)
        limited = run("run", source, cut, *flags, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (400 << 20,) * 2))
        self.assertEqual(limited.returncode, 0, limited.stderr)
        self.assertRegex(limited.stderr, rb"would take \d\d+ MB of memory, and \d+ MB are free: .*computed in tiles on disk")
        self.assertEqual(whole.read_bytes(), cut.read_bytes())

    @unittest.skipIf(SANITIZED, "sanitizers reserve more memory than the limit allows")
    def test_a_file_that_is_read_by_flags_is_computed_in_memory_whatever_its_size(self):
        rows = "".join(f"{i} {x:.6f} {y:.6f} {z:.6f}\n" for i, (x, y, z) in enumerate(sphere_points(5000, 0.01)))
        source, out = self.path("in.txt"), self.path("out.txt")
        source.write_text(rows * 20)
        flags = ["--columns", "id,x,y,z", "--preset", "paper"]
        limited = run("run", source, out, *flags, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (200 << 20,) * 2))
        self.assertEqual(limited.returncode, 0, limited.stderr)
        self.assertEqual(len(out.read_text().splitlines()), 100000)
        says = "--in-format, --columns and --skip cannot be used with a run in tiles on disk (--memory"
        self.fails(2, "run", source, self.path("no.txt"), *flags, "--memory", "64M", says=says)
        self.fails(3, "run", self.path("none.txt"), self.path("no.txt"), *flags, "--memory", "64M", says="none.txt: cannot open")

    def test_several_files_are_one_cloud(self):
        rows = list(ground(8100))
        whole = write_las(self.path("whole.las"), rows, [2] * len(rows))
        self.ok("run", whole, self.path("expected.las"), "-q")
        third = len(rows) // 3
        parts = [write_las(self.path(f"part{i}.las"), rows[i * third:(i + 1) * third], [2] * third) for i in range(3)]
        self.ok("run", *parts, "--out-dir", self.path("fair"), "-q", "--tiles", 5)
        found = [p for part in parts for p in las_grid(self.path("fair") / part.name)]
        self.assertEqual(found, las_grid(self.path("expected.las")))
        self.assertEqual(sorted(entry.name for entry in self.path("fair").iterdir()), [p.name for p in parts])

    def test_the_report_counts_as_the_run_in_memory(self):
        points = sphere_points(5000, 0.01) + [(NAN, 0.0, 0.0), (60.0, 0.0, 0.0)]
        source = write_binary(self.path("in.ply"), points)
        whole = self.report("run", source, self.path("a.ply"), "-q")
        cut = self.report("run", source, self.path("b.ply"), "-q", "--tiles", 5)
        for key in ("non_finite", "too_few_neighbors", "no_normal", "outliers"):
            self.assertEqual(whole["unmoved"][key], cut["unmoved"][key], key)
        self.assertEqual(whole["params"], cut["params"])
        self.assertEqual(whole["noise"]["before"], cut["noise"]["before"])

    def test_radii_that_are_narrower_than_what_they_were_measured_by(self):
        generator = random.Random(0)
        points = []
        for _ in range(8000):  # ripples that get sparser outwards
            r, turn = 10 * generator.random()**3 + 0.01, 6.28 * generator.random()
            height = 0.05 * r * math.sin(4 * turn) + 0.002 * r * generator.gauss(0, 1)
            points.append((r * math.cos(turn), r * math.sin(turn), height))
        source = write_binary(self.path("in.ply"), points)
        self.same(source, "--noise", "0.01", "--normal-filter", "off", "--offset", "point", "--iterations", "1",
                  tiles=(5, 10, 20))


class Tasks(Case):
    def plan(self):
        source = write_binary(self.path("in.ply"), sphere_points(8000, 0.01))
        self.ok("run", source, self.path("whole.ply"), "-q", "--force")
        self.ok("tile", "plan", source, "--out", self.path("out.ply"), "--work", self.path("work"), "--tiles", 6)
        return source

    def expect_the_bits(self):
        self.assertEqual(self.path("out.ply").read_bytes(), self.path("whole.ply").read_bytes())

    def steps(self):
        return self.report("tile", "status", self.path("work"))["steps"]

    def test_tasks_in_any_order_within_a_step(self):
        self.plan()
        for step in self.steps():
            tasks = list(range(step["tasks"]))
            random.Random(1).shuffle(tasks)
            for task in tasks + tasks[:1]:
                self.ok("tile", "run", self.path("work"), "--task", f"{step['step']}:{task}")
        self.ok("tile", "merge", self.path("work"), "-q")
        self.expect_the_bits()
        self.assertTrue(all(step["tasks"] == step["done"] for step in self.steps()))

    def test_a_step_waits_for_the_one_before(self):
        self.plan()
        self.fails(2, "tile", "run", self.path("work"), "--task", "measure", says="ingest")
        self.fails(2, "tile", "run", self.path("work"), "--task", "nothing:1", says="no step")
        self.fails(2, "tile", "run", self.path("work"), "--task", "ingest:9", says="no task")
        self.fails(2, "tile", "merge", self.path("work"), says="not finished")

    def test_an_output_that_was_deleted_is_written_again(self):
        source = write_binary(self.path("in.ply"), sphere_points(3000, 0.01))
        words = ("run", source, self.path("out.ply"), "--work", self.path("work"), "--tiles", 3, "-q")
        self.ok(*words)
        first = self.path("out.ply").read_bytes()
        self.path("out.ply").unlink()
        self.ok(*words)
        self.assertEqual(self.path("out.ply").read_bytes(), first)

    def test_workers_at_the_same_folder_do_no_harm(self):
        self.plan()
        for step in self.steps():
            workers = [subprocess.Popen([BIN, "tile", "run", self.path("work"), "--task", step["step"]]) for _ in range(3)]
            self.assertEqual([worker.wait() for worker in workers], [0, 0, 0])
        self.expect_the_bits()

    def test_a_run_that_was_interrupted_leaves_nothing_or_goes_on(self):
        source = write_binary(self.path("in.ply"), sphere_points(60000, 0.01))
        before = self.files()
        words = [BIN, "run", source, self.path("out.ply"), "--tiles", "9", "-q"]
        worker = subprocess.Popen(words, stderr=subprocess.PIPE, preexec_fn=default_signals)
        time.sleep(0.5)
        worker.send_signal(signal.SIGINT)
        text = worker.communicate()[1].decode()
        if worker.returncode != 0:
            self.assertEqual((worker.returncode, text), (130, "pointfair: interrupted\n"))
            self.assertEqual(self.files(), before)

    def test_a_changed_input_is_refused(self):
        source = self.plan()
        data = bytearray(source.read_bytes())
        data[-8] ^= 1
        source.write_bytes(bytes(data))
        self.fails(3, "tile", "run", self.path("work"), "--all", says=("in.ply", "changed"))
        self.assertFalse(self.path("out.ply").exists())

    def test_a_folder_keeps_to_its_plan(self):
        source = self.plan()
        words = ["tile", "plan", source, "--out", self.path("out.ply"), "--work", self.path("work")]
        self.ok(*words)
        self.fails(2, *words, "--k", 8, says="other parameters")

    def test_a_folder_of_another_version_or_build_is_refused_as_such(self):
        source = self.plan()
        plan = self.path("work") / "plan.txt"
        first, rest = plan.read_text().split("\n", 1)
        before_files_had_a_number = " ".join(first.split()[:2])
        for line in (first.replace("pointfair-plan ", "pointfair-plan 9"), before_files_had_a_number, first + "0"):
            plan.write_text(line + "\n" + rest)
            says = ("another version or build", "remove the work folder")
            self.fails(3, "tile", "run", self.path("work"), "--all", says=says)
            self.fails(3, "tile", "status", self.path("work"), says=says)
            self.fails(3, "run", source, self.path("out.ply"), "--work", self.path("work"), "--tiles", 6, says=says)

    def test_an_output_that_appears_meanwhile_is_kept(self):
        self.plan()
        self.path("out.ply").write_text("mine")
        self.fails(3, "tile", "run", self.path("work"), "--all", "-q", says="exists already")
        self.assertEqual(self.path("out.ply").read_text(), "mine")


def bytes_of_calls():
    """Read and written by this process's calls and those of processes that it has waited for; not what is mapped."""
    with open("/proc/self/io") as file:
        words = file.read().split()
    return int(words[1]), int(words[3])


class Cost(Case):
    """The table of docs/scale.md."""

    def setUp(self):
        super().setUp()
        self.count = 200000
        points = sphere_points(4000, 0.005)  # one place beside the other
        self.source = write_binary(self.path("in.ply"), [
            (p[0] + 3 * (i % 10), p[1] + 3 * (i // 10 % 5), p[2]) for i in range(self.count // len(points)) for p in points])

    def cost(self, step):
        """Bytes for each point of a step that is done in one process."""
        before = bytes_of_calls()
        subprocess.run([BIN, "tile", "run", self.path("work"), "--task", step], check=True)
        return tuple((after - at) / self.count for at, after in zip(before, bytes_of_calls()))

    def test_each_step_reads_and_writes_what_the_design_says(self):
        self.ok("tile", "plan", self.source, "--out", self.path("out.ply"), "--work", self.path("work"), "--memory", "512M")
        fingerprint = 64 * 4096 / self.count  # of an input, which is mapped otherwise
        measured = 0
        for step, read, written in (("ingest", fingerprint, 16), ("measure", 12, 0), ("denoise-1", 16, 20),
                                    ("denoise-2", 20, 16), ("emit", 16 + fingerprint, 16)):
            did_read, did_write = self.cost(step)
            read += measured
            if step == "measure":
                measured = (self.path("work") / "measured").stat().st_size / self.count
                written = measured
            tables = 100000 / self.count  # the plan, the leaves, what is read of headers
            self.assertLess(abs(did_read - read), 0.02 * read + tables, step)
            self.assertLess(abs(did_write - written), 0.02 * written + tables, step)

    def test_halos_of_leaves_cost_little_beyond_the_halo(self):
        self.ok("tile", "plan", self.source, "--out", self.path("out.ply"), "--work", self.path("work"), "--tiles", 4,
                "--k", 8, "--iterations", 1, "--outliers", "off", "--noise", 0.005)
        for step in ("ingest", "measure"):
            self.cost(step)
        self.assertLess(self.cost("denoise-1")[0], 1.3 * 16 + 100000 * 4 / self.count)

    def test_a_tile_leaves_at_most_three_files(self):
        self.ok("tile", "plan", self.source, "--out", self.path("out.ply"), "--work", self.path("work"), "--tiles", 20)
        for step in ("ingest", "measure", "denoise-1", "denoise-2", "emit"):
            self.cost(step)
        self.assertLessEqual(len(list(self.path("work").iterdir())), 3 * 20)


class Refusals(Case):
    def test_a_file_that_cannot_get_its_name_leaves_nothing(self):
        cloud = write_binary(self.path("in.ply"), sphere_points(500, 0.01))
        work = self.path("work")
        (work / "leaves").mkdir(parents=True)
        self.fails(3, "tile", "plan", cloud, "--out", self.path("out.ply"), "--work", work, says="leaves: cannot write")
        self.assertEqual([path.name for path in work.iterdir()], ["leaves"])

    def test_what_cannot_be_done_in_tiles_is_refused(self):
        source = write_binary(self.path("in.ply"), sphere_points(500, 0.01))
        out = self.path("out.ply")
        mesh = self.path("in.off")
        mesh.write_text("OFF\n4 0 0\n" + "0 0 0\n1 0 0\n0 1 0\n0 0 1\n")
        self.fails(2, "run", mesh, self.path("out.off"), "--tiles", 3, "--outliers", "mark", says="cannot be marked")
        self.fails(2, "run", source, out, "--tiles", 3, "--normals", "write", says="--normals write")
        self.fails(2, "run", source, out, "--tiles", 3, "--write-noise", says="--write-noise")
        self.fails(2, "run", source, self.path("out.xyz"), "--tiles", 3, says="is written as PLY")
        self.fails(2, "run", source, "-", "--tiles", 3, says="standard output")
        self.fails(2, "run", source, out, "--memory", "much", says="--memory")
        self.fails(2, "run", source, out, "--memory", "1M", says="64M")
        self.fails(2, "run", source, out, source, says="--out-dir")
        for words in (("--format", "las"), ("--encoding", "ascii"), ("--strict",)):
            self.fails(2, "run", source, mesh, "--out-dir", self.path("results"), *words, says=" ".join(words))
            self.fails(2, "tile", "plan", source, mesh, "--out-dir", self.path("results"), "--work", self.path("work"), *words,
                       says=" ".join(words))
        self.assertFalse(self.path("results").exists())
        self.fails(3, "tile", "run", self.folder, "--all", says="no plan")

    def test_a_report_replaces_no_cloud(self):
        source = write_binary(self.path("in.ply"), sphere_points(500, 0.01))
        before, work = source.read_bytes(), self.path("work")
        work.mkdir()
        self.fails(2, "run", source, self.path("out.ply"), "--work", work, "--tiles", 2, "--report", source, says="name of a cloud")
        self.ok("tile", "plan", source, "--out", self.path("out.ply"), "--work", work)
        self.ok("tile", "run", work, "--all", "-q")
        for part in ("status", "merge"):
            self.fails(2, "tile", part, work, "--report", source, says="name of a cloud")
            self.fails(2, "tile", part, work, "--report", self.path("page.html"), says="name a .json file")
            self.fails(3, "tile", part, work, "--report", self.path("none/report.json"), says="no folder")
        self.assertEqual(source.read_bytes(), before)
