# SPDX-License-Identifier: Apache-2.0
"""Every verb: what it prints, the keys of its report, the flags, the exit code of a wrong command line."""
import json
import math
import random
import re
from pathlib import Path

from program import (CUBE_FACES, CUBE_VERTICES, Case, positions, radius_error, read_ply, sphere_points, write_off,
                     write_ply)

PARAMS = ["noise", "k", "radius", "min_neighbors", "constraint", "rho", "delta", "connectivity", "rings", "normal_sigma",
          "normal_filter", "crease_angle", "flat_scale", "method", "along", "keep_boundary", "closeness_sigma",
          "similarity_sigma", "area_weight", "offset", "relaxation", "implicit_weights", "implicit_lambda", "outliers",
          "outlier_distance", "outlier_radius", "iterations", "displacement_limit", "tangential"]
USUAL = ["noise", "strength", "k", "radius", "iterations", "method", "along", "outliers", "preset", "constraint",
         "similarity_sigma"]
VERBS = ["run", "view", "info", "compare", "noise", "bench", "doctor"]


class Usage(Case):
    def test_alone_it_prints_a_help_that_fits_a_screen(self):
        text = self.ok().stdout.decode()
        self.assertEqual(text, self.ok("--help").stdout.decode())
        for verb in VERBS:
            self.assertIn(f"pointfair {verb}", text)
        lines = text.splitlines()
        self.assertLessEqual(len(lines), 24)
        self.assertLessEqual(max(map(len, lines)), 80)

    def test_version(self):
        self.assertRegex(self.ok("--version").stdout.decode(), r"^pointfair \d+\.\d+\.\d+\n$")

    def test_each_verb_has_help(self):
        for verb in VERBS:
            self.assertIn(verb, self.ok(verb, "--help").stdout.decode())

    def test_the_help_of_run_lists_the_usual_parameters_and_all_of_them_on_request(self):
        def flags(text):
            return set(re.findall(r"^  (--[a-z-]+)", text, re.M))
        usual, every = (flags(self.ok("run", word).stdout.decode()) for word in ("--help", "--help-all"))
        known = {"--" + name.replace("_", "-") for name in PARAMS}
        self.assertEqual((every - usual) & known, known - {"--" + name.replace("_", "-") for name in USUAL})
        self.assertLessEqual({"--" + name.replace("_", "-") for name in USUAL}, usual)
        self.assertLessEqual(known, every)
        self.assertLessEqual(usual | {"--format", "--columns", "--work"}, every)

    def test_the_help_of_run_has_at_most_24_flags(self):
        text = self.ok("run", "--help").stdout.decode()
        self.assertLessEqual(len(re.findall(r"^  -", text, re.M)), 24, text)

    def test_a_mistyped_verb_is_guessed(self):
        self.fails(2, "rnu", "a", "b", says="did you mean run?")
        self.fails(2, "compaer", "a", "b", says="did you mean compare?")
        self.fails(2, "sharpen", says="--help")

    def test_at_strength_0_a_run_copies_and_says_so(self):
        cloud = write_ply(self.path("in.ply"), sphere_points(500, 0.01))
        out, report = self.path("out.ply"), self.path("report.json")
        said = self.ok("run", cloud, out, "--strength", 0, "--report", report).stderr.decode()
        self.assertEqual(out.read_bytes(), cloud.read_bytes())
        self.assertIn("500 points written as they were: --strength 0 moves none", said)
        found = json.loads(report.read_text())
        self.assertEqual((found["stages"], found["noise"]["before"], found["points"]), ([], None, 500))
        self.fails(2, "run", cloud, self.path("mm.ply"), "--strength", 0, "--noise", "5mm", says="unit")
        self.assertFalse(self.path("mm.ply").exists())

    def test_wrong_command_lines(self):
        cloud = write_ply(self.path("in.ply"), sphere_points(20, 0.01))
        out = self.path("out.ply")
        for words in (["run"], ["run", cloud], ["run", cloud, out, "more"], ["run", cloud, out, "--wat"], ["--wat"],
                      ["run", cloud, out, "--k"], ["run", cloud, out, "--threads", "x"], ["info"], ["compare", cloud],
                      ["run", cloud, out, "--threads", "-1"], ["run", cloud, out, "--progress", "loud"],
                      ["run", cloud, out, "--preset", "mine"], ["run", cloud, out, "--format", "shp"],
                      ["run", cloud, out, "--device", "tpu"], ["run", cloud, out, "--device", "cuda:x"],
                      ["bench", "--repeat", "0"], ["run", cloud, "-", "--report", "-"]):
            with self.subTest(words=words):
                self.fails(2, *words)

    def test_parameters_out_of_range(self):
        cloud = write_ply(self.path("in.ply"), sphere_points(20, 0.01))
        for name, value in (("k", "0"), ("k", "513"), ("k", "x"), ("k", "1.5"), ("radius", "-1"), ("rho", "nan"),
                            ("iterations", "101"), ("iterations", "-1"), ("area-weight", "heavy"), ("constraint", "maybe"),
                            ("normal-sigma", "1q"), ("similarity-sigma", "")):
            with self.subTest(name=name, value=value):
                self.fails(2, "run", cloud, self.path("out.ply"), f"--{name}={value}", says=name.split("-")[0])

    def test_a_device_that_is_not_there(self):
        cloud = write_ply(self.path("in.ply"), sphere_points(20, 0.01))
        self.fails(5, "run", cloud, self.path("out.ply"), "--device", "cuda:63")


class Run(Case):
    def test_a_noisy_sphere_gets_smooth(self):
        write_ply(self.path("in.ply"), sphere_points(5000, 0.01))
        report = self.report("run", self.path("in.ply"), self.path("out.ply"))
        self.assertLess(radius_error(positions(self.path("out.ply"))), 0.6 * 0.01)
        self.assertAlmostEqual(report["noise"]["before"], 0.01, delta=0.005)
        self.assertAlmostEqual(report["params"]["noise"], report["noise"]["before"])

    def test_the_keys_of_the_report(self):
        write_ply(self.path("in.ply"), sphere_points(500, 0.01))
        words = ["run", self.path("in.ply"), self.path("out.ply"), "--preset", "paper", "--radius", "0.5"]
        report = self.report(*words)
        keys = ["version", "device", "points", "params", "spacing", "noise", "rounding", "unmoved", "displacement", "stages",
                "total_ms", "peak_bytes"]
        self.assertEqual([key for key in report if key in keys], keys)
        self.assertEqual(list(report["device"]), ["kind", "name", "reason"])
        self.assertEqual(list(report["params"]), PARAMS)
        self.assertEqual(list(report["noise"]), ["before", "quantiles"])  # what is left cannot be measured on the result
        low, middle, high = report["noise"]["quantiles"]
        self.assertTrue(0 < low <= middle <= high)
        self.assertEqual(list(report["displacement"]), ["mean", "rms", "p95", "max"])
        self.assertEqual(list(report["peak_bytes"]), ["host", "device"])
        self.assertEqual([list(stage) for stage in report["stages"]], [["name", "ms"]] * len(report["stages"]))
        self.assertEqual(report["points"], 500)
        self.assertEqual(set(report["unmoved"]), {"non_finite", "too_few_neighbors", "no_normal", "outliers", "boundary", "ignored",
                                                   "held"})
        params = report["params"]
        self.assertEqual((params["k"], params["iterations"], params["constraint"], params["area_weight"]),
                         (8, 1, True, "squared"))
        self.assertAlmostEqual(params["radius"], 0.5)
        for name in ("rho", "delta", "normal_sigma", "closeness_sigma", "similarity_sigma"):
            self.assertGreater(params[name], 0)

    def test_few_points_at_one_place_stay_there_with_method_implicit(self):
        points = sphere_points(800, 0.01)
        twice = random.Random(3).sample(range(800), 8)
        for order in (1, -1):
            write_ply(self.path("in.ply"), (points + [points[i] for i in twice])[::order])
            self.ok("run", self.path("in.ply"), self.path("out.ply"), "--method", "implicit", "--force", "-q")
            result = positions(self.path("out.ply"))[::order]
            self.assertEqual([result[i] for i in twice], result[800:])

    def test_each_key_is_documented_and_each_documented_key_is_there(self):
        points = [(x / 20, y / 20, 0.01 * ((7 * x + 3 * y) % 5)) for x in range(20) for y in range(20)]
        corners = [(20 * x + y, 20 * x + 20 + y, 20 * x + 21 + y) for x in range(19) for y in range(19)]
        mesh, out = write_ply(self.path("in.ply"), points, corners), self.path("out.ply")
        write_ply(self.path("same.ply"), points, corners)
        run_words = ["run", mesh, out, "--force", "--connectivity", "mesh", "--method", "implicit", "--noise", "0.01"]
        page = (Path(__file__).parents[2] / "docs" / "report.md").read_text()
        for verb, words in (("run", run_words), ("run", ["run", mesh, out, "--force", "--tiles", 2]), ("info", ["info", mesh]),
                            ("compare", ["compare", out, self.path("same.ply")])):
            rows = page.split(f"| Key of `{verb}` |")[1].split("\n\n")[0].split("\n")[2:]
            documented = {key: row for row in rows if row for key in re.findall("`([a-z_0-9]+)`", row.split("|")[1])}
            report = self.report(*words)
            self.assertEqual(set(report), set(documented), verb)
            for key, value in report.items():
                part = value[0] if isinstance(value, list) and value else value
                if isinstance(part, dict) and key not in ("params", "typical_parameters"):
                    for name in part:
                        self.assertIn(f"`{name}`", documented[key])

    def test_it_says_why_points_were_kept(self):
        points = sphere_points(300, 0.01) + [(math.nan, 0, 0), (0, 1e30, 0)]
        write_ply(self.path("in.ply"), points)
        text = self.ok("run", self.path("in.ply"), self.path("out.ply")).stderr.decode()
        self.assertIn(", 2 kept as they were: 2 not finite or beyond 1e18\n", text)

    def test_the_displacement_reported_is_that_of_the_files(self):
        for count in (800, 70000):  # of many, all threads look for the 95 %
            with self.subTest(count):
                write_ply(self.path("in.ply"), sphere_points(count, 0.01))
                reported = self.report("run", self.path("in.ply"), self.path("out.ply"), "--force")["displacement"]
                moved = sorted(math.dist(p, q) for p, q in zip(positions(self.path("in.ply")), positions(self.path("out.ply"))))
                self.assertAlmostEqual(reported["mean"], sum(moved) / len(moved), delta=1e-12)
                self.assertAlmostEqual(reported["rms"], math.sqrt(sum(d * d for d in moved) / len(moved)), delta=1e-12)
                self.assertAlmostEqual(reported["p95"], moved[math.ceil(0.95 * len(moved)) - 1], delta=1e-12)
                self.assertAlmostEqual(reported["max"], moved[-1], delta=1e-12)

    def test_units_of_lengths(self):
        points = [(x / 10, y / 10, 0.0) for x in range(31) for y in range(41)]  # diagonal 5
        write_ply(self.path("in.ply"), points)
        def radius(text):
            out = self.path("out.ply")
            return self.report("run", self.path("in.ply"), out, "--radius", text, "--force")["params"]["radius"]
        self.assertAlmostEqual(radius("0.25"), 0.25)
        self.assertAlmostEqual(radius("10%"), 0.5, delta=1e-5)
        self.assertAlmostEqual(radius("2s"), 2 * 0.1 * (4 + 2 * math.sqrt(2)) / 6, delta=0.02)

    def test_switches_bare_and_with_a_value(self):
        write_ply(self.path("in.ply"), sphere_points(100, 0.01))
        for words, expected in ((["--constraint"], True), (["--constraint", "on"], True), (["--constraint=off"], False),
                                (["--constraint", "off"], False), (["--preset", "paper"], True),
                                (["--constraint", "off", "--preset", "paper"], False)):
            report = self.report("run", "--k", 8, *words, self.path("in.ply"), self.path("out.ply"), "--force")
            self.assertEqual(report["params"]["constraint"], expected, words)

    def test_standard_input_and_output(self):
        write_ply(self.path("in.ply"), sphere_points(300, 0.01))
        self.ok("run", self.path("in.ply"), self.path("out.ply"))
        piped = self.ok("run", "-", "-", "-q", input=self.path("in.ply").read_bytes())
        self.assertEqual(piped.stdout, self.path("out.ply").read_bytes())
        self.assertEqual(piped.stderr, b"")

    def test_names_outside_ascii_are_read_written_and_told(self):
        folder = self.path("größe 点")
        folder.mkdir()
        source = write_ply(folder / "entrée.ply", sphere_points(500, 0.01))
        self.ok("run", source, folder / "résultat.ply", "-q")
        self.assertEqual(len(read_ply(folder / "résultat.ply")), 500)
        self.fails(3, "run", folder / "нет.ply", self.path("out.ply"), says="größe 点/нет.ply")
        self.assertEqual(sorted(entry.name for entry in folder.iterdir()), ["entrée.ply", "résultat.ply"])

    def test_output_format_and_encoding(self):
        write_ply(self.path("in.ply"), sphere_points(30, 0.01))
        self.ok("run", self.path("in.ply"), self.path("big.ply"), "--encoding", "binary-big-endian")
        self.assertIn(b"format binary_big_endian 1.0", self.path("big.ply").read_bytes())
        piped = self.ok("run", self.path("in.ply"), "-", "--format", "pcd", "--encoding", "ascii", "-q")
        self.assertIn(b"DATA ascii", piped.stdout)
        self.ok("run", self.path("in.ply"), self.path("odd.dat"), "--format", "xyz")
        self.assertEqual(len(self.path("odd.dat").read_text().split()), 90)

    def test_attributes_stay_and_order_too(self):
        points = sphere_points(200, 0.01)
        labels = [(7 * i) % 256 for i in range(200)]
        write_ply(self.path("in.ply"), points, extra=[("uchar", "label", labels)])
        self.ok("run", self.path("in.ply"), self.path("out.ply"))
        after = read_ply(self.path("out.ply"))
        self.assertEqual([p["label"] for p in after], labels)
        self.assertLess(max(math.dist(p, (q["x"], q["y"], q["z"])) for p, q in zip(points, after)), 0.3)

    def test_a_report_in_a_file(self):
        write_ply(self.path("in.ply"), sphere_points(100, 0.01))
        result = self.ok("run", self.path("in.ply"), self.path("out.ply"), "--report", self.path("r.json"))
        self.assertEqual(json.loads(self.path("r.json").read_text())["points"], 100)
        self.assertEqual(self.files(), ["in.ply", "out.ply", "r.json"])
        self.assertEqual(result.stdout, b"")

    def test_a_report_never_replaces_a_cloud(self):
        cloud = write_ply(self.path("in.ply"), sphere_points(100, 0.01))
        self.fails(2, "run", cloud, self.path("out.ply"), "--report", cloud)
        self.fails(2, "info", cloud, "--report", cloud)


class Progress(Case):
    def stderr(self, *words):
        write_ply(self.path("in.ply"), sphere_points(500, 0.01))
        return self.ok("run", self.path("in.ply"), self.path("out.ply"), "--force", *words).stderr.decode()

    def test_no_bar_where_there_is_no_terminal(self):
        self.assertNotIn("\r", self.stderr())
        self.assertIn("\r", self.stderr("--progress", "bar"))

    def test_plain_is_a_line_a_stage(self):
        lines = self.stderr("--progress", "plain", "--iterations", 1).splitlines()
        stages = [line for line in lines if line.isalpha()]
        self.assertEqual(stages[0], "reading")
        self.assertEqual([stage for stage in stages if stage in ("neighbors", "normals", "fairing")],
                         ["neighbors", "normals", "fairing"])

    def test_json_is_an_object_a_line(self):
        lines = self.stderr("--progress", "json").splitlines()
        objects = [json.loads(line) for line in lines if line.startswith("{")]
        self.assertTrue(all(set(o) == {"stage", "share"} and 0 <= o["share"] <= 1 for o in objects))
        self.assertEqual([o["share"] for o in objects], sorted(o["share"] for o in objects))

    def test_quiet_and_verbose(self):
        self.assertEqual(self.stderr("-q"), "")
        self.assertIn("500 points", self.stderr())
        self.assertIn("similarity_sigma", self.stderr("-v"))


class Info(Case):
    def test_the_report(self):
        points = [(500000.0 + p[0], 4100000.0 + p[1], p[2]) for p in sphere_points(2000, 0.0)]
        write_ply(self.path("in.ply"), points, scalar="double", extra=[("uchar", "red", [1] * 2000)])
        report = self.report("info", self.path("in.ply"))
        keys = ["points", "bounds", "attributes", "spacing", "noise", "typical_parameters"]
        self.assertEqual([key for key in report if key in keys], keys)
        self.assertEqual(report["points"], 2000)
        for axis in range(3):
            self.assertAlmostEqual(report["bounds"]["min"][axis], min(p[axis] for p in points), delta=1e-6)
            self.assertAlmostEqual(report["bounds"]["max"][axis], max(p[axis] for p in points), delta=1e-6)
        self.assertEqual(report["attributes"], [{"name": "red", "type": "uint8", "components": 1}])
        self.assertEqual(list(report["typical_parameters"]), PARAMS)
        self.assertGreater(report["spacing"], 0)

    def test_of_points_that_show_nothing(self):
        for points in ([(float("nan"), 0.0, 0.0)] * 50, [(1.0, 2.0, 3.0)] * 50, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]):
            write_ply(self.path("in.ply"), points)
            report = self.report("info", self.path("in.ply"))
            self.assertEqual((report["points"], report["noise"]), (len(points), 0))
            self.assertEqual(list(report["typical_parameters"]), PARAMS)
            self.assertIsNone(report["typical_parameters"]["radius"])  # automatic
            self.ok("run", self.path("in.ply"), self.path("out.ply"), "--force")

    def test_the_text(self):
        write_ply(self.path("in.ply"), sphere_points(100, 0.01), extra=[("float", "intensity", [0.5] * 100)])
        text = self.ok("info", self.path("in.ply")).stdout.decode()
        for part in ("100", "bounds", "spacing", "noise", "intensity", "similarity_sigma"):
            self.assertIn(part, text)


class Bench(Case):
    KEYS = ["device", "points", "k", "stages", "total_ms", "peak_bytes"]

    def test_its_own_cloud(self):
        report = self.report("bench", "--points", 5000, "--repeat", 2)
        self.assertEqual([key for key in report if key in self.KEYS], self.KEYS)
        self.assertEqual((report["points"], report["k"]), (5000, 0))
        self.assertEqual((report["k8"]["points"], report["k8"]["k"], report["k8"]["params"]["iterations"]), (5000, 8, 1))
        names = [stage["name"] for stage in report["stages"]]
        for name in ("index", "neighbors", "normals", "fairing"):
            self.assertIn(name, names)
        self.assertGreater(report["similarity_only_ms"], 0)
        self.assertGreater(report["peak_bytes"]["host"], 0)

    def test_without_parameters_it_times_what_users_run_and_then_k_8(self):
        report = self.report("bench", "--points", 2000, "--repeat", 1)
        write_ply(self.path("in.ply"), sphere_points(2000, 0.05))
        usual = self.report("run", self.path("in.ply"), self.path("out.ply"))
        for name in ("k", "iterations", "normal_filter", "offset", "outliers", "method"):
            self.assertEqual(report["params"][name], usual["params"][name], name)
        lines = self.ok("bench", "--points", 2000, "--repeat", 1).stdout.decode().splitlines()
        self.assertRegex(lines[0], r"^the default run: neighbours within a radius, \d+ iterations$")
        self.assertIn("the least run: k 8, 1 iteration", lines)

    def test_a_cloud_of_the_user(self):
        write_ply(self.path("in.ply"), sphere_points(1000, 0.01))
        report = self.report("bench", "--input", self.path("in.ply"), "--k", 12, "--repeat", 1)
        self.assertEqual((report["points"], report["k"]), (1000, 12))
        self.assertIn("million points a second", self.ok("bench", "--points", 1000, "--repeat", 1).stdout.decode())


class Doctor(Case):
    def test_it_lists_devices_and_formats(self):
        report = self.report("doctor")
        self.assertEqual(report["devices"][0]["kind"], "cpu")
        self.assertTrue(report["devices"][0]["usable"])
        for device in report["devices"]:
            self.assertTrue(device["usable"] or device["reason"])
        self.assertEqual(report["formats"], ["ply", "pcd", "las", "laz", "e57", "xyz", "txt", "csv", "pts", "off",
                                             "obj", "ptx", "stl", "npy", "copc", "kitti", "nuscenes", "glb"])
        self.assertIn("cpu", self.ok("doctor").stdout.decode())


class Formats(Case):
    def test_every_format_goes_through_run(self):
        mesh = write_off(self.path("cube.off"), CUBE_VERTICES, CUBE_FACES)
        for name in ("ply", "pcd", "xyz", "txt", "csv", "pts", "off", "obj"):
            with self.subTest(format=name):
                source, result = self.path(f"a.{name}"), self.path(f"b.{name}")
                self.ok("noise", mesh, source, "--points", 500, "--sigma", "0.5%")
                self.ok("run", source, result)
                self.assertEqual(self.report("compare", result, mesh)["points"], 500)
