# SPDX-License-Identifier: Apache-2.0
"""pointfair compare against brute force."""
import math
import pathlib
import random
import sys

from program import CUBE_FACES, CUBE_VERTICES, Case, write_off, write_ply

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "golden"))
from clouds import cube_quads  # noqa: E402

KEYS = ["points", "diagonal", "mean", "rms", "p95", "max", "chamfer", "edge_rms"]


def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def along(a, b, t):
    return tuple(x + t * (y - x) for x, y in zip(a, b))


def segment_distance(p, a, b):
    ab = sub(b, a)
    length = dot(ab, ab)
    t = min(1.0, max(0.0, dot(sub(p, a), ab) / length)) if length > 0 else 0.0
    return math.dist(p, along(a, b, t))


def triangle_foot(p, a, b, c):
    """Closest point by the regions of the triangle (Ericson, Real-Time Collision Detection, 5.1.5)."""
    ab, ac, ap = sub(b, a), sub(c, a), sub(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0 and d2 <= 0:
        return a
    bp = sub(p, b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0 and d4 <= d3:
        return b
    vc = d1 * d4 - d3 * d2
    if vc <= 0 <= d1 and d3 <= 0:
        return along(a, b, d1 / (d1 - d3))
    cp = sub(p, c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0 and d5 <= d6:
        return c
    vb = d5 * d2 - d1 * d6
    if vb <= 0 <= d2 and d6 <= 0:
        return along(a, c, d2 / (d2 - d6))
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        return along(b, c, (d4 - d3) / ((d4 - d3) + (d5 - d6)))
    total = va + vb + vc
    return tuple(x + y * vb / total + z * vc / total for x, y, z in zip(a, ab, ac))


def feet_on_mesh(points, vertices, faces):
    return [min((triangle_foot(p, *(vertices[i] for i in f)) for f in faces), key=lambda q: math.dist(p, q))
            for p in points]


def nearest(points, others):
    return [min(math.dist(p, q) for q in others) for p in points]


def expected_chamfer(a, b):
    low, high = ([pick(p[i] for p in b) for i in range(3)] for pick in (min, max))
    centre = [(x + y) / 2 for x, y in zip(low, high)]
    radius = max(math.dist(p, centre) for p in b)
    return sum(sum(d * d for d in nearest(*pair)) / len(pair[0]) for pair in ((a, b), (b, a))) / radius**2


class Compare(Case):
    def random_points(self, count, low=-1.0, high=2.0, seed=3):
        generator = random.Random(seed)
        return [tuple(generator.uniform(low, high) for _ in range(3)) for _ in range(count)]

    def random_mesh(self):
        vertices = self.random_points(40, seed=5)
        generator = random.Random(6)
        return vertices, [tuple(generator.sample(range(40), 3)) for _ in range(60)]

    def compare(self, points, name, *words, scalar="double"):
        cloud = write_ply(self.path("cloud.ply"), points, scalar=scalar)
        return self.report("compare", cloud, self.path(name), *words)

    def assert_distances(self, report, distances):
        ordered = sorted(distances)
        self.assertEqual(report["points"], len(ordered))
        scale = ordered[-1]
        self.assertAlmostEqual(report["mean"], sum(ordered) / len(ordered), delta=2e-7 * scale)
        self.assertAlmostEqual(report["rms"], math.sqrt(sum(d * d for d in ordered) / len(ordered)), delta=2e-7 * scale)
        self.assertAlmostEqual(report["p95"], ordered[math.ceil(0.95 * len(ordered)) - 1], delta=2e-7 * scale)
        self.assertAlmostEqual(report["max"], scale, delta=2e-7 * scale)

    def test_mesh_distances_equal_brute_force(self):
        vertices, faces = self.random_mesh()
        write_ply(self.path("mesh.ply"), vertices, faces, scalar="double")
        points = self.random_points(300)
        report = self.compare(points, "mesh.ply")
        self.assertEqual([key for key in report if key in KEYS], KEYS)
        self.assert_distances(report, [math.dist(p, q) for p, q in zip(points, feet_on_mesh(points, vertices, faces))])
        self.assertIsNone(report["edge_rms"])
        self.assertAlmostEqual(report["chamfer"], expected_chamfer(points, vertices), delta=1e-6)

    def test_cloud_distances_equal_brute_force(self):
        reference = self.random_points(200, seed=8)
        write_ply(self.path("reference.ply"), reference, scalar="double")
        points = self.random_points(150)
        report = self.compare(points, "reference.ply")
        self.assert_distances(report, nearest(points, reference))
        self.assertAlmostEqual(report["chamfer"], expected_chamfer(points, reference), delta=1e-6)
        low, high = ([pick(p[i] for p in reference) for i in range(3)] for pick in (min, max))
        self.assertAlmostEqual(report["diagonal"], math.dist(low, high), delta=1e-6)

    def test_a_mesh_can_be_taken_as_a_cloud(self):
        vertices, faces = self.random_mesh()
        write_ply(self.path("mesh.ply"), vertices, faces, scalar="double")
        points = self.random_points(50)
        self.assert_distances(self.compare(points, "mesh.ply", "--as", "cloud"), nearest(points, vertices))

    def test_the_standard_scaling_does_not_depend_on_unit_or_place(self):
        reference, points = self.random_points(80, seed=8), self.random_points(60)
        write_ply(self.path("reference.ply"), reference, scalar="double")
        plain = self.compare(points, "reference.ply")
        moved = [[tuple(1000 * c + 4.5e6 for c in p) for p in cloud] for cloud in (reference, points)]
        write_ply(self.path("reference.ply"), moved[0], scalar="double")
        there = self.compare(moved[1], "reference.ply")
        self.assertAlmostEqual(there["chamfer"], plain["chamfer"], delta=1e-6)
        self.assertAlmostEqual(there["mean"], 1000 * plain["mean"], delta=1e-3)

    def test_a_cloud_equals_itself(self):
        points = self.random_points(50)
        write_ply(self.path("same.ply"), points, scalar="double")
        report = self.compare(points, "same.ply")
        self.assertEqual((report["mean"], report["max"], report["chamfer"]), (0, 0, 0))

    def test_points_very_far_away(self):
        write_off(self.path("cube.off"), CUBE_VERTICES, CUBE_FACES)
        for far in (1e3, 1e6, 1e12, 1e25):
            report = self.compare([(far, 0.5, 0.5), (0.5, -far, 0.5)], "cube.off")
            self.assertAlmostEqual(report["mean"] / (far - 0.5), 1, delta=1e-6)

    def test_points_that_are_not_numbers_are_left_out(self):
        write_off(self.path("cube.off"), CUBE_VERTICES, CUBE_FACES)
        report = self.compare([(float("nan"), 0.0, 0.0), (0.5, 0.5, 3.0), (float("inf"), 0.0, 0.0)], "cube.off")
        self.assertEqual(report["points"], 1)
        self.assertAlmostEqual(report["mean"], 2)

    def test_degenerate_faces(self):
        vertices = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 5.0, 0.0)]
        write_off(self.path("thin.off"), vertices, [(0, 1, 2), (3, 3, 3), (0, 0, 1)])
        report = self.compare([(1.5, -3.0, 4.0), (0.0, 5.0, 2.0)], "thin.off")
        self.assertAlmostEqual(report["max"], 5)
        self.assertAlmostEqual(report["mean"], 3.5)


class Edges(Case):
    def edge_rms(self, vertices, faces, points, degrees=40):
        """Brute force; an edge is sharp by the angle between its faces' normals, oriented as the faces run."""
        diagonal = math.dist(*([pick(p[i] for p in vertices) for i in range(3)] for pick in (min, max)))
        sides = {}
        for face in faces:
            a, b, c = (vertices[i] for i in face)
            u, v = sub(b, a), sub(c, a)
            normal = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
            for i in range(3):
                sides.setdefault(frozenset((face[i], face[(i + 1) % 3])), []).append(normal)
        sharp = []
        for edge, normals in sides.items():
            if len(normals) != 2:
                continue
            cosine = dot(*normals) / math.sqrt(dot(normals[0], normals[0]) * dot(normals[1], normals[1]))
            if math.degrees(math.acos(max(-1.0, min(1.0, cosine)))) > degrees:
                sharp.append([vertices[i] for i in edge])
        squares = [math.dist(p, q) ** 2 for p, q in zip(points, feet_on_mesh(points, vertices, faces))
                   if sharp and min(segment_distance(q, a, b) for a, b in sharp) <= 0.01 * diagonal]
        return math.sqrt(sum(squares) / len(squares)) if squares else None

    def near_cube(self, count=1500):
        generator = random.Random(4)
        points = []
        for _ in range(count):
            p = [generator.random() for _ in range(3)]
            p[generator.randrange(3)] = generator.choice((0.0, 1.0))
            points.append(tuple(c + generator.gauss(0, 0.01) for c in p))
        return points

    def test_near_sharp_edges_equals_brute_force(self):
        points = self.near_cube()
        write_ply(self.path("cloud.ply"), points, scalar="double")
        write_off(self.path("cube.off"), CUBE_VERTICES, CUBE_FACES)
        report = self.report("compare", self.path("cloud.ply"), self.path("cube.off"), "--edges", 40)
        self.assertAlmostEqual(report["edge_rms"], self.edge_rms(CUBE_VERTICES, CUBE_FACES, points), delta=1e-7)
        self.assertGreater(report["edge_points"], 20)
        flat = self.report("compare", self.path("cloud.ply"), self.path("cube.off"), "--edges", 91)
        self.assertIsNone(flat["edge_rms"])

    def test_normals_of_points_on_tilted_planes(self):
        generator = random.Random(9)
        points = [(x, y, math.tan(math.radians(7)) * x) for x, y in
                  ((generator.uniform(0.2, 0.8), generator.uniform(0.2, 0.8)) for _ in range(400))]
        points[5] = (math.nan, 0, 0)
        write_ply(self.path("cloud.ply"), points, scalar="double")
        write_off(self.path("square.off"), [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 3, 2)])
        words = ("compare", self.path("cloud.ply"), self.path("square.off"))
        self.assertAlmostEqual(self.report(*words, "--normals", 12)["normal_error"], 7, delta=1e-3)
        self.assertIsNone(self.report(*words)["normal_error"])
        self.fails(2, *words, "--as", "cloud", "--normals", 12, says="--normals needs a mesh")

    def test_repeated_vertices_and_faces_turned_over_change_nothing(self):
        points = self.near_cube()
        write_ply(self.path("cloud.ply"), points, scalar="double")
        vertices = [CUBE_VERTICES[i] for face in CUBE_FACES for i in face]
        faces = [(3 * i, 3 * i + 1, 3 * i + 2) if i % 3 else (3 * i, 3 * i + 2, 3 * i + 1) for i in range(12)]
        write_off(self.path("soup.off"), vertices, faces)
        report = self.report("compare", self.path("cloud.ply"), self.path("soup.off"), "--edges", 40)
        self.assertAlmostEqual(report["edge_rms"], self.edge_rms(CUBE_VERTICES, CUBE_FACES, points), delta=1e-7)

    def test_a_cloud_has_no_edges(self):
        cloud = write_ply(self.path("cloud.ply"), self.near_cube(10))
        self.fails(2, "compare", cloud, cloud, "--edges", 40, says="mesh")
        for angle in ("nan", "181", "-1", "wide"):
            self.fails(2, "compare", cloud, cloud, "--edges", angle, says=f"'{angle}' is no number from 0 to 180")


def cross(u, v):
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def face_normal(vertices, face):
    """Newell's, twice the area long."""
    sides = zip(face, face[1:] + face[:1])
    return tuple(sum(parts) for parts in zip(*(cross(vertices[i], vertices[j]) for i, j in sides)))


def angle(u, v):
    return math.degrees(math.acos(max(-1.0, min(1.0, dot(u, v) / math.sqrt(dot(u, u) * dot(v, v))))))


def volume(vertices, faces):
    return sum(dot(vertices[f[0]], cross(vertices[f[i - 1]], vertices[f[i]])) for f in faces for i in range(2, len(f))) / 6


class Faces(Case):
    def quads(self, n=4):
        """The unit cube's surface in n x n quads a side, which run round outwards."""
        vertices, quads = cube_quads(n)
        return [tuple(c / n for c in p) for p in vertices], [face if outwards else face[::-1] for face, outwards in quads]

    def noisy(self, vertices, sigma=0.03):
        generator = random.Random(2)
        moved = [tuple(c + generator.gauss(0, sigma) for c in p) for p in vertices]
        moved[9] = tuple(c + 0.6 for c in moved[40])  # folds faces
        return moved

    def compared(self, vertices, faces, *words):
        mesh = write_off(self.path("a.off"), vertices, faces)
        return self.report("compare", mesh, self.path("b.off"), *words)["faces"]

    def test_faces_of_other_corners_equal_brute_force(self):
        clean, faces = self.quads()
        vertices = self.noisy(clean)
        write_off(self.path("b.off"), CUBE_VERTICES, CUBE_FACES)
        sign = 1 if volume(CUBE_VERTICES, CUBE_FACES) > 0 else -1
        angles = []
        for face in faces:
            place = tuple(sum(vertices[i][axis] for i in face) / len(face) for axis in range(3))
            nearest_face = min(CUBE_FACES, key=lambda f: math.dist(place, triangle_foot(place, *(CUBE_VERTICES[i] for i in f))))
            reference = face_normal(CUBE_VERTICES, nearest_face)
            angles.append(angle(face_normal(vertices, face), tuple(sign * c for c in reference)))
        found = self.compared(vertices, faces)
        self.assertEqual(found["faces"], len(faces))
        self.assertEqual(found["folded"], sum(a > 90 for a in angles))
        self.assertGreater(found["folded"], 0)
        self.assertAlmostEqual(found["normal_error"], sum(angles) / len(angles), delta=1e-4)
        triangles = [(f[0], f[i - 1], f[i]) for f in faces for i in range(2, len(f))]
        back = [math.dist(p, q) for p, q in zip(CUBE_VERTICES, feet_on_mesh(CUBE_VERTICES, vertices, triangles))]
        self.assertAlmostEqual(found["back"]["mean"], sum(back) / len(back), delta=1e-6)
        self.assertAlmostEqual(found["back"]["max"], max(back), delta=1e-6)
        self.assertAlmostEqual(found["volume"], volume(vertices, faces), delta=1e-6)
        self.assertAlmostEqual(found["reference_volume"], 1, delta=1e-6)

    def test_faces_of_the_same_corners_are_compared_with_their_own(self):
        clean, faces = self.quads()
        write_off(self.path("b.off"), clean, faces)
        vertices = self.noisy(clean)
        angles = [angle(face_normal(vertices, f), face_normal(clean, f)) for f in faces]
        found = self.compared(vertices, faces)
        self.assertAlmostEqual(found["normal_error"], sum(angles) / len(angles), delta=1e-4)
        self.assertEqual(found["folded"], sum(a > 90 for a in angles))
        itself = self.compared(clean, faces)
        self.assertEqual((itself["folded"], itself["back"]["max"]), (0, 0))
        self.assertAlmostEqual(itself["normal_error"], 0, delta=1e-5)

    def test_meshes_may_run_round_the_other_way_and_be_open(self):
        clean, faces = self.quads()
        write_off(self.path("b.off"), CUBE_VERTICES, CUBE_FACES)
        vertices = self.noisy(clean)
        turned = self.compared(vertices, [f[:1] + f[:0:-1] for f in faces])
        found = self.compared(vertices, faces)
        for key in ("faces", "folded", "volume"):
            self.assertAlmostEqual(turned[key], found[key], delta=1e-9)
        self.assertAlmostEqual(turned["normal_error"], found["normal_error"], delta=1e-4)
        self.assertEqual((turned["turned"], found["turned"]), (True, volume(CUBE_VERTICES, CUBE_FACES) < 0))
        self.assertIsNone(self.compared(vertices, faces[1:])["volume"])
        one_turned = self.compared(vertices, [faces[0][::-1], *faces[1:]])
        self.assertIsNone(one_turned["volume"])
        self.assertEqual(one_turned["folded"], found["folded"] + 1)

    def test_only_two_meshes_have_faces_to_compare(self):
        clean, faces = self.quads()
        write_off(self.path("b.off"), clean, faces)
        cloud = write_ply(self.path("cloud.ply"), clean)
        self.assertIsNone(self.report("compare", cloud, self.path("b.off"))["faces"])
        self.assertIsNone(self.report("compare", self.path("b.off"), cloud)["faces"])
        self.assertIsNone(self.compared(clean, faces, "--as", "cloud"))
        text = self.ok("compare", self.path("b.off"), self.path("b.off")).stdout.decode()
        self.assertIn("folded    0", text)
        self.assertNotIn("turned", text)

    def test_the_text_says_that_faces_are_turned_and_names_two_angles_apart(self):
        clean, faces = self.quads()
        write_off(self.path("b.off"), clean, faces)
        write_off(self.path("a.off"), clean, [face[::-1] for face in faces])
        lines = self.ok("compare", self.path("a.off"), self.path("b.off"), "--normals", 5).stdout.decode().splitlines()
        names = [line[:10].strip() for line in lines]
        self.assertEqual([names.count(name) for name in ("normals", "angle", "turned")], [1, 1, 1])
        self.assertIn("most faces of A look the other way than B's", lines[names.index("turned")])


class Text(Case):
    def test_text_holds_units_and_percent(self):
        write_ply(self.path("cloud.ply"), [(0.5, 0.5, 2.0)])
        write_off(self.path("cube.off"), CUBE_VERTICES, CUBE_FACES)
        text = self.ok("compare", self.path("cloud.ply"), self.path("cube.off")).stdout.decode()
        self.assertIn("mean      1 ", text)
        self.assertIn(f"{100 / math.sqrt(3):.4f} %", text)

    def test_nothing_to_measure(self):
        empty = write_ply(self.path("empty.ply"), [(float("nan"), 0.0, 0.0)])
        cloud = write_ply(self.path("cloud.ply"), [(0.5, 0.5, 2.0)])
        for words in ([empty, cloud], [cloud, empty]):
            self.fails(3, "compare", *words, says=["empty.ply: has no finite point", "choose another file"])
        self.fails(2, "compare", cloud, empty, "--report", cloud, says="--report")

    def test_options_say_what_a_text_does_not(self):
        rows = [(x / 7, x % 5, x / 11) for x in range(50)]
        for name, shift in (("a.data", 0), ("b.data", 0.5)):
            self.path(name).write_text("A;B;C\n" + "".join(f"{z + shift};{x};{y}\n" for x, y, z in rows))
        mesh = write_off(self.path("b.off"), rows, [(0, 1, 2)])
        words = ["--in-format", "csv", "--columns", "z,x,y", "--skip", "1"]
        self.fails(3, "compare", self.path("a.data"), self.path("b.data"), says="unknown format")
        both = self.report("compare", self.path("a.data"), self.path("b.data"), *words)
        self.assertEqual(both["points"], 50)
        self.assertGreater(both["mean"], 0.01)
        self.assertLess(self.report("compare", self.path("a.data"), mesh, "--as", "cloud", *words)["max"], 1e-5)
