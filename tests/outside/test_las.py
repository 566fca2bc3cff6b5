#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""LAS and LAZ files as two decoders that are not ours read them, lazrs and LASzip: strength 0 gives the same file, and a
run changes nothing but the coordinates of points that moved and the bounds. On files of every point format, made here,
and on the public ones in POINTFAIR_DATA/las, where that is set."""
import os
import pathlib
import struct
import subprocess
import sys
import unittest

import packages
from packages import pointfair

BIN = os.environ["POINTFAIR_BIN"]
np, laspy, lazrs, laszip = packages.use(["laspy==2.7.0", "lazrs==0.8.2", "laszip==0.3.0", "numpy"],
                                        ["numpy", "laspy", "lazrs", "laszip"])
BACKENDS = {"lazrs": laspy.LazBackend.Lazrs, "LASzip": laspy.LazBackend.Laszip}
WRITERS = {"lazrs": laspy.LazBackend.LazrsParallel, "LASzip": laspy.LazBackend.Laszip}
WAVES = (4, 5, 9, 10)  # of which lazrs 0.8.2 writes what neither decoder reads back as it was
POINTS = 3000


def records_of(path):
    """The records before and behind the points, byte for byte; LASzip's own and those of COPC left out."""
    data = path.read_bytes()
    ours = lambda head: head[2:16] == b"laszip encoded" or head[2:6] == b"copc"
    at, records, end = struct.unpack_from("<H", data, 94)[0], [], struct.unpack_from("<I", data, 96)[0]
    for _ in range(struct.unpack_from("<I", data, 100)[0]):
        if at + 54 > end:
            break
        size = 54 + struct.unpack_from("<H", data, at + 20)[0]
        records.append(data[at:at + size])
        at += size
    if data[25] >= 4:
        at, count = struct.unpack_from("<QI", data, 235)
        for _ in range(count):
            size = 60 + struct.unpack_from("<Q", data, at + 20)[0]
            records.append(data[at:at + size])
            at += size
    return [record for record in records if not ours(record)]


def header_of(path):
    """The header without the bounds and without what follows from the sizes of other parts."""
    data = bytearray(path.read_bytes()[:375 if path.read_bytes()[25] >= 4 else 227])
    for at, size in ((96, 8), (179, 48), (227, 20)):
        data[at:at + size] = bytes(len(data[at:at + size]))
    return bytes(data)


def make(path, point_format, writer, seed=1):
    """A wavy ground with noise, random values in all other fields, extra bytes, records before and behind the points."""
    random = np.random.default_rng(seed)
    header = laspy.LasHeader(point_format=point_format, version="1.4" if point_format >= 6 else "1.3" if point_format > 3 else "1.2")
    header.scales, header.offsets = [0.001] * 3, [500000, 5400000, 100]
    header.add_extra_dims([laspy.ExtraBytesParams("height above", "float32"), laspy.ExtraBytesParams("tree", "3u1")])
    header.vlrs.append(laspy.VLR("someone", 7, "a record", bytes(range(256))))
    if point_format >= 6:
        header.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("someone", 8, "behind the points", bytes(100))])
    las = laspy.LasData(header)
    points = laspy.ScaleAwarePointRecord.zeros(POINTS, header=header)
    points.array = np.frombuffer(random.bytes(POINTS * header.point_format.size), points.array.dtype).copy()
    las.points = points
    x, y = random.uniform(0, 30, POINTS), random.uniform(0, 30, POINTS)
    las.x, las.y, las.z = 500000 + x, 5400000 + y, 100 + np.sin(x / 5) + random.normal(0, 0.02, POINTS)
    if point_format in (1, 3, 4, 5) or point_format >= 6:
        las.gps_time = np.cumsum(random.uniform(0, 1e-3, POINTS))
    las.write(str(path), laz_backend=writer)
    return path


def has_chunks(path):
    """Whether a file has the chunks without which lazrs reads none: LASzip before 2.0 compressed all points in one piece."""
    at = path.read_bytes().find(b"laszip encoded")
    return at < 0 or struct.unpack_from("<H", path.read_bytes(), at - 2 + 54)[0] != 1


def read(path, backend):
    if not has_chunks(path):
        backend = laspy.LazBackend.Laszip
    with laspy.open(str(path), laz_backend=backend) as file:
        return file.read()


class Las(packages.InFolder):
    def check_same_but_coordinates(self, before, after):
        for name, backend in BACKENDS.items():
            with self.subTest(decoder=name):
                old, new = read(before, backend), read(after, backend)
                self.assertEqual(old.header.point_count, new.header.point_count)
                for field in old.points.array.dtype.names:
                    if field not in "XYZ":
                        self.assertEqual(old.points.array[field].tobytes(), new.points.array[field].tobytes(), field)
                self.check_bounds(old, new)
        self.assertEqual(records_of(before), records_of(after))
        self.assertEqual(header_of(before)[:96] + header_of(before)[104:], header_of(after)[:96] + header_of(after)[104:])

    def check_bounds(self, old, new):
        """Those of the points. One that did not change keeps its bytes, unless points moved and there were points beyond."""
        bounds, beyond = [], False
        for axis in range(3):
            place = lambda las, value: value * las.header.scales[axis] + las.header.offsets[axis]
            for name, bound, sign in (("mins", np.min, -1), ("maxs", np.max, 1)):
                before, after = (bound((las.X, las.Y, las.Z)[axis]) for las in (old, new))
                own, found = getattr(old.header, name)[axis], getattr(new.header, name)[axis]
                beyond = beyond or sign * (place(old, before) - own) > 1e-6 * old.header.scales[axis]
                bounds.append((found, own, place(new, after), before == after))
        moved = any((old.points.array[axis] != new.points.array[axis]).any() for axis in "XYZ")
        for found, own, of_points, is_same in bounds:
            self.assertEqual(found, own if is_same and not (moved and beyond) else of_points)

    def check_rounding(self, before, after, exact):
        """X, Y, Z are the integers nearest to where the points went, of which `exact`, a PLY file, has the doubles."""
        new = read(after, laspy.LazBackend.Lazrs)
        data = exact.read_bytes().split(b"end_header\n", 1)
        types = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8"}
        fields = [line.split() for line in data[0].decode().splitlines() if line.startswith("property ")]
        table = np.frombuffer(data[1], np.dtype([(f"{i} {words[2]}", "<" + types[words[1]]) for i, words in enumerate(fields)]))
        for axis, grid in enumerate((new.X, new.Y, new.Z)):
            wanted = (table[f"{axis} {'xyz'[axis]}"] - new.header.offsets[axis]) / new.header.scales[axis]
            self.assertLessEqual(np.abs(grid - wanted).max(), 0.5 + 1e-4)

    def check_file(self, path, copc=False):
        out = self.folder / ("out" + path.suffix)
        pointfair("run", path, out, "--strength", "0", "-q", "--force")
        if not copc:
            self.assertEqual(path.read_bytes(), out.read_bytes(), "strength 0 changes the file")
        self.check_same_but_coordinates(path, out)
        if "degrees" in pointfair("info", path).stdout:  # distances mean nothing
            refused = subprocess.run([BIN, "run", path, out, "-q", "--force"], capture_output=True, text=True)
            self.assertEqual(refused.returncode, 3)
            self.assertIn("longitude and latitude", refused.stderr)
            return out
        pointfair("run", path, out, "-q", "--force")
        self.assertTrue(has_chunks(out))
        self.check_same_but_coordinates(path, out)
        exact = self.folder / "exact.ply"
        pointfair("run", path, exact, "-q", "--force")
        self.check_rounding(path, out, exact)
        return out

    def test_every_point_format_of_either_writer(self):
        for point_format in range(11):
            for name, writer in WRITERS.items():
                if name == "lazrs" and point_format in WAVES:
                    continue
                with self.subTest(point_format=point_format, writer=name):
                    laz = make(self.folder / "in.laz", point_format, writer)
                    las = make(self.folder / "in.las", point_format, None)
                    packed, plain = self.check_file(laz), self.check_file(las)
                    moved = read(packed, laspy.LazBackend.Laszip).points.array
                    self.assertEqual(moved.tobytes(), read(plain, None).points.array.tobytes())
                    self.assertNotEqual(moved.tobytes(), read(laz, laspy.LazBackend.Laszip).points.array.tobytes())

    def test_many_chunks(self):
        """More points than a chunk holds."""
        global POINTS
        POINTS, before = 120000, POINTS
        try:
            for point_format in (3, 7):
                self.check_file(make(self.folder / "in.laz", point_format, laspy.LazBackend.LazrsParallel))
        finally:
            POINTS = before

    def test_public_files(self):
        folder = pathlib.Path(os.environ.get("POINTFAIR_DATA", "/nowhere")) / "las"
        if not folder.is_dir():
            self.skipTest("POINTFAIR_DATA names no folder with las in it")
        refused = []
        for path in sorted(folder.glob("*.la[sz]")):
            with self.subTest(file=path.name):
                info = subprocess.run([BIN, "info", path], capture_output=True, text=True)
                if info.returncode == 0:
                    self.check_file(path, copc=".copc." in path.name)
                else:
                    self.assertEqual((info.returncode, info.stderr.count("\n")), (3, 1), info.stderr)
                    refused.append(path.name)
        self.assertEqual(refused, ["pdal_1.2-no-points.las", "pdal_garbage_nVariableLength.las"])

    def test_copc_is_read_and_written_as_plain_laz(self):
        path = pathlib.Path(os.environ.get("POINTFAIR_DATA", "/nowhere")) / "las/laspy_simple.copc.laz"
        if not path.is_file():
            self.skipTest("POINTFAIR_DATA names no folder with las/laspy_simple.copc.laz in it")
        out = self.folder / "out.laz"
        self.assertIn("note: the COPC index", pointfair("run", path, out).stderr)
        self.assertNotIn(b"copc", out.read_bytes()[:2000])


if __name__ == "__main__":
    unittest.main()
