# SPDX-License-Identifier: Apache-2.0
"""What a file holds beside its points is in a new file, or a note tells that it is lost."""
import struct

from program import Case

POINTS = [(x % 10, x // 10, x * 37 % 11 / 100) for x in range(100)]
ROWS = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS)
VERTICES = "".join(f"v {x} {y} {z}\n" for x, y, z in POINTS)
OWN_NAMES = ", where their own are too long, taken or no valid name; NPY keeps names"
LOSSES = ("no place for", "do not keep", "another name", "other names", "without its name", "without their names")


class Conversion(Case):
    def put(self, name, content):
        path = self.path(name)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def convert(self, source, name, *words):
        """The new file, and the notes on what it lacks; a run with --strict ends as they say."""
        target = self.path(name)
        words = ["run", source, target, "--device", "cpu", "--connectivity", "points", "--force", *words]
        said = self.ok(*words).stderr.decode().splitlines()
        lost = [line for line in said if any(loss in line for loss in LOSSES)]
        strict = ["--strict", "-q"]
        self.fails(3, *words, *strict) if lost else self.ok(*words, *strict)
        return target, lost

    def columns(self, path):
        """The names of a file's columns, and the values of its first point."""
        self.ok("run", path, self.path("columns.csv"), "--strength", "0", "--force")
        names, row = self.path("columns.csv").read_text().splitlines()[:2]
        return names.split(","), row.split(",")

    def ply(self, name, properties, values, after="", rows=""):
        """Points with further properties, "type name" each, and as many values at all of them."""
        lines = "".join(f"property {each}\n" for each in properties)
        body = "".join(row + "".join(f" {value}" for value in values) + "\n" for row in ROWS.splitlines())
        head = "property double x\nproperty double y\nproperty double z\n" + lines + after
        return self.put(name, "ply\nformat ascii 1.0\nelement vertex 100\n" + head + "end_header\n" + body + rows)


class Textures(Conversion):
    def test_texture_coordinates_stay_where_some_corners_have_none(self):
        texture = "vt 0 0\nvt 0.5 0\nvt 0 0.25\n"
        mesh = self.put("a.obj", VERTICES + texture + "f 3 4 5\nf 1/1 2/2 12/3\nf 2/2 3 4/3\n")
        ply, lost = self.convert(mesh, "b.ply", "--encoding", "ascii")
        self.assertEqual(lost, [])
        faces = ["3 2 3 4 0", "3 0 1 11 6 0 0 0.5 0 0 0.25", "3 1 2 3 6 0.5 0 nan nan 0 0.25"]
        self.assertEqual(ply.read_text().splitlines()[-3:], faces)
        back, lost = self.convert(ply, "c.obj")
        self.assertEqual(lost, [])
        lines = back.read_text().splitlines()
        self.assertEqual(lines[-3:], ["f 3 4 5", "f 1/1 2/2 12/3", "f 2/4 3 4/5"])
        self.assertEqual([line for line in lines if line.startswith("vt")],
                         ["vt 0 0", "vt 0.5 0", "vt 0 0.25", "vt 0.5 0", "vt 0 0.25"])

    def test_texture_coordinates_that_no_corner_has_are_told(self):
        mesh = self.put("a.obj", VERTICES + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 12/3\n")
        _, lost = self.convert(mesh, "b.ply")
        self.assertEqual(lost, ["note: PLY files have no place for 1 texture coordinate that no corner of a face has"])

    def test_texture_coordinates_that_do_not_fit_their_face_are_told(self):
        faces = "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"
        mesh = self.ply("a.ply", [], [], faces, "3 0 1 11 6 0 0 1 0 1 1\n3 0 1 12 9 0 0 0 1 0 0 1 1 0\n")
        _, lost = self.convert(mesh, "b.obj")
        told = "the texture coordinates of 1 face, which are not two for each corner"
        self.assertEqual(lost, ["note: OBJ files have no place for " + told])
        self.assertIn("f 1/1 2/2 12/3\nf 1 2 13\n", self.path("b.obj").read_text())


class Names(Conversion):
    def test_intensity_of_las_is_the_column_that_is_called_so(self):
        cloud = self.ply("a.ply", ["uchar Intensity", "ushort intensity"], [7, 1000])
        las, lost = self.convert(cloud, "b.las")
        self.assertEqual(lost, [])
        names, row = self.columns(las)
        self.assertEqual((row[names.index("intensity")], row[names.index("Intensity")]), ("1000", "7"))

    def test_names_that_las_cuts_differ_and_are_told(self):
        long = "a_very_long_attribute_name_more_than_32_chars_"
        properties = [f"float {long}one", f"float {long}two", "float classification", "uchar classification_2"]
        cloud = self.ply("a.ply", properties, [1.5, 2.5, 3.5, 4])
        las, lost = self.convert(cloud, "b.las")
        told = f"note: the attributes {long}one, {long}two, classification get other names in LAS files"
        self.assertEqual(lost, [told + OWN_NAMES])
        names, row = self.columns(las)
        own = {"a_very_long_attribute_name_more_": "1.5", "a_very_long_attribute_name_mor_2": "2.5",
               "classification_3": "3.5", "classification_2": "4"}
        self.assertEqual({name: row[names.index(name)] for name in own}, own)

    def test_names_that_the_fields_of_las_have_in_other_programs_are_not_told(self):
        names = "X,Y,Z,Intensity,ReturnNumber,NumberOfReturns,Classification,PointSourceId,GpsTime,Infrared"
        rows = [row.replace(" ", ",") for row in ROWS.splitlines()]
        las, lost = self.convert(self.put("a.csv", names + "\n" + "".join(f"{row},700,2,3,6,9,12.5,40\n" for row in rows)), "b.las")
        self.assertEqual(lost, [])
        names, row = self.columns(las)
        own = {"intensity": "700", "return_number": "2", "number_of_returns": "3", "classification": "6",
               "point_source_id": "9", "gps_time": "12.5", "Infrared": "40"}  # which a LAS file without colours has no field for
        self.assertEqual({name: row[names.index(name)] for name in own}, own)
        self.assertNotIn("Classification", names)

    def test_names_of_columns_that_do_not_fit_are_told_where_they_change(self):
        cloud = self.ply("a.ply", ["float Classification", "float ReturnNumber", "float nir"], [3.5, 2, 0.5])
        for name in ("b.las", "b.copc.laz"):
            las, lost = self.convert(cloud, name)
            self.assertEqual(lost, [])
            names, row = self.columns(las)
            own = {"Classification": "3.5", "classification": "0", "return_number": "2", "nir": "0.5"}
            self.assertEqual({name: row[names.index(name)] for name in own}, own)
        cloud = self.ply("c.ply", ["float classification", "uchar Classification", "float nir", *(f"uchar {c}" for c in ("red", "green", "blue"))],
                         [3.5, 6, 0.5, 1, 2, 3])
        las, lost = self.convert(cloud, "c.las")
        self.assertEqual(lost, ["note: the attributes classification, nir get other names in LAS files" + OWN_NAMES])
        names, row = self.columns(las)
        own = {"classification": "0", "classification_2": "3.5", "Classification": "6", "nir": "0", "nir_2": "0.5"}
        self.assertEqual({name: row[names.index(name)] for name in own}, own)

    def test_names_that_are_no_words_are_told_and_differ(self):
        header = 'x,y,z,"a,b","a;b",my attr,my_attr,"say ""a"""\n'
        cloud = self.put("a.csv", header + "".join(row.replace(" ", ",") + ",1,2,3,4,5\n" for row in ROWS.splitlines()))
        for name in ("b.ply", "b.pcd", "b.txt", "b.e57"):
            new, lost = self.convert(cloud, name)
            kind = name[2:].upper()
            told = f'note: the attributes a,b, a;b, my attr, say "a" get other names in {kind} files'
            self.assertEqual(lost, [told + OWN_NAMES])
            names, row = self.columns(new)
            own = {"a_b": "1", "a_b_2": "2", "my_attr_2": "3", "my_attr": "4", "say__a_": "5"}
            self.assertEqual({name: row[names.index(name)] for name in own}, own)

    def test_letters_are_colours_where_all_three_are_there(self):
        for letters, kept in (("a,b,r", "a,b,r"), ("a,b,r,g", "alpha,blue,red,green")):
            values = ",7" * len(letters.split(","))
            rows = "".join(row.replace(" ", ",") + values + "\n" for row in ROWS.splitlines())
            cloud = self.put("a.csv", f"x,y,z,{letters}\n" + rows)
            for name in ("b.ply", "b.txt", "b.las"):
                names, _ = self.columns(self.convert(cloud, name)[0])
                self.assertLessEqual(set(kept.split(",")), set(names))

    def test_whole_numbers_of_64_bits_are_times(self):
        for time, is_time in ((250000000, True), (2 ** 60 + 1, False)):
            las, _ = self.convert(self.ply("a.ply", ["int64 GpsTime"], [time]), "b.las")
            names, row = self.columns(las)
            self.assertEqual("GpsTime" in names, not is_time)
            self.assertEqual(float(row[names.index("gps_time")]), time if is_time else 0)

    def test_colours_keep_their_names_beside_packed_ones(self):
        cloud = self.ply("a.ply", ["uint rgb", "uchar red", "uchar green", "uchar blue"], [0x0a0b0c, 1, 2, 3])
        for name in ("b.csv", "b.las", "b.pcd"):
            new, lost = self.convert(cloud, name)
            depth = 257 if name == "b.las" else 1  # 65535 / 255
            own = {"red": 1 * depth, "green": 2 * depth, "blue": 3 * depth, "rgb_2" if name == "b.pcd" else "rgb": 658188}
            self.assertEqual(len(lost), name == "b.pcd", lost)
            names, row = self.columns(new)
            self.assertEqual({name: int(row[names.index(name)]) for name in own}, own)
        _, lost = self.convert(cloud, "b.off")
        self.assertEqual(lost, ["note: OFF files have no place for the attribute rgb; PLY, PCD and CSV keep it"])

    def test_names_that_others_have_in_a_new_file_are_told(self):
        properties = ["float nx", "float ny", "float nz", "float normal_x", "uchar colorRed", "uchar red", "uchar green",
                      "uchar blue", "double timeStamp", "double gps_time", "float cartesianX"]
        cloud = self.ply("a.ply", properties, [0, 0, 1, 5, 6, 7, 8, 9, 10, 11, 12])
        pcd, lost = self.convert(cloud, "b.pcd")
        its_own = OWN_NAMES.replace("their own are", "its own is")
        self.assertEqual(lost, ["note: the attribute normal_x gets another name in PCD files" + its_own])
        names, row = self.columns(pcd)
        self.assertEqual((row[names.index("nx")], row[names.index("normal_x_2")]), ("0", "5"))
        e57, lost = self.convert(cloud, "b.e57")
        self.assertEqual(lost, ["note: the attributes gps_time, colorRed, cartesianX get other names in E57 files" + OWN_NAMES])
        names, row = self.columns(e57)
        wanted = {"red": "7", "colorRed_2": "6", "timeStamp": "10", "timeStamp_2": "11", "cartesianX_2": "12"}
        self.assertEqual({name: row[names.index(name)] for name in wanted}, wanted)

    def test_names_that_a_further_column_takes_away_are_told(self):
        keep = "CSV, PLY and PCD keep names"
        colored = "".join(f"{row} 700 1 2 3\n" for row in ROWS.splitlines())
        told = "the attributes intensity, red, green, blue, outlier stand there without their names; " + keep
        _, lost = self.convert(self.put("a.pts", "100\n" + colored), "b.pts", "--outliers", "mark")
        self.assertEqual(lost, ["note: PTS files do not name their columns, so " + told])
        told = "the attribute outlier stands there without its name; " + keep
        _, lost = self.convert(self.put("a.xyz", colored), "b.xyz", "--outliers", "mark")
        self.assertEqual(lost, ["note: XYZ files do not name their columns, so " + told])


class Contents(Conversion):
    def told(self, name, content, what, *words, target="b.ply"):
        """That the new file lacks just this."""
        _, lost = self.convert(self.put(name, content), target, *words)
        kind = target.split(".")[-1].upper()
        told = " files that are written anew do not keep " if name.endswith(target[1:]) else " files have no place for "
        self.assertEqual(lost, [f"note: {kind}{told}{what}"])

    def test_names_and_parts_of_stl_are_told(self):
        def solid(name):
            facets = (f"facet normal 0 0 1\nouter loop\nvertex {x} {y} 0\nvertex {x + 1} {y} 0.01\nvertex {x} {y + 1} 0\n"
                      "endloop\nendfacet\n" for x, y, _ in POINTS)
            return f"solid {name}\n{''.join(facets)}endsolid {name}\n"
        self.told("a.stl", solid("bolt") + solid("nut"), "2 names of parts, the borders of 2 parts")
        self.assertEqual(self.convert(self.put("own.stl", solid("pointfair")), "own.ply")[1], [])
        facets = [struct.pack("<12fH", 0, 0, 1, x, y, 0, x + 1, y, 0.01, x, y + 1, 0, 0) for x, y, _ in POINTS]
        for title, lost in ((b"bolt", True), (b"", False), (b"binary STL written by pointfair", False)):
            content = title.ljust(80, b"\0") + struct.pack("<I", len(facets)) + b"".join(facets)
            if lost:
                self.told("c.stl", content, "the title")
            else:
                self.assertEqual(self.convert(self.put("c.stl", content), "c.ply")[1], [])

    def test_comments_before_the_points_of_off_are_told(self):
        self.told("a.off", f"OFF\n# EPSG:25832\n100 0 0\n{ROWS}", "what is commented before the first point")

    def test_scans_of_pts_are_told(self):
        rows = ROWS.splitlines(keepends=True)
        self.told("a.pts", "60\n" + "".join(rows[:60]) + "40\n" + "".join(rows[60:]), "the borders of 2 scans")

    def test_the_shape_of_an_array_is_told(self):
        header = "{'descr': '<f8', 'fortran_order': False, 'shape': (10, 10, 3), }".ljust(117) + "\n"
        array = b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + header.encode()
        array += b"".join(struct.pack("<3d", *point) for point in POINTS)
        grid = "the grid of 10 x 10 points"
        self.told("a.npy", array, grid)
        self.told("a.npy", array, grid, "--outliers", "mark", target="b.npy")

    def test_what_a_header_of_las_says_is_told(self):
        las, _ = self.convert(self.ply("a.ply", [], []), "a.las")
        self.assertEqual(self.convert(las, "b.ply")[1], [])
        says = "what the header of the LAS file says: "
        for at, value, what in ((4, b"\7\0", says + "file source"), (6, b"\x11\0", says + "type of GPS time"),
                                (26, b"scanner 7\0", says + "system"), (90, b"\1\0\xe8\7", says + "date"),
                                (6, b"\x14\0", "the waveforms in the file beside it")):
            content = bytearray(las.read_bytes())
            content[at:at + len(value)] = value
            with self.subTest(what=what):
                self.told("c.las", bytes(content), what)

    def test_what_sampling_leaves_behind_is_told(self):
        mesh = self.put("a.obj", f"# by hand\n{VERTICES}f 1 2 12\nf 1 12 11\n")
        words = ["noise", mesh, self.path("b.ply"), "--points", "50"]
        said = self.ok(*words).stderr.decode()
        self.assertIn("note: the sampled points have positions only, and the result lacks 1 comment\n", said)
        self.fails(3, *words, "--force", "--strict", says=["b.ply", "1 comment", "leave out --strict"])
        plain = self.put("p.obj", f"{VERTICES}f 1 2 12\nf 1 12 11\n")
        said = self.ok("noise", plain, self.path("c.ply"), "--points", "50", "--strict").stderr.decode()
        self.assertNotIn("note: the sampled", said)

    def test_a_text_without_its_outliers_keeps_its_dialect(self):
        front = "\ufeffRechtswert;Hochwert;Höhe;Art\r\n# by hand\r\n"
        rest = [f"{x};{y};{z};oak".replace(".", ",") + "\r\n" for x, y, z in POINTS]
        text = front + "".join(rest[:50]) + "4;4;70,5;ash\r\n\r\n" + "".join(rest[50:])
        table = self.put("a.csv", text)
        for words in ([], ["--tiles", 2]):
            less, lost = self.convert(table, "b.csv", "--outliers", "remove", "--strength", "0", *words)
            self.assertEqual(lost, [])
            self.assertEqual(less.read_bytes().decode(), text.replace("4;4;70,5;ash\r\n", "", 1))

    def test_points_without_a_colour_have_none_in_a_new_obj(self):
        rows = [f"{x},{y},{z}," + ("nan,nan,nan" if i % 2 else "255,0,51") for i, (x, y, z) in enumerate(POINTS)]
        target, lost = self.convert(self.put("some.csv", "x,y,z,red,green,blue\n" + "\n".join(rows)), "some.obj", "--strength", "0")
        self.assertEqual(lost, [])
        lines = target.read_text().splitlines()
        self.assertEqual([line.split()[4:] for line in lines[:4]], [["1", "0", "0.2"], [], ["1", "0", "0.2"], []])

    def test_third_texture_coordinates_are_told(self):
        mesh = f"{VERTICES}vt 0 0 0.5\nvt 1 0 0\nvt 1 1\nf 1/1 2/2 12/3\n"
        self.told("a.obj", mesh, "1 third value of texture coordinates")
