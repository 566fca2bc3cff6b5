# SPDX-License-Identifier: Apache-2.0
"""run --connectivity mesh: what is said of faces, and where a mesh is refused."""
import random

from program import Case, write_off, write_ply


def sheet(n=24, noise=0.3):
    """Vertices over a grid with noise, and its quads."""
    generator = random.Random(3)
    vertices = [tuple(c + generator.gauss(0, noise) for c in (float(i), float(j), 0.0)) for i in range(n) for j in range(n)]
    faces = [(i * n + j, i * n + j + n, i * n + j + n + 1, i * n + j + 1) for i in range(n - 1) for j in range(n - 1)]
    return vertices, faces


class Mesh(Case):
    def setUp(self):
        super().setUp()
        self.vertices, self.faces = sheet()
        self.mesh = write_off(self.path("mesh.off"), self.vertices, self.faces)

    def test_faces_that_are_ignored_are_told_and_kept(self):
        says = self.ok("run", self.mesh, self.path("out.off")).stderr.decode()
        self.assertIn(f"the {len(self.faces)} faces of the file are not followed; --connectivity mesh", says)
        said = self.ok("run", self.mesh, self.path("asked.off"), "--connectivity", "points").stderr.decode()
        self.assertNotIn("faces", said)
        self.assertEqual(self.path("out.off").read_bytes(), self.path("asked.off").read_bytes())

    def test_materials_that_stay_beside_the_input_are_told(self):
        lines = ["mtllib my statue.mtl", *("v {} {} {}".format(*v) for v in self.vertices), "usemtl skin",
                 *("f {} {} {} {}".format(*(i + 1 for i in face)) for face in self.faces)]
        source, folder = self.path("in.obj"), self.path("results")
        source.write_text("\n".join(lines) + "\n")
        self.path("my statue.mtl").write_text("newmtl skin\nmap_Kd skin.png\n")
        folder.mkdir()

        def said(out):
            return self.ok("run", source, out, "--force", "--connectivity", "mesh").stderr.decode()
        self.assertIn("note: beside the input only lies what the result names: my statue.mtl. Copy it and the pictures", said(folder / "out.obj"))
        self.assertIn("no place for the material 'skin', the materials of 'my statue.mtl'", said(folder / "out.ply"))
        self.assertNotIn("beside the input only", said(self.path("beside.obj")))
        (folder / "my statue.mtl").write_text("")
        self.assertNotIn("beside the input only", said(folder / "out.obj"))
        self.path("a.mtl").write_text("")
        self.path("b.mtl").write_text("")
        source.write_text("\n".join(lines[1:] + ["mtllib a.mtl b.mtl", "mtllib a.mtl"]) + "\n")
        self.assertIn("beside the input only lies what the result names: a.mtl, b.mtl. Copy", said(folder / "out.obj"))

    def test_pictures_that_stay_beside_the_input_are_told(self):
        head = "ply\nformat ascii 1.0\ncomment TextureFile here.png\ncomment TextureFile a skin.png\nelement vertex 576\n"
        head += "".join(f"property float {axis}\n" for axis in "xyz") + f"element face {len(self.faces)}\n"
        head += "property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
        rows = ["{} {} {}".format(*v) for v in self.vertices] + ["4 {} {} {} {} 8 0 0 1 0 1 1 0 1".format(*face) for face in self.faces]
        source, folder = self.path("in.ply"), self.path("results")
        source.write_text(head + "\n".join(rows) + "\n")
        folder.mkdir()

        def said(out):
            return self.ok("run", source, out, "--force").stderr.decode()
        self.assertNotIn("beside the input only", said(folder / "out.ply"))  # it is nowhere
        self.path("a skin.png").write_bytes(b"")
        self.assertIn("note: beside the input only lies what the result names: a skin.png. Copy it to the result", said(folder / "out.ply"))
        self.assertNotIn("beside the input only", said(self.path("beside.ply")))
        self.assertNotIn("beside the input only", said(folder / "out.off"))
        (folder / "a skin.png").write_bytes(b"")
        self.assertNotIn("beside the input only", said(folder / "out.ply"))

    def test_the_mesh_and_its_folds_are_told_and_reported(self):
        says = self.ok("run", self.mesh, self.path("out.off"), "--connectivity", "mesh").stderr.decode()
        self.assertIn(f"mesh of {24 * 24} vertices and {len(self.faces)} faces, {4 * 23} vertices on its boundary", says)
        found = self.report("run", self.mesh, self.path("again.off"), "--connectivity", "mesh")["mesh"]
        self.assertIn(f"folded faces: {found['folded_before']} before, {found['folded_after']} after", says)
        self.assertLessEqual(found["folded_after"], found["folded_before"])
        before, after = self.mesh.read_text().splitlines(), self.path("out.off").read_text().splitlines()
        self.assertEqual(before[-len(self.faces):], after[-len(self.faces):])
        self.assertNotEqual(before, after)
        self.assertIsNone(self.report("run", self.mesh, self.path("points.off"))["mesh"])

    def test_vertices_that_limits_and_the_boundary_keep_count_once(self):
        words = ["run", self.mesh, self.path("half.off"), "--connectivity", "mesh", "--box", "-9,-9,-9,11.5,99,9"]
        says = self.ok(*words).stderr.decode()
        place = lambda path: [row.split() for row in path.read_text().splitlines()[2:2 + 24 * 24]]
        moved = sum(a != b for a, b in zip(place(self.mesh), place(self.path("half.off"))))
        within = sum(x <= 11.5 for x, _, _ in self.vertices)
        self.assertIn(f"{moved} points denoised", says)
        self.assertIn(f"{4 * 23} kept as they were", says)
        self.assertIn(f"held {24 * 24 - moved - 4 * 23} others in place", says)
        self.assertLess(moved, within)
        says = self.ok(*words[:-1], "-9,-9,-9,-8,99,9", "--force").stderr.decode()
        self.assertIn(f"held {24 * 24 - 4 * 23} others in place", says)
        self.assertIn("leave no point to denoise", says)

    def test_all_points_of_an_stl_file_that_the_boundary_keeps_are_counted(self):
        facets, kept = self.path("in.stl"), self.path("out.stl")
        self.ok("run", self.mesh, facets, "--strength", 0, "--encoding", "ascii", "-q")
        says = self.ok("run", facets, kept, "--connectivity", "mesh").stderr.decode()
        corners = [[line for line in path.read_text().splitlines() if "vertex" in line] for path in (facets, kept)]
        stayed = sum(a == b for a, b in zip(*corners))
        self.assertGreater(stayed, 2 * 4 * 23)
        self.assertIn(f"{len(corners[0]) - stayed} points denoised", says)
        self.assertIn(f"{stayed} on the border of the mesh", says)

    def test_fleishman_tells_what_it_measured(self):
        words = ["--connectivity", "mesh", "--method", "fleishman"]
        used = self.report("run", self.mesh, self.path("out.off"), *words)["params"]
        self.assertAlmostEqual(float(used["radius"]), 2 * float(used["closeness_sigma"]), delta=1e-5)
        self.assertGreater(float(used["radius"]), 2)  # two diagonals of unit quads, with noise
        self.assertLess(float(used["similarity_sigma"]), 0.6)
        given = [f"--{name.replace('_', '-')}={used[name]}" for name in ("radius", "closeness_sigma", "similarity_sigma")]
        self.ok("run", self.mesh, self.path("given.off"), *words, *given)
        self.assertEqual(self.path("out.off").read_bytes(), self.path("given.off").read_bytes())

    def test_what_cannot_be(self):
        cloud = write_ply(self.path("cloud.ply"), self.vertices)
        out, mesh = self.path("out.ply"), ["--connectivity", "mesh"]
        self.fails(2, "run", cloud, out, *mesh, says="needs faces")
        self.fails(2, "run", self.mesh, out, *mesh, "--k", "8", says="--rings")
        self.fails(2, "run", self.mesh, out, "--rings", "2", says="--connectivity mesh")
        self.fails(2, "run", self.mesh, out, *mesh, "--method", "learned", says="learned")
        self.fails(2, "run", self.mesh, out, *mesh, "--tiles", "2", says="tiles on disk")
        for method in ("fleishman", "jones"):
            self.fails(2, "run", self.mesh, out, "--method", method, says=f"--method {method} reads faces: add --connectivity mesh")
