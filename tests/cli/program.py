# SPDX-License-Identifier: Apache-2.0
"""Runs the program under test and reads and writes the small files that the tests need."""
import json
import math
import os
import random
import signal
import struct
import subprocess
import tempfile
import unittest
from pathlib import Path

BIN = os.environ["POINTFAIR_BIN"]
SANITIZED = any(name in Path(BIN).read_bytes() for name in (b"__asan_init", b"__tsan_init"))
TIMEOUT = 120

STRUCT_CODES = {
    "char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H", "uint16": "H",
    "int": "i", "int32": "i", "uint": "I", "uint32": "I", "float": "f", "float32": "f", "double": "d", "float64": "d",
}


def run(*words, **options):
    """Runs pointfair with the words; standard output and error are bytes."""
    return subprocess.run([BIN, *map(str, words)], capture_output=True, timeout=TIMEOUT, **options)


class Case(unittest.TestCase):
    """A test with a folder of its own, in which nothing may be left that the test did not expect."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def path(self, name):
        return self.folder / name

    def files(self):
        return sorted(entry.name for entry in self.folder.iterdir())

    def ok(self, *words, **options):
        result = run(*words, **options)
        self.assertEqual(result.returncode, 0, result.stderr.decode())
        return result

    def report(self, *words, **options):
        """The JSON object that --report - prints."""
        return json.loads(self.ok(*words, "--report", "-", **options).stdout)

    def fails(self, code, *words, says=(), **options):
        """Ends with the code, one line on standard error that holds each of `says`, nothing else, no file left."""
        before = self.files()
        result = run(*words, **options)
        text = result.stderr.decode()
        self.assertEqual(result.returncode, code, text)
        self.assert_one_line(text)
        self.assertEqual(result.stdout, b"")
        for part in [says] if isinstance(says, str) else says:
            self.assertIn(part, text)
        self.assertEqual(self.files(), before)
        return text

    def assert_one_line(self, text):
        self.assertTrue(text.startswith("pointfair: "), text)
        self.assertTrue(text.endswith("\n"), text)
        self.assertEqual(text.count("\n"), 1, text)


def write_ply(path, points, faces=(), scalar="float", extra=()):
    """An ascii PLY; `extra` holds (type, name, values) of further properties."""
    lines = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    lines += [f"property {scalar} {axis}" for axis in "xyz"]
    lines += [f"property {kind} {name}" for kind, name, _ in extra]
    if faces:
        lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    lines.append("end_header")
    for i, point in enumerate(points):
        lines.append(" ".join([repr(c) for c in point] + [repr(values[i]) for _, _, values in extra]))
    lines += [" ".join(map(str, (len(face), *face))) for face in faces]
    Path(path).write_text("\n".join(lines) + "\n")
    return path


def read_ply(path):
    """The vertices of a PLY file whose vertex element has scalars only: a list of dictionaries by property."""
    data = Path(path).read_bytes()
    header, body = data.split(b"end_header\n", 1)
    names, types, count, encoding, in_vertex = [], [], 0, "", False
    for line in header.decode().splitlines():
        words = line.split()
        if words[0] == "format":
            encoding = words[1]
        elif words[0] == "element":
            in_vertex = words[1] == "vertex"
            count = int(words[2]) if in_vertex else count
        elif words[0] == "property" and in_vertex:
            types.append(words[1])
            names.append(words[2])
    if encoding == "ascii":
        rows = [line.split() for line in body.decode().splitlines()[:count]]
        return [{n: float(v) for n, v in zip(names, row)} for row in rows]
    order = "<" if encoding == "binary_little_endian" else ">"
    record = struct.Struct(order + "".join(STRUCT_CODES[t] for t in types))
    return [dict(zip(names, record.unpack_from(body, i * record.size))) for i in range(count)]


def positions(path):
    return [(p["x"], p["y"], p["z"]) for p in read_ply(path)]


def payload(path):
    """The bytes of a PLY file after its header."""
    return Path(path).read_bytes().split(b"end_header\n", 1)[1]


CUBE_VERTICES = [(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]
CUBE_FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
              (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]


def write_off(path, vertices, faces):
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0"]
    lines += [" ".join(repr(c) for c in v) for v in vertices]
    lines += [" ".join(map(str, (len(f), *f))) for f in faces]
    Path(path).write_text("\n".join(lines) + "\n")
    return path


def sphere_points(count, noise, seed=1, centre=(0.0, 0.0, 0.0)):
    """Points near the unit sphere, the radius off by a Gaussian of width `noise`."""
    generator = random.Random(seed)
    points = []
    for _ in range(count):
        v = [generator.gauss(0, 1) for _ in range(3)]
        scale = (1 + generator.gauss(0, noise)) / math.sqrt(sum(c * c for c in v))
        points.append(tuple(c * scale + o for c, o in zip(v, centre)))
    return points


def radius_error(points, centre=(0.0, 0.0, 0.0)):
    """Root mean square of the distances to the unit sphere."""
    return math.sqrt(sum((math.dist(p, centre) - 1) ** 2 for p in points) / len(points))


def default_signals():
    """For preexec_fn: a shell may have told its background jobs to ignore SIGINT, and nohup SIGHUP."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
