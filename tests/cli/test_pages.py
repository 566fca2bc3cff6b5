# SPDX-License-Identifier: Apache-2.0
"""The page on a result: what it says is so, its pictures are pictures, and it fetches nothing."""
import base64
import datetime
import hashlib
import math
import random
import re
import statistics
import struct
import zlib
from html.parser import HTMLParser

from program import Case, payload, read_ply, sphere_points, write_ply
from survey_files import FEET, ground, write_las


class Page(HTMLParser):
    """The text of a page, its tables as dictionaries from name to value, its pictures as bytes."""

    def __init__(self, path):
        super().__init__()
        self.source = path.read_text()
        self.text, self.rows, self.pictures, self.alts, self.open = "", {}, [], [], []
        self.cells = []
        self.feed(self.source)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag == "img":
            kind, data = attributes["src"].split(",", 1)
            assert kind == "data:image/png;base64"
            self.pictures.append(base64.b64decode(data, validate=True))
            self.alts.append(attributes["alt"])
        if tag == "tr":
            self.cells = []
        if tag in ("th", "td"):
            self.cells.append("")
        if tag not in ("meta", "img", "rect", "path"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in ("rect", "path"):
            assert self.open.pop() == tag, tag
        if tag == "tr" and len(self.cells) > 1:
            self.rows.setdefault(self.cells[0], []).append(self.cells[1:])

    def handle_data(self, data):
        if "style" in self.open:
            return
        self.text += data
        if self.open and self.open[-1] in ("th", "td"):
            self.cells[-1] += data


def pixels_of(png):
    """Width, height, the palette and the rows of a PNG of 8 bits with a palette, by zlib."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = {}, 8
    while at < len(png):
        length, kind = struct.unpack_from(">I4s", png, at)
        data = png[at + 8:at + 8 + length]
        assert struct.unpack_from(">I", png, at + 8 + length)[0] == zlib.crc32(kind + data)
        chunks[kind] = data
        at += 12 + length
    width, height, bits, colour = struct.unpack_from(">IIBB", chunks[b"IHDR"])
    assert (bits, colour) == (8, 3)
    lines = zlib.decompress(chunks[b"IDAT"])
    rows = [lines[i * (width + 1):(i + 1) * (width + 1)] for i in range(height)]
    assert len(lines) == height * (width + 1) and all(row[0] == 0 for row in rows)
    assert max(max(row[1:]) for row in rows) < len(chunks[b"PLTE"]) // 3
    return width, height, chunks[b"PLTE"], [row[1:] for row in rows]


def spiky_sphere(count=4000):
    points = sphere_points(count, 0.01)
    for i in range(20):
        points[i] = tuple(1.5 * c for c in points[i])
    points[30] = (float("nan"),) * 3
    return points


class Pages(Case):
    def setUp(self):
        super().setUp()
        self.scan, self.out, self.html = self.path("in.ply"), self.path("out.ply"), self.path("r.html")
        rng = random.Random(3)
        self.points = spiky_sphere()
        write_ply(self.scan, self.points, extra=[("uchar", "red", [rng.randrange(256) for _ in self.points])])

    def test_points_that_limits_hold_are_among_the_reasons(self):
        self.ok("run", self.scan, self.out, "--report", self.html, "--box", "0,-9,-9,9,9,9")
        rows = Page(self.html).rows
        held = int(rows["others, held by limits such as a box"][0][0].split()[0].replace(",", ""))
        report = self.report("run", self.scan, self.out, "--force", "--box", "0,-9,-9,9,9,9")["unmoved"]
        self.assertEqual(held, report["held"])
        self.assertGreater(held, 1500)
        said = self.ok("run", self.scan, self.out, "--force", "--report", self.html, "--box", "7,7,7,9,9,9").stderr.decode()
        for text in (said, Page(self.html).text):
            self.assertEqual(text.count("the limits, such as --where and --box, leave no point to denoise"), 1)

    def test_a_run_writes_the_page_of_its_result(self):
        self.ok("run", self.scan, self.out, "--report", self.html)
        page = Page(self.html)
        self.assertFalse(page.open)
        for path, row in ((self.scan, 0), (self.out, 1)):
            self.assertEqual(page.rows["SHA-256"][row], [hashlib.sha256(path.read_bytes()).hexdigest()])
            self.assertEqual(page.rows["bytes"][row], [f"{path.stat().st_size:,}"])
        self.assertIn(f"pointfair run {self.scan} {self.out}", page.rows["command"][0][0])
        self.assertRegex(page.rows["program"][0][0], r"^pointfair \d")
        made = datetime.datetime.strptime(page.rows["date of this page"][0][0], "%Y-%m-%d %H:%M UTC")
        self.assertLess(abs((datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None) - made).total_seconds()), 300)
        self.assertEqual(page.rows["red"], [["the same, byte for byte"]])
        self.assertIn("4,000, as many as before", page.rows["points"][-1][0] + page.rows["points"][0][0])
        report = self.report("run", self.scan, self.path("again.ply"))
        self.assertIn(f"on {report['device']['kind']}, {report['device']['name']}", "on " + page.rows["computed on"][0][0])
        self.assertEqual(payload(self.out), payload(self.path("again.ply")))  # marks for the page change no bit
        self.assertIn(f"{report['noise']['before']:.4g} units (estimated)", page.rows["typical"][0][0])
        self.assertAlmostEqual(float(page.rows["mean"][0][0].split()[0]), report["displacement"]["mean"], delta=1e-3 * report["displacement"]["mean"])
        isolated, off = (int(page.rows[name][0][0].split()[0]) for name in ("isolated: too few neighbours within reach", "off the surface of their neighbours"))
        self.assertEqual([isolated, off], [report["outliers"]["isolated"], report["outliers"]["off_surface"]])
        self.assertGreater(isolated + off, 10)

    def test_pictures_show_the_cloud_and_its_outliers(self):
        self.ok("run", self.scan, self.out, "--report", self.html, "-q")
        page = Page(self.html)
        self.assertEqual(len(page.pictures), 7)
        self.assertTrue(all(page.alts))
        pictures = [pixels_of(picture) for picture in page.pictures]
        for width, height, _, rows in pictures:
            covered = sum(pixel != 0 for row in rows for pixel in row) / (width * height)
            self.assertGreater(covered, 0.2)
        self.assertNotEqual(page.pictures[0], page.pictures[1])
        # the marks are beyond the grey of the cloud in the palette, squares of 7 pixels each
        marked = sum(pixel > 16 for row in pictures[-1][3] for pixel in row)
        self.assertTrue(10 * 24 < marked <= 20 * 49, marked)
        # a sphere is round and in the middle
        rows = pictures[1][3]
        columns = [x for row in rows for x, pixel in enumerate(row) if pixel]
        lines = [y for y, row in enumerate(rows) for pixel in row if pixel]
        self.assertAlmostEqual(sum(columns) / len(columns), pictures[1][0] / 2, delta=8)
        across, down = (statistics.pstdev(values) for values in (columns, lines))
        self.assertAlmostEqual(across, down, delta=0.06 * down)

    def test_it_fetches_nothing_and_runs_nothing(self):
        self.ok("run", self.scan, self.out, "--report", self.html, "-q")
        source = self.html.read_text()
        self.assertNotIn("<script", source)
        self.assertEqual(re.findall(r"(?:src|href)=\"(?!data:)[^\"]*", source), [])
        self.assertNotRegex(source, r"https?:|url\(|@import")
        self.assertIn("default-src 'none'", source)
        self.assertLess(len(source), 3e6)

    def test_names_are_text(self):
        odd = self.path("<b>a&b.ply")
        odd.write_bytes(self.scan.read_bytes())
        self.ok("run", odd, self.out, "--report", self.html, "-q")
        self.assertIn("<b>a&b.ply", Page(self.html).rows["name"][0][0])
        self.assertNotIn("<b>", self.html.read_text())

    def test_names_in_another_encoding(self):
        odd = self.path("H\udcf6he.ply")  # in Latin-1
        odd.write_bytes(self.scan.read_bytes())
        self.ok("run", odd, self.out, "--report", self.html, "-q")
        self.assertTrue("<td>H\ufffdhe.ply</td>" in self.html.read_bytes().decode())

    def test_certify_says_what_differs(self):
        self.ok("run", self.scan, self.out, "-q")
        self.ok("certify", self.scan, self.out)
        page = Page(self.path("out.html"))
        self.assertEqual(page.rows["red"], [["the same, byte for byte"]])
        self.assertIn("pointfair certify", page.rows["command"][0][0])
        self.fails(3, "certify", self.scan, self.out, says=["out.html", "--force"])
        vertices = read_ply(self.out)
        points = [(v["x"], v["y"], v["z"]) for v in vertices]
        red = [int(v["red"]) for v in vertices]
        for i in (5, 50, 500):
            red[i] ^= 1
        write_ply(self.path("meddled.ply"), points, extra=[("uchar", "red", red), ("uchar", "outlier", [int(i == 7) for i in range(len(red))])])
        self.ok("certify", self.scan, self.path("meddled.ply"), "--report", self.html, "-q")
        page = Page(self.html)
        self.assertEqual(page.rows["red"], [["3 differ"]])
        self.assertEqual(page.rows["outlier"], [["new"]])
        self.assertTrue(page.rows["outliers"][0][0].startswith("1 ("))
        write_ply(self.path("short.ply"), points[1:])
        self.fails(3, "certify", self.scan, self.path("short.ply"), "--report", self.path("s.html"), says=["4000", "3999"])

    def test_certify_compares_values_of_other_types(self):
        points = [(i % 20, i // 20, 0.01 * (i % 7)) for i in range(400)]
        extra = [("double", "count", [float(i % 9) for i in range(400)]), ("float", "share", [i / 7 for i in range(400)])]
        write_ply(self.scan, points, extra=extra)
        table = self.path("out.csv")
        self.ok("run", self.scan, table, "--strength", "0", "-q")
        self.ok("certify", self.scan, table, "--report", self.html, "-q")
        page = Page(self.html)
        self.assertEqual(page.rows["count"], [["the same values, stored in another type"]])
        self.assertEqual(page.rows["share"], [["the same, byte for byte"]])
        lines = table.read_text().splitlines()
        lines[7] = lines[7].replace(",6,", ",7,")
        table.write_text("\n".join(lines) + "\n")
        self.ok("certify", self.scan, table, "--report", self.html, "-q", "--force")
        self.assertEqual(Page(self.html).rows["count"], [["1 differ"]])

    def test_certify_takes_the_marks_that_are_new(self):
        vertices = read_ply(self.scan)
        points = [(v["x"], v["y"], v["z"]) for v in vertices]
        write_ply(self.scan, [*points, (9.0, 9.0, 9.0)], extra=[("uchar", "outlier", [1] * (len(points) + 1))])
        self.ok("run", self.scan, self.out, "--outliers", "mark", "-q")
        marked = sum(vertex["outlier_2"] != 0 for vertex in read_ply(self.out))
        self.assertTrue(0 < marked < len(points))
        self.ok("certify", self.scan, self.out, "--report", self.html, "-q")
        self.assertTrue(Page(self.html).rows["outliers"][0][0].startswith(f"{marked} ("))

    def test_what_is_said_of_the_input_holds_for_its_copy(self):
        points = sphere_points(400, 0.01)
        self.path("a.bin").write_bytes(b"".join(struct.pack("<4f", *p, 0.5) for p in points))
        self.path("a.txt").write_text("scan 7\n" + "".join(f"{i} {x:.6f} {y:.6f} {z:.6f}\n" for i, (x, y, z) in enumerate(points)))
        text = ("--columns", "id,x,y,z", "--skip", 1)
        for name, words in (("bin", ("--in-format", "kitti")), ("txt", text)):
            source, result = self.path(f"a.{name}"), self.path(f"b.{name}")
            self.ok("run", source, result, *words, "--report", self.path(f"{name}.html"), "-q")
            self.ok("certify", source, result, *words, "-q")
            for page in (Page(self.path(f"{name}.html")), Page(self.path(f"b.html"))):
                self.assertEqual(page.rows["points"][0][0].split(",")[0], "400")
            self.path("b.html").unlink()
        self.ok("run", self.path("a.txt"), self.path("c.ply"), *text, "--report", self.path("c.html"), "-q")
        self.ok("certify", self.path("a.txt"), self.path("c.ply"), *text, "-q", "--force")

    def test_pages_know_that_copc_has_another_order(self):
        points = [(x * 0.1, y * 0.1, 0.001 * ((7 * x + y) % 5)) for x in range(80) for y in range(80)]
        tile, copc = write_las(self.path("in.las"), points, [2] * len(points)), self.path("out.copc.laz")
        self.ok("run", tile, copc, "--strength", "0", "-q")
        self.fails(3, "certify", tile, copc, "--report", self.html, says=["order of an octree", "write LAZ"])
        self.fails(2, "run", tile, self.path("b.copc.laz"), "--report", self.html, says=["order", "write LAZ"])
        few = write_las(self.path("few.las"), points[:1000], [2] * 1000)
        self.ok("run", few, copc, "--strength", "0", "-q", "--force")
        self.ok("certify", few, copc, "--report", self.html, "-q")
        self.assertEqual(Page(self.html).rows["classification"], [["the same, byte for byte"]])

    def test_certify_says_what_of_faces_it_compared(self):
        points, faces = [(i % 20, i // 20, 0.01 * (i % 7)) for i in range(400)], [(i, i + 1, i + 20) for i in range(379)]
        write_ply(self.scan, points, faces)

        def page_on(others):
            write_ply(self.out, points, others)
            self.ok("certify", self.scan, self.out, "--report", self.html, "-q", "--force")
            return Page(self.html)
        page = page_on(faces)
        self.assertEqual(page.rows["corners of the faces"], [["the same"]])
        self.assertNotIn("faces", page.rows)
        self.assertIn("Nothing else was compared", page.text)
        self.assertNotIn("Whoever repeats the command", page.text)
        self.assertEqual(page_on([face[::-1] for face in faces]).rows["corners of the faces"], [["379 faces differ"]])
        self.assertEqual(page_on(faces[:-9]).rows["corners of the faces"], [["9 faces differ"]])
        self.assertEqual(page_on(()).rows["faces"], [["not there"]])
        self.ok("run", self.scan, self.out, "--report", self.html, "-q", "--force")
        self.assertIn("Whoever repeats the command", Page(self.html).text)

    def test_certify_warns_of_what_two_files_show(self):
        self.ok("run", self.scan, self.out, "-q")
        self.ok("certify", self.scan, self.out, "-q")
        sound = self.path("out.html").read_text()
        self.assertNotIn("Warnings", sound)
        self.assertNotIn("denoised by pointfair", sound)  # nobody knows that of two files
        rng = random.Random(1)
        write_ply(self.scan, [[rng.uniform(0, 1000) for _ in range(3)] for _ in range(300)])
        self.ok("run", self.scan, self.out, "-q", "--force")
        self.ok("certify", self.scan, self.out, "-q", "--force")
        self.assertRegex(self.path("out.html").read_text(), r"(?s)Warnings.*large against the cloud")
        said = self.ok("certify", self.scan, self.out, "--force").stderr.decode()
        self.assertRegex(said, r"note: .*large against the cloud, whose diagonal is 17\d\d")
        self.assertNotIn("no result of", said)

    def test_certify_tells_two_files_that_are_no_pair(self):
        points = [(x + 40, y, z) for x, y, z in ground(900)]
        tile = write_las(self.path("tile.las"), ground(900), [2] * 900)
        other = write_las(self.path("other.las"), points, [2] * 900)
        said = self.ok("certify", tile, other).stderr.decode()
        note = ("points lie up to 40 m from where they were, which is more than half of the cloud: "
                "other.las seems to be no result of tile.las")
        self.assertIn("note: " + note.replace(" m ", " "), said)
        self.assertIn(note, Page(self.path("other.html")).text)

    def test_classes_and_units(self):
        rng = random.Random(5)
        ground = [(x, y, rng.gauss(0, 0.02 if x < 25 else 0.05)) for x, y in ((rng.uniform(0, 50), rng.uniform(0, 50)) for _ in range(8000))]
        tile = write_las(self.path("in.las"), ground, [2 if p[0] < 25 else 6 for p in ground])
        self.ok("run", tile, self.path("out.las"), "--report", self.html, "-q")
        page = Page(self.html)
        self.assertTrue(page.rows["length of the unit"][0][0].startswith("1 m"))
        quiet, loud = (page.rows[name][0] for name in ("2 ground", "6 building"))
        self.assertTrue(quiet[1].endswith(" mm") and loud[1].endswith(" mm"), (quiet, loud))
        self.assertGreater(float(loud[1].split()[0]), 1.5 * float(quiet[1].split()[0]))
        self.assertTrue(any("25832" in value for rows in page.rows.values() for row in rows for value in row))

    def test_parameters_have_the_units_of_all_lengths(self):
        points = [(x * 10, y * 10, z * 10) for x, y, z in ground(900)]
        for crs, unit in ((FEET, "mm"), (b"", "units")):
            tile = write_las(self.path("in.las"), points, [2] * 900, crs=crs)
            self.ok("run", tile, self.path("out.las"), "--force", "-q", "--delta", "0.25", "--report", self.html)
            rows = Page(self.html).rows
            for name in ("noise", "radius", "similarity_sigma", "displacement_limit"):
                self.assertRegex(rows[name][0][0], r"^auto \([0-9.]+ %s\)$" % unit)
            self.assertEqual(rows["delta"][0][0], "76.2 mm" if crs else "0.25 units")

    def test_warnings_have_the_units_of_all_lengths(self):
        points = [(x * 10, y * 10, z * 10) for x, y, z in ground(900)]
        tile = write_las(self.path("in.las"), points, [2] * 900, scale=0.5, crs=FEET)
        said = self.ok("run", tile, self.path("out.las"), "--report", self.html).stderr.decode()
        text = Page(self.html).text
        rounding = r"the steps of %s between stored coordinates are coarse against the noise of %s;"
        noise = float(re.search(rounding % ("0.5", r"([0-9.]+)"), said)[1])
        in_mm = re.search(rounding % ("152.4 mm", r"([0-9.]+) mm"), text)
        self.assertAlmostEqual(float(in_mm[1]), 304.8 * noise, delta=0.1)
        rng = random.Random(1)
        write_las(tile, [[rng.uniform(0, 1000) for _ in range(3)] for _ in range(300)], [2] * 300, crs=FEET)
        large = r"large against the cloud, whose diagonal is (\d+\.?\d*)"
        self.ok("run", tile, self.path("out.las"), "--force", "-q", "--report", self.html)
        in_metres = re.search(large + " m: its points", Page(self.html).text)[1]
        self.assertAlmostEqual(float(in_metres), 0.3048 * math.sqrt(3) * 1000, delta=10)
        self.ok("certify", tile, self.path("out.las"), "--force", "-q")
        self.assertEqual(re.search(large + " m: its points", Page(self.path("out.html")).text)[1], in_metres)

    def test_outliers_that_are_pulled_in_are_counted(self):
        self.ok("run", self.scan, self.out, "--report", self.html, "--outliers", "move")
        report = self.report("run", self.scan, self.out, "--force", "--outliers", "move")
        self.assertGreater(report["outliers"]["off_surface"] + report["outliers"]["isolated"], 0)
        table = Page(self.html).source.split("pulled in as outliers")[1]
        for reason, start in (("isolated", "isolated: too few"), ("off_surface", "off the surface of")):
            self.assertRegex(table, start + r"[^<]*<[^0-9]*%d " % report["outliers"][reason])

    def test_json_is_not_called_a_table(self):
        for words in (("run", self.scan, self.out), ("info", self.scan), ("run", self.scan, self.out, "--tiles", 2)):
            self.fails(2, *words, "--report", self.path("r.csv"), says=["r.csv", ".json", "--each"])
        self.assertFalse(self.path("r.csv").exists())

    def test_a_page_is_not_json_elsewhere(self):
        for verb in (["info", self.scan], ["compare", self.scan, self.scan], ["bench"]):
            self.fails(2, *verb, "--report", self.html, says=".json")
        self.fails(2, "run", self.scan, "-", "--report", self.html, says="page")
        self.fails(2, "run", self.scan, self.out, "--tiles", "2", "--report", self.html, says="certify")
        self.fails(2, "certify", self.scan, self.scan, "--report", self.path("r.json"), says=".html")


class Displacements(Case):
    def test_the_length_moved_is_an_attribute(self):
        write_ply(self.path("in.ply"), spiky_sphere())
        for words, name in (([], "displacement"), (["=moved"], "moved")):
            flag = "--write-displacement" + "".join(words)
            self.ok("run", self.path("in.ply"), self.path("out.ply"), "--force", flag, "-q")
            before, after = read_ply(self.path("in.ply")), read_ply(self.path("out.ply"))
            for p, q in zip(before, after):
                moved = sum((p[c] - q[c]) ** 2 for c in "xyz") ** 0.5
                if moved == moved:
                    self.assertAlmostEqual(q[name], moved, delta=1e-6)
                else:
                    self.assertNotEqual(q[name], q[name])
        self.fails(2, "run", self.path("in.ply"), self.path("no.ply"), "--write-displacement=x", says="--write-displacement")
        self.fails(2, "run", self.path("in.ply"), self.path("no.ply"), "--write-displacement", "--tiles", "2", says="--write-displacement")
