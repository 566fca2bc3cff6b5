#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What we write as others read it: plyfile, meshio and trimesh, and Open3D where it is installed. N points for N, in
their order, with their values."""
import importlib.util
import unittest

import packages
from packages import pointfair

np, plyfile, meshio, trimesh = packages.use(["numpy", "plyfile==1.1", "meshio==5.3.5", "trimesh==4.12.2"],
                                            ["numpy", "plyfile", "meshio", "trimesh"])
POINTS = 700


class Readers(packages.InFolder):
    def setUp(self):
        super().setUp()
        random = np.random.default_rng(3)
        self.xyz = np.round(random.uniform(-50, 50, (POINTS, 3)), 4)
        self.rgb = random.integers(0, 256, (POINTS, 3))
        self.normals = random.normal(size=(POINTS, 3))
        self.normals = np.round(self.normals / np.linalg.norm(self.normals, axis=1)[:, None], 6)
        self.faces = np.arange(POINTS - POINTS % 3).reshape(-1, 3)
        self.source = self.folder / "in.csv"
        table = np.hstack([self.xyz, self.rgb, self.normals, np.arange(POINTS)[:, None]])
        np.savetxt(self.source, table, fmt=["%.4f"] * 3 + ["%d"] * 3 + ["%.6f"] * 3 + ["%d"], delimiter=",", comments="",
                   header="x,y,z,red,green,blue,nx,ny,nz,id")

    def written(self, name, *words, source=None):
        out = self.folder / name
        pointfair("run", source or self.source, out, "--strength", "0", "-q", "--force", *words)
        return out

    def close(self, found, wanted, tolerance=4e-6):
        found = np.asarray(found, dtype=float)
        self.assertEqual(found.shape, wanted.shape)
        self.assertLessEqual(np.abs(found - wanted).max(), tolerance)

    def mesh(self):
        """The same cloud with faces."""
        path = self.folder / "in.obj"
        rows = ["v %.4f %.4f %.4f" % tuple(row) for row in self.xyz] + ["f %d %d %d" % tuple(row + 1) for row in self.faces]
        path.write_text("\n".join(rows) + "\n")
        return path

    def test_ply(self):
        for encoding in ("ascii", "binary", "binary-big-endian"):
            with self.subTest(encoding=encoding):
                path = self.written("out.ply", "--encoding", encoding)
                vertex = plyfile.PlyData.read(str(path))["vertex"]
                self.close(np.stack([vertex[axis] for axis in "xyz"], 1), self.xyz)
                self.assertTrue((np.stack([vertex[c] for c in ("red", "green", "blue")], 1) == self.rgb).all())
                self.assertEqual(vertex["red"].dtype, np.uint8)
                self.close(np.stack([vertex[c] for c in ("nx", "ny", "nz")], 1), self.normals, 1e-6)
                self.assertTrue((vertex["id"] == np.arange(POINTS)).all())
                self.close(meshio.read(path).points, self.xyz)
                cloud = trimesh.load(path)
                self.close(cloud.vertices, self.xyz)
                self.assertTrue((cloud.colors[:, :3] == self.rgb).all())

    def test_meshes(self):
        for name in ("out.ply", "out.off", "out.obj", "again.stl"):
            with self.subTest(name=name):
                path = self.written(name, source=self.mesh())
                read = trimesh.load(path, process=False)
                self.close(read.triangles, self.xyz[self.faces])
                if name.endswith("stl"):
                    continue
                self.close(read.vertices if len(read.vertices) == POINTS else meshio.read(path).points, self.xyz)
                if not name.endswith("obj"):
                    self.assertTrue((read.faces == self.faces).all())
                other = meshio.read(path)
                self.close(other.points, self.xyz)
                self.assertTrue((other.cells_dict["triangle"] == self.faces).all())

    def test_text(self):
        for name, separator, skipped in (("out.xyz", None, 0), ("out.txt", None, 1), ("out.pts", None, 1), ("out.csv", ",", 1)):
            with self.subTest(name=name):
                table = np.loadtxt(self.written(name), delimiter=separator, skiprows=skipped)
                self.close(table[:, :3], self.xyz)
                self.assertTrue((table[:, 3:6] == self.rgb).all())
                self.close(table[:, 6:9], self.normals, 1e-6)

    def test_open3d(self):
        if not importlib.util.find_spec("open3d"):
            self.skipTest("open3d is not installed")
        import open3d
        for name, encoding in (("out.pcd", "ascii"), ("out.pcd", "binary"), ("out.pcd", "binary-compressed"), ("out.ply", "binary")):
            with self.subTest(name=name, encoding=encoding):
                cloud = open3d.io.read_point_cloud(str(self.written(name, "--encoding", encoding)))
                self.close(np.asarray(cloud.points), self.xyz)
                self.close(np.asarray(cloud.colors) * 255, self.rgb, 1e-6)
                self.close(np.asarray(cloud.normals), self.normals, 1e-6)
        mesh = open3d.io.read_triangle_mesh(str(self.written("out.off", source=self.mesh())))
        self.close(np.asarray(mesh.vertices), self.xyz)
        self.assertTrue((np.asarray(mesh.triangles) == self.faces).all())


if __name__ == "__main__":
    unittest.main()
