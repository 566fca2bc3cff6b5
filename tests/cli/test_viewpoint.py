# SPDX-License-Identifier: Apache-2.0
"""Where the sensor stood: --viewpoint, --along ray, the counts of outliers, the sign of normals."""
import math
import random
import re
import struct

from program import Case, positions, read_ply, write_ply

SENSOR = (500.5, -1.0, 0.25)
HALF, BOARD, STEP, NOISE = 50, 22, 0.006, 0.002


def scan(is_camera=False):
    """A board before a wall on a grid of rays, of a scanner that turns or a camera; points between both along every other ray of the
    board's border."""
    generator = random.Random(5)
    points, mixed = [], []
    for row in range(-HALF, HALF + 1):
        for column in range(-HALF, HALF + 1):
            a, e = STEP * column, STEP * row
            ray = (math.cos(e) * math.sin(a), math.cos(e) * math.cos(a), math.sin(e))
            if is_camera:
                ray = tuple(v / math.hypot(a, 1, e) for v in (a, 1, e))
            board, wall = 3 / ray[1], 5 / ray[1]
            border = max(abs(row), abs(column))
            mixed.append(border == BOARD + 1 and (row + column) % 2 == 0)
            told = board + generator.uniform(0.1, 0.9) * (wall - board) if mixed[-1] else board if border <= BOARD else wall
            told += generator.gauss(0, NOISE)
            points.append(tuple(s + told * r for s, r in zip(SENSOR, ray)))
    return points, mixed


class Viewpoint(Case):
    def setUp(self):
        super().setUp()
        self.points, self.mixed = scan()
        columns = [("double", f"v{axis}", [place] * len(self.points)) for axis, place in zip("xyz", SENSOR)]
        self.cloud = write_ply(self.path("in.ply"), self.points, extra=columns)
        self.at = ",".join(map(str, SENSOR))

    def test_mixed_pixels_are_marked_and_counted(self):
        report = self.report("run", self.cloud, self.path("out.ply"), "--viewpoint", self.at, "--outliers", "mark")
        marks = [row["outlier"] for row in read_ply(self.path("out.ply"))]
        found = sum(mark > 0 for mark, mixed in zip(marks, self.mixed) if mixed)
        self.assertGreater(found, 0.9 * sum(self.mixed))
        self.assertLess(len(marks) - marks.count(0) - found, 0.002 * len(marks))
        self.assertEqual(list(report["outliers"]), ["isolated", "off_surface", "mixed_pixels"])
        self.assertEqual(sum(report["outliers"].values()), report["unmoved"]["outliers"])
        self.assertEqual([marks.count(reason) for reason in (1, 2, 3)], list(report["outliers"].values()))
        self.assertGreater(report["outliers"]["mixed_pixels"], 0.2 * sum(self.mixed))
        text = self.ok("run", self.cloud, self.path("b.ply"), "--viewpoint", self.at).stderr.decode()
        self.assertIn(f"{report['outliers']['mixed_pixels']} mixed pixels", text)

    def test_a_place_far_outside_is_told(self):
        def said(at, *words):
            return self.ok("run", self.cloud, self.path("out.ply"), "--viewpoint", at, "--force", *words).stderr.decode()
        far = re.compile(r"note: the sensor stood \d+ diagonals outside the bounds of the cloud.*")
        in_memory = far.search(said("500000,4000000,100"))
        self.assertTrue(in_memory)
        self.assertEqual(far.search(said("500000,4000000,100", "--tiles", 2)).group(), in_memory.group())
        for words in ((), ("--tiles", 2)):
            self.assertNotIn("diagonals", said(self.at, *words))
            self.assertNotIn("diagonals", said("none", *words))

    def test_names_of_attributes_give_the_same(self):
        for words in ((), ("--along", "ray"), ("--normals", "write")):
            self.ok("run", self.cloud, self.path("a.ply"), "--viewpoint", self.at, "-q", "--force", *words)
            self.ok("run", self.cloud, self.path("b.ply"), "--viewpoint", "vx,vy,vz", "-q", "--force", *words)
            self.assertEqual(self.path("a.ply").read_bytes(), self.path("b.ply").read_bytes(), words)

    def test_points_stay_on_their_rays(self):
        self.ok("run", self.cloud, self.path("out.ply"), "--viewpoint", self.at, "--along", "ray", "-q")
        moved = 0
        for before, after in zip(positions(self.cloud), positions(self.path("out.ply"))):
            a, b = ([v - s for v, s in zip(p, SENSOR)] for p in (before, after))
            cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
            self.assertLess(math.hypot(*cross), 1e-6 * math.hypot(*a) * math.hypot(*b))
            moved += math.dist(a, b) > 1e-4
        self.assertGreater(moved, len(self.points) / 2)

    def test_normals_look_to_the_sensor(self):
        self.ok("run", self.cloud, self.path("out.ply"), "--viewpoint", self.at, "--normals", "write", "-q")
        for row in read_ply(self.path("out.ply")):
            normal = [row[name] for name in ("nx", "ny", "nz")]
            self.assertGreaterEqual(sum(n * (s - row[axis]) for n, s, axis in zip(normal, SENSOR, "xyz")), 0)

    def organised(self, name, points):
        side = 2 * HALF + 1
        head = (f"VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {side}\nHEIGHT {side}\n"
                f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA binary\n")
        self.path(name).write_bytes(head.encode() + b"".join(struct.pack("<3d", *p) for p in points))
        return self.path(name)

    def test_the_image_of_a_camera_tells_it(self):
        points, mixed = scan(is_camera=True)
        image = self.organised("image.pcd", points)
        given = self.report("run", image, self.path("given.pcd"), "--viewpoint", self.at)
        found = self.report("run", image, self.path("found.pcd"))
        self.assertGreater(found["outliers"]["mixed_pixels"], 0.2 * sum(mixed))
        self.assertEqual(found["outliers"], given["outliers"])
        self.assertEqual(self.report("run", image, self.path("none.pcd"), "--viewpoint", "none")["outliers"]["mixed_pixels"], 0)
        cut = self.report("run", image, self.path("cut.pcd"), "--tiles", 3)
        self.assertEqual(self.path("cut.pcd").read_bytes(), self.path("found.pcd").read_bytes())
        self.assertEqual(cut["outliers"], found["outliers"])
        for words in (["run", image, self.path("o.pcd")], ["info", image]):
            done = self.ok(*words)
            self.assertIn("500.5, -1, 0.25, where the rays of the grid meet", (done.stdout + done.stderr).decode())

    def test_the_image_of_a_camera_tells_it_in_a_numpy_file_too(self):
        side = 2 * HALF + 1
        points, _ = scan(is_camera=True)
        head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({side}, {side}, 3), }}".ljust(117) + "\n"
        body = b"".join(struct.pack("<3d", *p) for p in points)
        self.path("image.npy").write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + body)
        image = self.organised("image.pcd", points)
        both = [self.report("run", file, self.path("found" + file.suffix)) for file in (self.path("image.npy"), image)]
        self.assertGreater(both[0]["outliers"]["mixed_pixels"], 0)
        for key in ("outliers", "notes", "displacement"):
            self.assertEqual(both[0][key], both[1][key])
        self.assertEqual(self.report("info", self.path("image.npy"))["file"]["grid"], [side, side])

    def test_the_grid_of_a_scanner_that_turns_asks_for_it(self):
        turned = self.organised("turned.pcd", self.points)
        note = "--viewpoint x,y,z finds points between two surfaces"
        self.assertIn(note, self.ok("run", turned, self.path("a.pcd"), "--k", 12).stderr.decode())
        self.assertNotIn("--viewpoint", self.ok("run", turned, self.path("b.pcd"), "--viewpoint", self.at).stderr.decode())
        self.assertNotIn(note, self.ok("run", self.cloud, self.path("c.ply")).stderr.decode())
        self.assertNotIn(note, self.ok("run", turned, self.path("d.pcd")).stderr.decode())

    def test_grids_of_several_files_in_tiles_say_it_as_in_memory(self):
        def notes(*inputs):
            report = self.report("run", *inputs, "--out-dir", self.path("out"), "--force", "--outliers", "mark", "--k", 12)
            return "\n".join(report["notes"]), report["outliers"]["mixed_pixels"]
        self.path("out").mkdir()
        image, turned = scan(is_camera=True)[0], self.points
        two = [self.organised(f"{i}.pcd", [(x + 3 * i, y, z) for x, y, z in image]) for i in (2, 3)]
        for inputs in (two, [two[0], self.organised("turned.pcd", turned)]):
            said, mixed = notes(*inputs)
            self.assertEqual(mixed, 0)
            self.assertNotIn("the rays of the grid", said)
            self.assertIn("the inputs do not say one place of the sensor for all points, so a run in tiles takes none", said)
        said, mixed = notes(*[self.organised(f"{i}.pcd", [(x + 3 * i, y, z) for x, y, z in turned]) for i in (4, 5)])
        self.assertEqual(said.count("its grid does not tell: --viewpoint x,y,z finds points between two surfaces"), 1)

    def test_the_distances_between_points_tell_it(self):
        def run(out, *words):
            return self.report("run", self.cloud, self.path(out), "--outliers", "mark", *words)
        found = run("found.ply")
        marks = [row["outlier"] for row in read_ply(self.path("found.ply"))]
        mixed = sum(mark == 3 for mark, mixed in zip(marks, self.mixed) if mixed)
        self.assertGreater(mixed, 0.9 * sum(self.mixed))
        self.assertLess(marks.count(3) - mixed, 0.002 * len(marks))
        self.assertLess(math.dist(found["found_sensor"], SENSOR), 1)
        said = re.search("show a sensor near ([-0-9.,]+), which", self.ok("run", self.cloud, self.path("a.ply")).stderr.decode())
        self.assertLess(math.dist(map(float, said[1].split(",")), found["found_sensor"]), 0.02)
        cut = run("cut.ply", "--tiles", 3)
        self.assertEqual(self.path("cut.ply").read_bytes(), self.path("found.ply").read_bytes())
        self.assertEqual((cut["found_sensor"], cut["outliers"]), (found["found_sensor"], found["outliers"]))
        for words in (["--viewpoint", "none"], ["--viewpoint", self.at], ["--viewpoint", "none", "--tiles", 3]):
            report = run("other.ply", *words, "--force")
            self.assertIsNone(report["found_sensor"])
            self.assertEqual(report["outliers"]["mixed_pixels"] > 0, "none" not in words)

    def test_a_pcd_file_tells_it(self):
        def pcd(name, viewpoint):
            head = (f"VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {len(self.points)}\nHEIGHT 1\n"
                    f"VIEWPOINT {viewpoint} 1 0 0 0\nPOINTS {len(self.points)}\nDATA binary\n")
            rows = b"".join(struct.pack("<3d", *p) for p in self.points)
            self.path(name).write_bytes(head.encode() + rows)
            return self.path(name)

        told, silent = pcd("told.pcd", self.at.replace(",", " ")), pcd("silent.pcd", "0 0 0")
        self.assertGreater(self.report("run", told, self.path("a.pcd"))["outliers"]["mixed_pixels"], 0)
        self.assertEqual(self.report("run", silent, self.path("b.pcd"), "--viewpoint", "none")["outliers"]["mixed_pixels"], 0)
        self.assertEqual(self.report("run", told, self.path("c.pcd"), "--viewpoint", "none")["outliers"]["mixed_pixels"], 0)
        in_tiles = self.report("run", told, self.path("e.pcd"), "--tiles", 3)
        self.assertGreater(in_tiles["outliers"]["mixed_pixels"], 0)
        self.assertEqual(self.path("a.pcd").read_bytes(), self.path("e.pcd").read_bytes())
        self.ok("run", silent, self.path("d.pcd"), "--viewpoint", self.at, "-q")
        self.assertEqual(self.path("a.pcd").read_bytes().split(b"binary\n")[1], self.path("d.pcd").read_bytes().split(b"binary\n")[1])

    def test_tiles_on_disk_know_one_place(self):
        for words in (("--outliers", "mark"), ("--along", "ray"), ("--k", 20, "--outliers", "mark"), ("--iterations", 2)):
            words = ("--viewpoint", self.at, "--force", *words)
            whole = self.report("run", self.cloud, self.path("a.ply"), *words)
            tiles = self.report("run", self.cloud, self.path("b.ply"), "--tiles", 4, *words)
            self.assertEqual(self.path("a.ply").read_bytes(), self.path("b.ply").read_bytes(), words)
            self.assertEqual(whole["outliers"], tiles["outliers"], words)
            self.assertGreater(whole["outliers"]["mixed_pixels"], 0)
        self.ok("tile", "plan", self.cloud, "--out", self.path("c.ply"), "--work", self.path("work"), "--viewpoint", self.at, "--along", "ray", "--iterations", 2)
        self.ok("tile", "run", self.path("work"), "--all", "-q")
        self.ok("run", self.cloud, self.path("d.ply"), "--viewpoint", self.at, "--along", "ray", "--iterations", 2, "-q")
        self.assertEqual(self.path("c.ply").read_bytes(), self.path("d.ply").read_bytes())

    def test_what_cannot_be_is_refused_in_one_line(self):
        out = self.path("out.ply")
        for text in ("1,2", "1,vy,3", "x,y,,", "a,b,c"):
            self.fails(2, "run", self.cloud, out, "--viewpoint", text, says="--viewpoint")
        self.fails(2, "run", self.cloud, out, "--along", "ray", says=("--along ray", "--viewpoint"))
        self.fails(2, "run", self.cloud, out, "--along", "ray", "--method", "laplacian", says="--along ray")
        self.fails(2, "run", self.cloud, out, "--tiles", 3, "--along", "ray", says=("--along ray", "--viewpoint"))
        self.fails(2, "run", self.cloud, out, "--tiles", 3, "--viewpoint", "vx,vy,vz", says=("--viewpoint", "x,y,z"))
        self.fails(2, "tile", "plan", self.cloud, "--out", out, "--work", self.path("work"), "--viewpoint", "1,2", says="--viewpoint")
