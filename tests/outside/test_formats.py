#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Files of COPC, E57, NumPy, STL and glTF as others read and write them: laspy's own COPC reader with lazrs, libE57Format
inside pye57, numpy, trimesh."""
import unittest

import packages
from packages import pointfair

np, laspy, pye57, trimesh = packages.use(["numpy", "laspy==2.7.0", "lazrs==0.8.2", "pye57==0.4.19", "trimesh==4.12.2"],
                                         ["numpy", "laspy", "pye57", "trimesh"])
from laspy.copc import Bounds, CopcReader  # noqa: E402


class Formats(packages.InFolder):
    def setUp(self):
        super().setUp()
        self.random = np.random.default_rng(1)

    def survey(self, point_format, count=60000):
        header = laspy.LasHeader(point_format=point_format, version="1.4" if point_format >= 6 else "1.2")
        header.scales, header.offsets = [0.001] * 3, [500000, 4000000, 0]
        header.add_extra_dim(laspy.ExtraBytesParams("height", "f4"))
        las = laspy.LasData(header)
        x, y = self.random.uniform(0, 300, count), self.random.uniform(0, 100, count)
        z = 3 * np.sin(x / 20) + np.where(np.arange(count) % 5 == 0, self.random.uniform(0, 15, count), 0)
        las.x, las.y, las.z = x + 500000, y + 4000000, z
        las.intensity = self.random.integers(0, 60000, count)
        las.return_number = self.random.integers(1, 4, count)
        las.number_of_returns = np.full(count, 3)
        las.classification = np.where(z > 5, 5, 2)
        las.user_data = np.arange(count) % 256
        las.height = z.astype("f4")
        if "gps_time" in las.point_format.dimension_names:
            las.gps_time = np.sort(self.random.uniform(1e5, 2e5, count))
        if "red" in las.point_format.dimension_names:
            las.red = las.green = las.blue = self.random.integers(0, 65536, count)
        path = self.folder / f"survey{point_format}.las"
        las.write(path)
        return path, las

    def rows(self, points, names):
        columns = [np.asarray(points[name]).astype("f8") for name in names]
        return np.sort(np.rec.fromarrays(columns), order=None)

    def test_copc_is_what_laspy_expects(self):
        for point_format in (1, 3, 6, 7):
            with self.subTest(point_format=point_format):
                path, las = self.survey(point_format)
                out = self.folder / f"out{point_format}.copc.laz"
                pointfair("run", path, out, "--strength", "0", "-q")
                with CopcReader.open(str(out)) as reader:
                    self.assertEqual(reader.header.point_count, len(las.points))
                    everything = reader.query()
                    names = [name for name in las.point_format.dimension_names
                             if name not in ("scan_angle_rank", "scan_angle", "raw_classification")]
                    self.assertTrue((self.rows(las.points, names) == self.rows(everything, names)).all())
                    self.check_queries(reader, las)
                    self.check_nodes(reader)

    def check_queries(self, reader, las):
        grid = np.stack([las.X, las.Y, las.Z], 1)
        low, high = (side * las.header.scales + las.header.offsets for side in (grid.min(0), grid.max(0)))
        found = 0
        for _ in range(20):
            least = low + (high - low) * self.random.uniform(0, 0.7, 3)
            most = least + (high - low) * self.random.uniform(0.05, 0.3, 3)
            steps = [np.round((side - las.header.offsets) / las.header.scales) for side in (least, most)]  # as laspy does
            wanted = ((grid >= steps[0]) & (grid <= steps[1])).all(1).sum()
            self.assertEqual(len(reader.query(bounds=Bounds(least, most))), wanted)
            found += wanted
        self.assertGreater(found, 1000)

    def check_nodes(self, reader):
        info, counts = reader.copc_info, {}
        for key, entry in reader.root_page.entries.items():
            counts.setdefault(key.level, {})[(key.x, key.y, key.z)] = entry.point_count
        self.assertGreater(len(counts), 2)
        for level, nodes in counts.items():
            points = reader.query(level=level)
            self.assertEqual(len(points), sum(nodes.values()))
            side = 2 * info.halfsize / 2**level
            places = (np.stack([points.x, points.y, points.z], 1) - (info.center - info.halfsize)) / side
            cells, found = np.unique(np.floor(places).astype(int), axis=0, return_counts=True)
            self.assertEqual({tuple(cell): n for cell, n in zip(cells.tolist(), found.tolist())}, nodes)

    def test_e57_of_any_cloud_is_what_pye57_expects(self):
        path, las = self.survey(7, 30000)
        out = self.folder / "out.e57"
        pointfair("run", path, out, "--strength", "0", "-q")
        file = pye57.E57(str(out))
        self.assertEqual(file.scan_count, 1)
        scan = file.read_scan_raw(0, ignore_unsupported_fields=True)
        for axis, values in zip("XYZ", (las.x, las.y, las.z)):
            self.assertLess(np.abs(scan["cartesian" + axis] - np.asarray(values)).max(), 1e-9)
        self.assertTrue((scan["intensity"] == np.asarray(las.intensity)).all())
        self.assertLess(np.abs(scan["colorRed"] - np.asarray(las.red) / 257).max(), 0.51)
        fields = file.get_header(0).point_fields
        for name in ("pf:classification", "pf:height", "timeStamp"):
            self.assertIn(name, fields)
        back = self.folder / "back.npy"
        pointfair("run", out, back, "--strength", "0", "-q")
        array = np.load(back)
        self.assertTrue((array["classification"] == np.asarray(las.classification)).all())
        self.assertTrue((array["height"] == np.asarray(las.height)).all())

    def test_invalid_points_of_e57(self):
        points = np.arange(300, dtype="f4").reshape(100, 3)
        points[::7] = np.nan
        np.save(self.folder / "in.npy", points)
        pointfair("run", self.folder / "in.npy", self.folder / "out.e57", "--strength", "0", "-q")
        scan = pye57.E57(str(self.folder / "out.e57")).read_scan_raw(0)
        self.assertTrue(((scan["cartesianInvalidState"] != 0) == np.isnan(points[:, 0])).all())
        valid = ~np.isnan(points[:, 0])
        self.assertTrue((scan["cartesianY"][valid] == points[valid, 1]).all())

    def test_numpy_arrays(self):
        plain = self.random.uniform(-5, 5, (500, 5))
        records = np.zeros(500, dtype=[("id", "<i8"), ("x", ">f8"), ("y", ">f8"), ("z", ">f8"), ("rgb", "u1", (3,)), ("name", "U3")])
        for axis, values in zip("xyz", plain.T):
            records[axis] = values
        records["id"], records["name"] = np.arange(500), "abc"
        little = records.astype([(n, str(records.dtype[n]).replace(">", "<") if n in "xyz" else records.dtype[n]) for n in records.dtype.names])
        for array in (plain, plain.astype("f4"), np.asfortranarray(plain), plain.astype(">f4"), plain.reshape(50, 10, 5), little):
            np.save(self.folder / "in.npy", array)
            for out in ("same.npy", "out.ply"):
                pointfair("run", self.folder / "in.npy", self.folder / out, "--strength", "0", "-q", "--force")
            self.assertEqual((self.folder / "in.npy").read_bytes(), (self.folder / "same.npy").read_bytes())
            pointfair("run", self.folder / "out.ply", self.folder / "back.npy", "--strength", "0", "-q", "--force")
            back = np.load(self.folder / "back.npy")
            flat = array if array.dtype.names else array.reshape(-1, 5)
            for column, axis in enumerate("xyz"):
                wanted = flat[axis] if array.dtype.names else flat[:, column]
                self.assertTrue((back[axis] == wanted).all())
        pointfair("run", self.folder / "in.npy", self.folder / "moved.npy", "-q")
        self.assertEqual(np.load(self.folder / "moved.npy")["name"].tolist(), ["abc"] * 500)

    def test_meshes_of_trimesh(self):
        mesh = trimesh.creation.icosphere(subdivisions=3)
        turned = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [0.1, 0.2, 0.3])
        scene = trimesh.Scene()
        scene.add_geometry(mesh, transform=turned)
        scene.add_geometry(trimesh.creation.box(), transform=trimesh.transformations.translation_matrix([5, 0, 0]))
        scene.export(self.folder / "scene.glb")
        pointfair("run", self.folder / "scene.glb", self.folder / "scene.ply", "--strength", "0", "-q")
        read, wanted = trimesh.load(self.folder / "scene.ply", process=False), scene.to_geometry()
        self.assertEqual(len(read.faces), len(wanted.faces))
        self.assertLess(abs(read.volume - wanted.volume), 1e-5)
        self.assertLess(np.abs(np.sort(read.vertices, 0) - np.sort(wanted.vertices, 0)).max(), 1e-6)
        for encoding in ("binary", "ascii"):
            pointfair("run", self.folder / "scene.glb", self.folder / "scene.stl", "--strength", "0", "-q", "--force", "--encoding", encoding)
            self.assertLess(abs(trimesh.load(self.folder / "scene.stl").volume - wanted.volume), 1e-5)
        for kind in ("stl", "stl_ascii"):
            mesh.export(self.folder / "mesh.stl", file_type=kind)
            pointfair("run", self.folder / "mesh.stl", self.folder / "mesh.ply", "--strength", "0", "-q", "--force")
            soup = trimesh.load(self.folder / "mesh.ply", process=False)
            self.assertEqual(len(soup.vertices), 3 * len(mesh.faces))
            self.assertLess(np.abs(soup.triangles - mesh.triangles).max(), 1e-6)


if __name__ == "__main__":
    unittest.main()
