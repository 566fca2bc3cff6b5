# SPDX-License-Identifier: Apache-2.0
"""A command line that is nearly right: the answer names the word that is wrong, and what was probably meant."""

from program import Case, run, sphere_points, write_ply


class Misunderstood(Case):
    def setUp(self):
        super().setUp()
        self.cloud = write_ply(self.path("in.ply"), sphere_points(100, 0.01))
        self.out = self.path("out.ply")

    def refused(self, *words, says):
        """What follows the name of the program."""
        return self.fails(2, *words, says=says).removeprefix("pointfair: ")

    def of_run(self, *words, says):
        return self.refused("run", self.cloud, self.out, *words, says=says)

    def test_a_mistyped_flag_is_guessed(self):
        for typed, meant in (("--nosie", "--noise"), ("--nois=0.1", "--noise"), ("--iteration", "--iterations"), ("-k", "--k"),
                             ("--similarity_sigma", "--similarity-sigma"), ("--similarity", "--similarity-sigma"),
                             ("--Noise", "--noise"), ("--normal-sgima", "--normal-sigma")):
            name = typed.split("=")[0]
            self.assertEqual(self.of_run(typed, "0.1", says=[]), f"there is no flag {name}; did you mean {meant}?\n")
        self.refused("info", self.cloud, "--colums", "x", says="did you mean --columns?")
        self.refused("tile", "plan", self.cloud, "--wrok", "x", says="did you mean --work?")

    def test_no_guess_is_better_than_a_wild_one(self):
        for typed in ("--wat", "-n", "-x"):
            self.assertNotIn("did you mean", self.of_run(typed, "1", says="see pointfair run --help"))

    def test_an_output_behind_a_flag(self):
        for flag in ("-o", "--output"):
            self.refused("run", self.cloud, flag, self.out, says="the output stands behind the input: pointfair run IN OUT")

    def test_an_empty_folder_is_none(self):
        other = write_ply(self.path("other.ply"), sphere_points(100, 0.02))
        before = other.read_bytes()
        self.refused("run", self.cloud, other, "--out-dir", "", "--force", says=("--out-dir", "no folder"))
        self.assertEqual(other.read_bytes(), before)

    def test_a_flag_without_its_value(self):
        self.assertEqual(self.of_run("--noise", says=[]), "--noise needs a value, LENGTH|auto; see pointfair run --help\n")

    def test_counts_are_whole_and_not_negative(self):
        for words in (["bench", "--points"], ["noise", self.cloud, self.out, "--points"], ["noise", self.cloud, self.out, "--seed"],
                      ["run", self.cloud, self.out, "--tiles"], ["run", self.cloud, self.out, "--skip"], ["tile", "plan", self.cloud, "--tiles"]):
            for value in ("-1", "1e5", "100,000", "many"):
                self.refused(*words, value, says=f"{words[-1]}: '{value}' is no whole number from ")
        self.refused("bench", "--points", "0", says="from 1 on")
        self.refused("view", "--port", "99999", says="--port cannot be '99999'")

    def test_ranges_are_told_in_plain_numbers(self):
        self.refused("compare", self.cloud, self.cloud, "--edges", "400", says="no number from 0 to 180;")

    def test_a_work_folder_that_is_a_file(self):
        self.fails(3, "run", self.cloud, self.out, "--work", self.cloud, says=["in.ply", "this work folder cannot be made"])

    def test_the_verb_is_not_guessed_to_be_the_opposite(self):
        self.refused("denoise", self.cloud, self.out, says="did you mean run?")

    def test_a_file_in_place_of_a_verb(self):
        self.refused(self.cloud, self.out, says=f"pointfair run {self.cloud} OUT")

    def test_words_too_few_and_too_many(self):
        self.refused("tile", says="pointfair tile is followed by one of plan, run, status, merge")
        self.refused("-v", says="there is no flag -v; see pointfair --help")
        self.refused("compare", self.cloud, self.cloud, "third", says="no place for 'third'")
        self.of_run("--noise", "5", "mm", says=["several inputs, the last of them mm", "--out-dir"])

    def test_numbers_with_a_comma(self):
        self.of_run("--noise", "0,002", says="with a decimal point")
        self.of_run("--strength", "0,5", says="as 0.5")
        self.assertNotIn("point", self.of_run("--k", "x", says="whole number"))

    def test_all_that_can_be_done_with_outliers_is_listed(self):
        self.of_run("--outliers", "delete", says="off|move|keep|mark|classify[=CLASS]|withheld|remove or auto")

    def test_a_report_as_pdf(self):
        self.of_run("--report", self.path("r.pdf"), says=[".html", "PDF"])

    def test_noise_that_adds_none_says_so(self):
        said = self.ok("noise", self.cloud, self.out).stderr.decode()
        self.assertIn("note: no noise was added; --sigma", said)
        self.assertNotIn("no noise", self.ok("noise", self.cloud, self.out, "--sigma", "1%", "--force").stderr.decode())

    def test_a_plan_whose_output_exists_is_refused_before_the_work(self):
        self.out.write_bytes(b"precious")
        words = ["tile", "plan", self.cloud, "--out", self.out, "--work", self.path("work")]
        self.fails(3, *words, says=["out.ply", "exists already", "--force"])
        self.ok(*words, "--force")
        self.ok("tile", "run", self.path("work"), "--all", "-q")
        self.assertNotEqual(self.out.read_bytes(), b"precious")

    def test_a_single_file_is_not_called_files(self):
        said = self.ok("run", self.cloud, "--out-dir", self.path("out"), "--each").stderr.decode()
        self.assertNotIn("on its own", said)

    def test_points_in_the_plane_are_told_what_they_lack(self):
        self.path("plane.xyz").write_text("1 2\n3 4\n")
        self.fails(3, "info", self.path("plane.xyz"), says=["too few values", "points need x, y and z"])

    def test_files_as_other_programs_write_them(self):
        numbers = "x;y;h\n" + "".join(f"1.234.{i},5;2;3\n" for i in range(100, 300))
        for name, data, says in (
                ("a.csv", numbers.encode(), "line 2: '1.234.100,5' is not a number; export numbers with a decimal point"),
                ("quoted.csv", b'x,y,z\n"1,5","2,5","3,5"\n', "export numbers with a decimal point"),
                ("wide.xyz", "1 2 3\n4 5 6\n".encode("utf-16-le"), "is text in UTF-16"),
                ("wide.csv", "x,y,z\n4,5,6\n".encode("utf-16-be"), "is text in UTF-16"),
                ("scan.fls", b"\x02" * 300, "is to be exported from there, as E57, LAS or PLY")):
            self.path(name).write_bytes(data)
            self.fails(3, "info", self.path(name), says=says)
        header = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 100), }".ljust(117) + "\n"
        self.path("axes.npy").write_bytes(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + bytes(1200))
        self.fails(3, "info", self.path("axes.npy"), says="save its transpose, with a point a row")
        self.path("umlaut.csv").write_bytes("Rechtswert;Hochwert;H\xf6he\n1;2;3\n4;5;6\n".encode("latin-1"))
        self.assertEqual(self.report("info", self.path("umlaut.csv"))["points"], 2)

    def test_a_path_that_is_empty_is_shown(self):
        self.fails(3, "info", "", says="'': cannot open")

    def test_standard_input_of_no_known_format(self):
        result = run("info", "-", input=b"one two\nthree four\n")
        self.assertEqual(result.returncode, 3)
        self.assertIn(b"--in-format", result.stderr)
