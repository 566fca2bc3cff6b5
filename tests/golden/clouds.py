# SPDX-License-Identifier: Apache-2.0
"""Small clouds that are the same bytes on every machine: integers, + - * / and sqrt, which IEEE 754 rounds in one way.
CLOUDS, MESHES: {file name: function that returns the file's bytes}."""
import math
import struct

NAN, INFINITE = float("nan"), float("inf")


class Random:
    """SplitMix64 (Steele and others 2014)."""

    def __init__(self, seed):
        self.state = seed * 0x9E3779B97F4A7C15

    def bits(self):
        self.state = (self.state + 0x9E3779B97F4A7C15) & (1 << 64) - 1
        z = self.state
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & (1 << 64) - 1
        z = (z ^ z >> 27) * 0x94D049BB133111EB & (1 << 64) - 1
        return z ^ z >> 31

    def __call__(self, low=-1.0, high=1.0):
        return low + (high - low) * ((self.bits() >> 40) * 2.0**-24)

    def bell(self):
        """Of standard deviation 1, nearly normal."""
        return sum(self(-0.5, 0.5) for _ in range(12))

    def direction(self):
        while True:
            p = [self(), self(), self()]
            length = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
            if 0.1 < length <= 1:
                return [c / length for c in p]


def noisy(points, normals, sigma, random):
    return [[c + sigma * random_height * n for c, n in zip(p, normal)]
            for p, normal in zip(points, normals) for random_height in [random.bell()]]


def sphere(n=1200, sigma=0.01, seed=1, radius=1.0):
    random = Random(seed)
    ways = [random.direction() for _ in range(n)]
    return noisy([[radius * c for c in way] for way in ways], ways, sigma * radius, random)


def height_field(height, n=1200, sigma=0.01, seed=2, width=1.0):
    random = Random(seed)
    places = [(random(-width, width), random(-width, width)) for _ in range(n)]
    return [[x, y, height(x, y) + sigma * random.bell()] for x, y in places]


def plane(**how):
    return height_field(lambda x, y: 0.25 * x - 0.125 * y, **how)


def wave(t):
    """A sine's likeness from parabolas, of period 1."""
    t -= math.floor(t)
    return 16 * t * (0.5 - t) if t < 0.5 else -16 * (t - 0.5) * (1 - t)


def waves(**how):
    return height_field(lambda x, y: 0.1 * wave(x) * wave(0.75 * y), **how)


def saddle(**how):
    return height_field(lambda x, y: 0.5 * x * y, **how)


def roof(**how):
    return height_field(lambda x, y: -abs(x), **how)


def stairs(**how):
    return height_field(lambda x, y: 0.25 * math.floor(3 * x), **how)


def cube(n=1500, sigma=0.01, seed=3):
    random = Random(seed)
    points, normals = [], []
    for i in range(n):
        axis, side = i % 3, 1.0 if i % 2 else -1.0
        p = [random(), random(), random()]
        p[axis] = side
        points.append(p)
        normals.append([side * (a == axis) for a in range(3)])
    return noisy(points, normals, sigma, random)


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def cubes(side=4, width=3.5, sigma=0.05, seed=26):
    """So many cubes along each axis, each turned its own way: a few spacings wide, so that shape is everywhere."""
    random = Random(seed)
    points = []
    for k in range(side ** 3):
        along = random.direction()
        across = cross(along, random.direction())
        length = math.sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2])
        across = [c / length for c in across]
        axes = [along, across, cross(along, across)]
        middle = [2.5 * width * at for at in (k % side, k // side % side, k // (side * side))]
        for i in range(int(6 * width * width)):
            inside = [random(-width / 2, width / 2) for _ in range(3)]
            inside[i % 3] = width / 2 if i % 2 else -width / 2
            inside = [at + sigma * random.bell() for at in inside]
            points.append([middle[a] + (inside[0] * axes[0][a] + inside[1] * axes[1][a] + inside[2] * axes[2][a])
                           for a in range(3)])
    return points


def torus(n=1500, sigma=0.01, seed=4):
    random = Random(seed)
    points, normals = [], []
    for _ in range(n):
        way = random.direction()
        flat = math.sqrt(way[0] * way[0] + way[1] * way[1])
        around = [way[0] / flat, way[1] / flat, 0.0]
        out = random.direction()
        tall = math.sqrt(out[0] * out[0] + out[2] * out[2])
        normal = [around[0] * out[0] / tall, around[1] * out[0] / tall, out[2] / tall]
        points.append([around[a] + 0.375 * normal[a] for a in range(3)])
        normals.append(normal)
    return noisy(points, normals, sigma, random)


def plate(n=1600, sigma=0.004, seed=5):
    """Two sheets close together."""
    random = Random(seed)
    return [[random(), random(), (0.03 if i % 2 else 0.0) + sigma * random.bell()] for i in range(n)]


def with_outliers(points, every=40, seed=6):
    random = Random(seed)
    return [[c + random(-0.4, 0.4) for c in p] if i % every == 0 else p for i, p in enumerate(points)]


def uneven(n=1600, seed=7):
    """A hundred times as dense in the middle as outside."""
    random = Random(seed)
    points = []
    for _ in range(n):
        x, y = random(), random()
        points.append([x * x * x, y * y * y, 0.1 * wave(x * x * x) + 0.002 * random.bell()])
    return points


def rising_noise(n=2000, seed=8):
    random = Random(seed)
    points = []
    for _ in range(n):
        x, y = random(), random()
        points.append([x, y, (0.002 + 0.01 * (x + 1)) * random.bell()])
    return points


def sweep(beams=16, steps=120, sigma=0.005, seed=9):
    """Rows of a lidar over ground and a wall, far apart; the sensor is the origin."""
    random = Random(seed)
    points = []
    for beam in range(beams):
        slope = -0.4 + 0.05 * beam
        for step in range(steps):
            t = 2 * (step + 0.5) / steps - 1
            way = [1.0, t, slope]
            length = math.sqrt(1 + t * t + slope * slope)
            reach = min(4.0, -1.5 / slope if slope < -0.05 else 4.0) + sigma * random.bell()
            points.append([reach * c / length * length for c in way])
    return points


def profiles(rows=30, steps=60, sigma=0.002, seed=10):
    random = Random(seed)
    return [[0.2 * row, 0.01 * step, 0.1 * wave(0.05 * row + 0.01 * step) + sigma * random.bell()]
            for row in range(rows) for step in range(steps)]


def depth_image(width=48, height=36, seed=11):
    """An organised frame of a depth camera with whole disparities and holes."""
    random = Random(seed)
    points = []
    for v in range(height):
        for u in range(width):
            depth = 1.5 + 0.5 * wave(u / 64) + 0.02 * v / height + 0.01 * random.bell()
            disparity = math.floor(600 / depth)
            z = 600 / disparity
            hole = random.bits() % 50 == 0
            points.append([NAN] * 3 if hole else [(u - width / 2) / 60 * z, (v - height / 2) / 60 * z, z])
    return points


def stepped_frame(side=60, slope=0.006, steps=400):
    """The frame of a camera that measures whole disparities: a wall that recedes."""
    points = []
    for v in range(side):
        for u in range(side):
            z = steps / math.floor(steps / (1 + slope * u) + 0.5)
            points.append([0.004 * (u - side / 2) * z, 0.004 * (v - side / 2) * z, z])
    return points


def matched_frame(width=120, height=96, tile=24, seed=24):
    """The frame of a camera that matches images: twenty slanted tiles at 1 to 3 m, noise of disparities shared in windows."""
    random, reach = Random(seed), 4
    noise = [[random.bell() for _ in range(width + 2 * reach)] for _ in range(height + 2 * reach)]
    weights = [1 + reach - abs(i - reach) for i in range(2 * reach + 1)]
    across = [[sum(w * row[u + i] for i, w in enumerate(weights)) for u in range(width)] for row in noise]
    points = []
    for v in range(height):
        for u in range(width):
            shared = sum(w * across[v + i][u] for i, w in enumerate(weights)) / 85
            x, y = (u + 0.5 - width / 2) / width, (v + 0.5 - height / 2) / width
            number = v // tile * (width // tile) + u // tile
            depth = (1 + 2 * (7 * number % 20) / 19) / (1 - 0.4 * x)
            z = 9 / (9 / depth + 0.06 * shared + 0.012 * random.bell())
            points.append([x * z, y * z, z])
    return points


def two_walls(width=60, height=50, sigma=0.001, seed=12):
    """The image of a camera at the origin; a pixel in each row lies between the walls."""
    random = Random(seed)
    points = []
    for row in range(height):
        for column in range(width):
            depth = 1.0 if 2 * column < width else 1.2 + 0.6 * abs(random()) if 2 * column == width else 2.0
            depth += sigma * random.bell()
            points.append([0.01 * (column - width / 2) * depth, 0.01 * (row - height / 2) * depth, depth])
    return points


def windows(n=8000, window=8, seed=13):
    """A plane whose noise is the mean over windows of eight cells, four spacings, as of a camera that matches them."""
    random, cells = Random(seed), int(2 * math.sqrt(n))
    white = [[random.bell() for _ in range(cells + window)] for _ in range(cells + window)]
    points = []
    for _ in range(n):
        x, y = random(0, cells), random(0, cells)
        mean = sum(sum(row[int(x):int(x) + window]) for row in white[int(y):int(y) + window]) / window
        points.append([x, y, mean + 0.25 * random.bell()])
    return points


def grid(n=30, step=1.0):
    return [[step * i, step * j, 0.0] for i in range(n) for j in range(n)]


def rounded(points, step):
    return [[math.floor(c / step + 0.5) * step for c in p] for p in points]


def moved(points, by):
    return [[c + b for c, b in zip(p, by)] for p in points]


def scaled(points, by):
    return [[c * by for c in p] for p in points]


def ply(points, kind="f", extra=(), faces=()):
    """Binary PLY; kind: f or d; `extra`: (name, values) of further float columns; `faces`: tuples of corners."""
    name = {"f": "float", "d": "double"}[kind]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [f"property {name} {axis}" for axis in "xyz"] + [f"property float {other}" for other, _ in extra]
    rows = b"".join(struct.pack("<3" + kind, *p) + struct.pack(f"<{len(extra)}f", *(values[i] for _, values in extra))
                    for i, p in enumerate(points))
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"] if faces else []
    rows += b"".join(struct.pack(f"<B{len(face)}i", len(face), *face) for face in faces)
    return "\n".join(header + ["end_header", ""]).encode() + rows


def organised(points, width, viewpoint="0 0 0 1 0 0 0"):
    header = f"""# .PCD v0.7
VERSION 0.7
FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH {width}
HEIGHT {len(points) // width}
VIEWPOINT {viewpoint}
POINTS {len(points)}
DATA binary
"""
    return header.encode() + b"".join(struct.pack("<3f", *p) for p in points)


def xyz(points):
    return "".join(f"{' '.join(repr(c) for c in p)}\n" for p in points).encode()


def with_holes(points):
    return [[NAN, p[1], p[2]] if i % 97 == 0 else [p[0], INFINITE, p[2]] if i % 101 == 0 else p
            for i, p in enumerate(points)]


CLOUDS = {
    "sphere.ply": lambda: ply(sphere()),
    "sphere_clean.ply": lambda: ply(sphere(sigma=0)),
    "sphere_loud.ply": lambda: ply(sphere(sigma=0.06)),
    "sphere_large.ply": lambda: ply(sphere(n=9000, sigma=0.004)),
    "plane.ply": lambda: ply(plane()),
    "waves.ply": lambda: ply(waves()),
    "waves_large.ply": lambda: ply(waves(n=6000, sigma=0.004)),
    "waves_dense.ply": lambda: ply(waves(n=8000, sigma=0.05)),  # two spacings
    "saddle.xyz": lambda: xyz(saddle()),
    "roof.ply": lambda: ply(roof()),
    "stairs.ply": lambda: ply(stairs(n=3000)),
    "cube.ply": lambda: ply(cube()),
    "cubes.ply": lambda: ply(cubes()),
    "torus.ply": lambda: ply(torus()),
    "plate.ply": lambda: ply(plate()),
    "outliers.ply": lambda: ply(with_outliers(sphere())),
    "uneven.ply": lambda: ply(uneven()),
    # around one origin the second has a float step of .03125 in x
    "far_apart.ply": lambda: ply(waves(n=1500) + moved(waves(n=1500, seed=27), (3e5, 1e5, 0))),
    "rising_noise.ply": lambda: ply(rising_noise()),
    "rising_noise_large.ply": lambda: ply(rising_noise(n=8000)),
    "sweep.pcd": lambda: organised(sweep(), 120),
    "profiles.ply": lambda: ply(profiles()),
    "depth_image.pcd": lambda: organised(depth_image(), 48),
    "stepped_frame.ply": lambda: ply(stepped_frame()),
    "matched_frame.ply": lambda: ply(matched_frame()),
    "two_walls.ply": lambda: ply(two_walls()),
    "windows.ply": lambda: ply(windows()),
    "grid.ply": lambda: ply(grid()),
    "rounded.ply": lambda: ply(rounded(sphere(n=2000), 0.01)),
    "rounded.xyz": lambda: xyz([[float(f"{c:.3f}") for c in p] for p in waves(n=2000, sigma=0.005)]),
    "repeated.ply": lambda: ply(sphere(n=500) * 3),
    "repeated_rounded.ply": lambda: ply((lambda s: s + rounded(s, 0.001))(sphere(n=900))),
    "unwelded.ply": lambda: ply([p for p in waves(n=400) for _ in range(6)]),
    "far_off.ply": lambda: ply(moved(sphere(n=1500, sigma=0.02), [431234.5, 5412345.25, 312.125]), "d"),
    "far_off_float.ply": lambda: ply(moved(sphere(n=1500, sigma=0.02), [4096.0, 2048.0, 512.0])),
    "stray.ply": lambda: ply(sphere(n=1000) + [[1e6, -1e6, 3e5]]),
    "tiny.ply": lambda: ply(scaled(sphere(n=800), 2.0**-90)),
    "huge.ply": lambda: ply(scaled(sphere(n=800), 2.0**30)),
    "two_scales.ply": lambda: ply(sphere(n=800) + moved(scaled(sphere(n=800, seed=12), 1000.0), [5000.0, 0.0, 0.0])),
    "holes.ply": lambda: ply(with_holes(waves(n=1000))),
    "one.ply": lambda: ply([[1.0, 2.0, 3.0]]),
    "two.ply": lambda: ply([[1.0, 2.0, 3.0], [1.5, 2.0, 3.0]]),
    "nine.ply": lambda: ply(sphere(n=9)),
    "line.ply": lambda: ply([[0.1 * i, 0.0, 0.0] for i in range(300)]),
    "one_place.ply": lambda: ply([[1.0, 2.0, 3.0]] * 300),
    "nowhere.ply": lambda: ply([[NAN] * 3] * 20),
    "empty.ply": lambda: ply([]),
    "attributes.ply": lambda: ply(waves(n=900), extra=[("intensity", [i * 0.5 for i in range(900)])]),
}


def sheet_faces(n):
    """Of n x n vertices, row after row: now a quad, now two triangles."""
    corners = [(i * n + j, i * n + n + j, i * n + n + j + 1, i * n + j + 1) for i in range(n - 1) for j in range(n - 1)]
    return [face for at, (a, b, c, d) in enumerate(corners) for face in ([(a, b, c, d)] if at % 3 else [(a, b, c), (a, c, d)])]


def mesh_waves(n=32, sigma=0.3, seed=20):
    """An open sheet of quads and triangles, with noise in spacings on each axis."""
    random = Random(seed)
    step = 2.0 / n
    places = [(step * i - 1, step * j - 1) for i in range(n) for j in range(n)]
    points = [[x + sigma * step * random.bell(), y + sigma * step * random.bell(),
               0.1 * wave(x) * wave(0.75 * y) + sigma * step * random.bell()] for x, y in places]
    return points, sheet_faces(n)


def cube_quads(n):
    """The surface of a cube of side n: vertices at whole numbers, and n x n quads a side as (corners, whether they run
    round outwards)."""
    number, quads = {}, []
    for axis in range(3):
        for side in (0, n):
            def vertex(u, v):
                p = [0, 0, 0]
                p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = side, u, v
                return number.setdefault(tuple(p), len(number))
            quads += [((vertex(u, v), vertex(u + 1, v), vertex(u + 1, v + 1), vertex(u, v + 1)), side > 0)
                      for u in range(n) for v in range(n)]
    return list(number), quads


def mesh_cube(n=12, sigma=0.2, seed=21):
    """A closed cube of triangles."""
    random = Random(seed)
    vertices, quads = cube_quads(n)
    faces = [face for (a, b, c, d), outwards in quads for face in ([(a, b, c), (a, c, d)] if outwards else [(a, c, b), (a, d, c)])]
    return [[(c + sigma * random.bell()) / n for c in p] for p in vertices], faces


def unwelded(points, faces):
    """Each face with corners of its own."""
    corners = [corner for face in faces for corner in face]
    numbers = iter(range(len(corners)))
    return [points[corner] for corner in corners], [tuple(next(numbers) for _ in face) for face in faces]


def as_ply(points, faces):
    return ply(points, faces=faces)


MESHES = {
    "mesh_waves.ply": lambda: as_ply(*mesh_waves()),
    "mesh_cube.ply": lambda: as_ply(*mesh_cube()),
    "mesh_folded.ply": lambda: as_ply(*mesh_waves(n=24, sigma=0.6, seed=22)),
    "mesh_seams.ply": lambda: as_ply(*unwelded(*mesh_cube(n=8, seed=23))),
}
