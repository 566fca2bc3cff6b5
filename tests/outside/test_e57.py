#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""E57 files as libE57Format, inside pye57, reads them: it checks every page, and must find all as it was but the
coordinates. On files that it writes here, and on the public ones in POINTFAIR_DATA/e57, where that is set."""
import os
import pathlib
import struct
import unittest

import packages
from packages import pointfair

np, pye57 = packages.use(["pye57==0.4.19", "numpy"], ["numpy", "pye57"])
COORDINATES = ("cartesianX", "cartesianY", "cartesianZ", "sphericalRange", "sphericalAzimuth", "sphericalElevation")


def logical(path):
    data = path.read_bytes()
    return b"".join(data[at:at + 1020] for at in range(0, len(data), 1024))


def section_of_images(path):
    """Everything between the last scan's points and the XML section: images and what else there is."""
    data = path.read_bytes()
    xml_begin = struct.unpack_from("<Q", data, 24)[0]
    begin = xml_begin // 1024 * 1020 + xml_begin % 1024
    return logical(path)[:begin]


def sphere(count, noise, seed=1):
    random = np.random.default_rng(seed)
    points = random.normal(size=(count, 3))
    points *= (1 + random.normal(0, noise, count) / 1)[:, None] / np.linalg.norm(points, axis=1)[:, None]
    return points


class E57(packages.InFolder):
    def scans(self, path):
        file = pye57.E57(str(path))
        return [file.read_scan_raw(i, ignore_unsupported_fields=True) for i in range(file.scan_count)], file

    def check_file(self, path, moves=True):
        out = self.folder / "out.e57"
        pointfair("run", path, out, "--strength", "0", "-q", "--force")
        self.assertEqual(path.read_bytes(), out.read_bytes(), "strength 0 changes the file")
        pointfair("run", path, out, "-q", "--force")
        (before, old), (after, new) = self.scans(path), self.scans(out)
        self.assertEqual(len(before), len(after))
        moved = 0.0
        for a, b in zip(before, after):
            self.assertEqual(a.keys(), b.keys())
            for name in a:
                if name in COORDINATES:
                    moved = max(moved, np.abs(a[name] - b[name]).max(initial=0))
                else:
                    self.assertEqual(a[name].tobytes(), b[name].tobytes(), name)
        if moves:
            self.assertGreater(moved, 0)
        return before, after, (old, new)

    def test_a_scan_of_pye57(self):
        points = sphere(3000, 0.01)
        path = self.folder / "in.e57"
        file = pye57.E57(str(path), mode="w")
        file.write_scan_raw({"cartesianX": points[:, 0], "cartesianY": points[:, 1], "cartesianZ": points[:, 2],
                             "intensity": np.linspace(0, 1, len(points), dtype="f4"),
                             "rowIndex": np.arange(len(points), dtype="u2") % 100},
                            rotation=np.array([0.5, 0.5, 0.5, 0.5]), translation=np.array([100.0, 200.0, 300.0]))
        file.close()
        before, after, _ = self.check_file(path)
        radius = [np.linalg.norm(np.array([scan["cartesian" + axis] for axis in "XYZ"]), axis=0) for scan in (before[0], after[0])]
        self.assertLess(np.std(radius[1]), 0.7 * np.std(radius[0]))  # the pose is taken back: the sphere is where it was

    def test_scans_denoise_each_other(self):
        """Two poor scans of one sphere, whose poses bring them together, become better than either alone."""
        points = sphere(1500, 0.01)
        whole, halves = self.folder / "whole.e57", self.folder / "half.e57"
        for path, parts in ((whole, (points[::2], points[1::2])), (halves, (points[::2],))):
            file = pye57.E57(str(path), mode="w")
            for n, part in enumerate(parts):
                shift = np.array([5.0 * n, 0, 0])
                local = part - shift
                file.write_scan_raw({"cartesian" + axis: local[:, i] for i, axis in enumerate("XYZ")},
                                    rotation=np.array([1.0, 0, 0, 0]), translation=shift)
            file.close()
        both, one = self.check_file(whole)[1], self.check_file(halves)[1]
        error = lambda scan: np.std(np.linalg.norm(np.array([scan["cartesian" + axis] for axis in "XYZ"]), axis=0))
        self.assertLess(error(both[0]), error(one[0]))

    def test_public_files(self):
        folder = pathlib.Path(os.environ.get("POINTFAIR_DATA", "/nowhere")) / "e57"
        if not folder.is_dir():
            self.skipTest("POINTFAIR_DATA names no folder with e57 in it")
        for path in sorted(folder.glob("*.e57")):
            with self.subTest(file=path.name):
                large = path.stat().st_size > 10000
                self.check_file(path, moves=large)
                if large:  # the images lie behind the points
                    a, b = section_of_images(path), section_of_images(self.folder / "out.e57")
                    self.assertEqual(len(a), len(b))
                    self.assertEqual(a[2593604 // 1024 * 1020:], b[2593604 // 1024 * 1020:])


if __name__ == "__main__":
    unittest.main()
