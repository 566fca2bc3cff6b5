# SPDX-License-Identifier: Apache-2.0
"""A folder and a virtual point cloud (VPC) stand for all their files, which are one cloud."""
import json
import resource
import shutil

from program import Case, run
from survey_files import FEET, METRES, ground, write_las, write_old_las


class Surveys(Case):
    def setUp(self):
        super().setUp()
        self.tiles = self.path("tiles")
        self.tiles.mkdir()
        points = sorted(ground(1200))
        for n, part in enumerate((points[:700], points[700:])):
            write_las(self.tiles / f"part{n}.las", part, [2] * len(part))
        self.ok("run", self.tiles / "part0.las", self.tiles / "part1.las", "--out-dir", self.path("wanted"), "-q")

    def vpc(self, hrefs, name="survey.vpc"):
        features = [{"type": "Feature", "id": str(n), "assets": {"overview": {"href": "./picture.png"}, "data": {"href": href}}}
                    for n, href in enumerate(hrefs)]
        path = self.path(name)
        path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
        return path

    def same(self, *inputs):
        out = self.path("out")
        self.ok("run", *inputs, "--out-dir", out, "-q")
        for n in range(2):
            self.assertEqual((out / f"part{n}.las").read_bytes(), (self.path("wanted") / f"part{n}.las").read_bytes())
        shutil.rmtree(out)

    def test_a_folder_is_all_clouds_in_it(self):
        (self.tiles / "readme.md").write_text("no cloud")
        (self.tiles / ".hidden.las").write_text("no cloud")
        self.same(self.tiles)

    def test_texts_beside_clouds_are_left_out_and_told(self):
        (self.tiles / "README.txt").write_text("flown in May\n")
        (self.tiles / "control.CSV").write_text("1 2 3\n")
        self.same(self.tiles)
        said = self.ok("info", self.tiles).stderr.decode()
        self.assertIn("note: ", said)
        self.assertIn("2 text files, README.txt the first, are left out", said)
        texts = self.path("texts")
        texts.mkdir()
        (texts / "a.txt").write_text("".join(f"{x} {y} {z}\n" for x, y, z in ground(300)))
        self.assertNotIn("left out", self.ok("info", texts).stderr.decode())

    def test_a_vpc_is_the_files_that_it_names(self):
        self.same(self.vpc(["./tiles/part0.las", "tiles/part1.las"]))
        self.same(self.vpc([str(self.tiles / "part0.las"), "file://" + str(self.tiles / "part1.las")]))
        self.same(self.vpc(["./tiles/part1.las"]), self.tiles / "part0.las")

    def test_a_vpc_may_encode_names(self):
        for n, name in enumerate(("part 0.las", "100%25.las")):
            for folder in (self.tiles, self.path("wanted")):
                (folder / f"part{n}.las").rename(folder / name)
        for number, hrefs in enumerate((["./tiles/part%200.las", "tiles/100%25.las"],
                                        [f"file://{self.tiles}/part%200.las", "./tiles/100%2525.las"])):
            out = self.path(f"out{number}")
            self.ok("run", self.vpc(hrefs), "--out-dir", out, "-q")
            for name in ("part 0.las", "100%25.las"):
                self.assertEqual((out / name).read_bytes(), (self.path("wanted") / name).read_bytes())

    def test_octrees_come_back_as_laz(self):
        if run("run", self.tiles / "part0.las", self.path("a.copc.laz"), "--strength", "0").returncode != 0:
            self.skipTest("built without LASzip")
        self.ok("run", self.vpc(["./a.copc.laz"]), "--out-dir", self.path("out"), "-q")
        self.assertEqual([entry.name for entry in self.path("out").iterdir()], ["a.laz"])
        note = "the COPC index of the input no longer fits"
        for inputs, names in ((["a.copc.laz"], ""), (["a.copc.laz", "tiles/part1.las"], "a.copc.laz: "),
                              (["b.copc.laz", "a.copc.laz", "tiles/part1.las"], "b.copc.laz and 1 more: ")):
            if "b.copc.laz" in inputs:
                self.ok("run", self.tiles / "part1.las", self.path("b.copc.laz"), "--strength", "0", "-q")
                write_las(self.tiles / "part1.las", [(x + 30, y, z) for x, y, z in ground(400)], [2] * 400)
            said = self.ok("run", *map(self.path, inputs), "--out-dir", self.path("named"), "--force").stderr.decode()
            self.assertIn(f"note: {names}{note}", said)

    def test_a_tile_of_another_coordinate_system_is_named(self):
        said = self.ok("run", self.tiles, "--out-dir", self.path("one")).stderr.decode()
        self.assertNotIn("coordinate systems", said)
        points = sorted(ground(1200))[700:]
        for n, code in ((1, b'"25833"'), (2, b'"25832"'), (3, b"")):
            shifted = [(x + 10 * n, y, z) for x, y, z in points]
            crs = METRES.replace(b'"25832"', code) if code else code
            write_las(self.tiles / f"part{n}.las", shifted, [2] * len(points), crs=crs)
        said = self.ok("run", self.tiles, "--out-dir", self.path("two")).stderr.decode()
        self.assertRegex(said, "note: the inputs have 2 coordinate systems.*: Somewhere, EPSG:25832; Somewhere, EPSG:25833 in part1.las\n")
        refused = self.path("refused")
        self.fails(2, "run", self.tiles, "--out-dir", refused, "--noise", "2cm", says=["part3.las: --noise", "unit"])
        self.assertFalse(refused.exists(), "a folder for results that never came")

    def test_an_input_that_would_be_replaced_in_tiles_is_refused_without_advice_that_does_not_help(self):
        part = self.tiles / "part0.las"
        for words in (["run", self.tiles, "--out-dir", self.tiles], ["run", part, part, "--tiles", 2],
                      ["run", part, "--out-dir", self.tiles]):
            for more in ([], ["--force"]):
                said = self.fails(2, *words, *more, says=["part0.las: is input and output at once", "name another output"])
                self.assertNotIn("--force", said)

    def test_folders_in_a_folder_are_told(self):
        said = self.fails(3, "run", self.folder, "--out-dir", self.path("out"),
                          says="the folders in it are not looked into; name these")
        self.assertIn("there are no point clouds in this folder", said)

    def test_all_inputs_that_cannot_be_read_are_named_at_once(self):
        (self.tiles / "part1.las").write_bytes((self.tiles / "part1.las").read_bytes()[:1000])
        for n in range(2, 9):
            (self.tiles / f"part{n}.las").write_bytes(b"")
        said = self.fails(3, "run", self.tiles, "--out-dir", self.path("out"), says="part1.las: ")
        names = "part2.las, part3.las, part4.las, part5.las, part6.las, .."
        self.assertIn(f"; nor can 7 more of the inputs be read: {names}\n", said)
        parts = [self.tiles / f"part{n}.las" for n in (0, 7, 8)]
        self.fails(3, "run", *parts, "--out-dir", self.path("out"),
                   says=["part7.las: ", "; nor can 1 more of the inputs be read: part8.las\n"])

    def test_a_tile_without_points_is_copied(self):
        empty = [write_las(self.tiles / name, [], []).read_bytes() for name in ("a_first.las", "part0b.las")]
        for words in ((), ("--outliers", "classify"), ("--noise", "20mm", "--work", self.path("work"))):
            out, wanted = self.path("out"), self.path("wanted2")
            said = self.ok("run", self.tiles, "--out-dir", out, *words).stderr.decode()
            self.assertIn("note: a_first.las and 1 more: the file has no points and was copied", said)
            parts = [self.tiles / f"part{n}.las" for n in range(2)]
            plain = [word for word in words if word not in ("--work", self.path("work"))]
            self.ok("run", *parts, "--out-dir", wanted, *plain, "-q")
            for n in range(2):
                self.assertEqual((out / f"part{n}.las").read_bytes(), (wanted / f"part{n}.las").read_bytes())
            self.assertEqual([(out / name).read_bytes() for name in ("a_first.las", "part0b.las")], empty)
            if "--work" in words:  # what was deleted since is written again, by the same plan
                (out / "a_first.las").unlink()
                self.ok("run", self.tiles, "--out-dir", out, *words)
                self.assertEqual((out / "a_first.las").read_bytes(), empty[0])
            shutil.rmtree(out)
            shutil.rmtree(wanted)
        for name in ("part0.las", "part1.las"):
            (self.tiles / name).unlink()
        self.fails(3, "run", self.tiles, "--out-dir", self.path("out"), says=["a_first.las: has no points", "name other files"])
        self.fails(3, "run", self.tiles / "a_first.las", self.path("out.las"), says="a_first.las: has no points")

    def test_an_attribute_that_one_tile_lacks_is_told_with_its_name(self):
        write_las(self.tiles / "part2.las", ground(400), [2] * 400)
        write_old_las(self.tiles / "part3.las", ground(400))
        for flag in ("--where", "--ignore"):
            self.fails(2, "run", self.tiles, "--out-dir", self.path("out"), flag, "scanner_channel=0",
                       says=["part3.las: ", "no attribute 'scanner_channel'"])

    def test_files_in_feet_and_in_metres_are_no_cloud(self):
        write_las(self.tiles / "part2.las", ground(400), [2] * 400, crs=FEET)
        said = self.fails(2, "run", self.tiles, "--out-dir", self.path("out"),
                          says=["part2.las: its unit is 0.3048 m", "run --each"])
        self.assertRegex(said, r"that of \S*part0.las is 1 m")
        self.fails(2, "tile", "plan", self.tiles, "--out-dir", self.path("out"), "--work", self.path("work"),
                   says="part2.las: its unit")
        self.ok("run", self.tiles, "--out-dir", self.path("out"), "--each", "-q")

    def test_files_with_heights_in_feet_and_in_metres_are_no_cloud(self):
        both = b'COMPD_CS["both",PROJCS["UTM",UNIT["metre",1]],VERT_CS["heights",UNIT["metre",1]]]'
        feet = both.replace(b'VERT_CS["heights",UNIT["metre",1]]', b'VERT_CS["heights",UNIT["foot",0.3048]]')
        points = list(ground(400))
        write_las(self.tiles / "part2.las", points, [2] * 400, crs=both)
        write_las(self.tiles / "part3.las", points, [2] * 400, crs=feet)
        said = self.fails(2, "run", self.tiles, "--out-dir", self.path("out"),
                          says=["part3.las: the unit of its heights is 0.3048 m", "run --each"])
        self.assertRegex(said, r"that of \S*part2.las is 1 m")
        self.fails(2, "compare", self.tiles / "part2.las", self.tiles / "part3.las",
                   says="the unit of the heights of one is 1 m")
        (self.tiles / "part2.las").unlink()  # the others do not say it
        self.ok("run", self.tiles, "--out-dir", self.path("out"), "-q")

    def test_more_files_than_a_process_may_hold_open(self):
        many = self.path("many")
        many.mkdir()
        points = sorted(ground(6000))
        for n in range(120):
            write_las(many / f"{n:03}.las", points[20 * n:][:20], [2] * 20)
        few = lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (110, 110))
        self.ok("run", many, "--out-dir", self.path("out"), "-q", "--tiles", 3, preexec_fn=few)
        self.assertEqual(len(list(self.path("out").iterdir())), 120)

    def test_what_is_wrong_is_one_line(self):
        survey = self.vpc(["./tiles/part0.las"])
        self.fails(3, "run", survey, self.path("out.las"), says="--out-dir")
        self.fails(3, "run", self.tiles, self.path("out.las"), says="--out-dir")
        for path, says in ((self.vpc(["https://example.org/a.copc.laz"], "web.vpc"), "not on disk"), (self.vpc([], "none.vpc"), "names no"),
                           (self.vpc(["./gone.las"], "gone.vpc"), "gone.las"), (self.vpc(["./a.tif"], "picture.vpc"), "without a point cloud")):
            result = run("run", path, "--out-dir", self.path("out"))
            self.assertEqual(result.returncode, 3, result.stderr)
            self.assert_one_line(result.stderr.decode())
            self.assertIn(says, result.stderr.decode())
        damaged = self.path("damaged.vpc")
        for text in ("", "{", "[]", '{"features": 3}', '{"features": [{}]}'):
            damaged.write_text(text)
            result = run("run", damaged, "--out-dir", self.path("out"))
            self.assertEqual(result.returncode, 3, result.stderr)
            self.assert_one_line(result.stderr.decode())
        self.path("empty").mkdir()
        self.assertEqual(run("run", self.path("empty"), "--out-dir", self.path("out")).returncode, 3)
