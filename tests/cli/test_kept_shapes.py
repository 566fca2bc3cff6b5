# SPDX-License-Identifier: Apache-2.0
"""Clouds that are not like the usual scan keep their shape, and what is noise in them goes."""
import itertools
import json
import math
import os
import pathlib
import random
import unittest

from program import Case, positions, read_ply
from test_tiled import write_binary

WOOD = pathlib.Path(os.environ.get("POINTFAIR_DATA", "")) / "scans/terrain_utm.pcd"


def rms(values):
    values = list(values)
    return math.sqrt(sum(value * value for value in values) / len(values))


def unit(v):
    length = math.hypot(*v)
    return [x / length for x in v]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(point, middle, axis):
    return sum((p - m) * a for p, m, a in zip(point, middle, axis))


class KeptShapes(Case):
    def denoised(self, points, *flags):
        write_binary(self.path("in.ply"), points, "double")
        self.ok("run", self.path("in.ply"), self.path("out.ply"), "-q", "--force", *flags)
        return positions(self.path("out.ply"))

    def test_tubes_as_thick_as_their_points_are_apart_are_no_noise(self):
        rng = random.Random(1)
        points = []
        for _ in range(20000):
            turn, radius = rng.uniform(0, 2 * math.pi), 1 + rng.gauss(0, .05)
            points.append((10 * rng.randrange(8) + radius * math.cos(turn), radius * math.sin(turn), rng.uniform(0, 400)))
        off = lambda p: math.hypot(p[0] - 10 * round(p[0] / 10), p[1]) - 1
        self.assertLess(rms(map(off, self.denoised(points))), 1.02 * rms(map(off, points)))

    def test_tubes_whose_nearest_points_lie_in_lines_or_sheets_are_no_noise(self):
        rng, count = random.Random(2), 20000
        for spacing in (1, 1.39):  # radii of the tubes: three or four points around
            long = count * spacing ** 2 / (2 * math.pi * 50)
            room = max(long, 60)
            tubes = [([rng.uniform(-room / 2, room / 2) for _ in range(3)], *self.axes(rng)) for _ in range(50)]
            places = [rng.choice(tubes) for _ in range(count)]
            points = []
            for middle, along, side, up in places:
                at, turn, radius = rng.uniform(-long / 2, long / 2), rng.uniform(0, 2 * math.pi), 1 + rng.gauss(0, .03)
                points.append(tuple(m + at * d + radius * (math.cos(turn) * u + math.sin(turn) * v)
                                    for m, d, u, v in zip(middle, along, side, up)))

            def off(rows):
                return rms(math.hypot(dot(row, middle, side), dot(row, middle, up)) - 1
                           for row, (middle, _, side, up) in zip(rows, places))

            self.assertLess(off(self.denoised(points)), 1.02 * off(points), spacing)

    def test_cubes_a_few_spacings_wide_keep_their_edges(self):
        rng, width = random.Random(1), 3.5
        frames = [([2.5 * width * k for k in place], *self.axes(rng)) for place in itertools.product(range(5), repeat=3)]
        places = [frame for frame in frames for _ in range(int(6 * width * width))]
        points = []
        for middle, *axes in places:
            inside = [rng.uniform(-width / 2, width / 2) for _ in range(3)]
            inside[rng.randrange(3)] = rng.choice((-width / 2, width / 2))
            inside = [at + rng.gauss(0, .05) for at in inside]
            points.append(tuple(m + sum(at * axis[k] for at, axis in zip(inside, axes)) for k, m in enumerate(middle)))

        def off(rows):
            beyond = [[abs(dot(row, middle, axis)) - width / 2 for axis in axes] for row, (middle, *axes) in zip(rows, places)]
            return rms(math.hypot(*(max(b, 0) for b in its)) or max(its) for its in beyond)

        self.assertLess(off(self.denoised(points)), 1.15 * off(points))

    @staticmethod
    def axes(rng):
        """Three unit vectors at right angles."""
        along = unit([rng.gauss(0, 1) for _ in range(3)])
        across = unit(cross(along, [rng.gauss(0, 1) for _ in range(3)]))
        return along, across, cross(along, across)

    def test_noise_of_a_part_goes_beside_what_has_hardly_any(self):
        rng = random.Random(2)
        places = [(rng.uniform(0, 140), rng.uniform(0, 140)) for _ in range(20000)]
        points = [(x, y, rng.gauss(0, .3 if x > 100 else .01)) for x, y in places]
        out = self.denoised(points)
        for loud, most in ((True, .4), (False, 1)):
            its = [i for i, (x, _) in enumerate(places) if (x > 100) == loud]
            self.assertLess(rms(out[i][2] for i in its), most * rms(points[i][2] for i in its))

    def test_noise_of_several_spacings_goes_from_a_plane(self):
        rng, points = random.Random(5), []
        for _ in range(20000):  # a disc, a point for each square of side 1
            out, turn = 80 * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
            points.append((out * math.cos(turn), out * math.sin(turn), rng.gauss(0, 2)))
        self.assertLess(rms(z for _, _, z in self.denoised(points)), .09 * 2)

    def test_sparse_ground_beside_a_dense_patch_is_ground(self):
        rng = random.Random(3)
        patch = [(rng.uniform(0, 110), rng.uniform(0, 110), 1) for _ in range(12000)]
        around = [(rng.uniform(120, 2950), rng.uniform(0, 2830), 32) for _ in range(8000)]
        height = lambda x, y: 35 * math.sin(x * .009) * math.cos(y * .009)
        points = [(x, y, height(x, y) + rng.gauss(0, .2 * spacing)) for x, y, spacing in patch + around]
        out = self.denoised(points, "--outliers", "mark")
        marked = sum(row["outlier"] > 0 for row in read_ply(self.path("out.ply"))[12000:])
        self.assertLess(marked, .05 * len(around))
        off = lambda rows: rms(z - height(x, y) for x, y, z in rows[12000:])
        self.assertLess(off(out), .5 * off(points))

    def test_panes_of_glass_leave_the_noise_of_the_facade(self):
        rng = random.Random(4)
        facade = [(rng.uniform(0, 125), rng.gauss(0, .3), rng.uniform(0, 125)) for _ in range(15600)]
        panes = [(rng.uniform(130, 177), 2 * rng.randrange(2) + rng.gauss(0, .03), rng.uniform(0, 47)) for _ in range(4400)]
        out = self.denoised(facade + panes)
        self.assertLess(rms(y for _, y, _ in out[:15600]), .2 * rms(y for _, y, _ in facade))
        off = lambda rows: rms(min(abs(y), abs(y - 2)) for _, y, _ in rows)
        self.assertLess(off(out[15600:]), off(panes))

    def test_terrain_of_few_points_whose_surface_does_not_show_stays_where_it_is(self):
        for seed in (9, 26, 38):
            rng = random.Random(seed)
            waves = []
            for _ in range(60):
                length, turn = 6 * 10 ** rng.random(), rng.uniform(0, 2 * math.pi)
                waves.append((2 * math.pi / length * math.cos(turn), 2 * math.pi / length * math.sin(turn),
                              rng.uniform(0, 2 * math.pi), .02 * length))
            height = lambda x, y: sum(high * math.sin(u * x + v * y + phase) for u, v, phase, high in waves)
            places = [(rng.uniform(0, 100), rng.uniform(0, 100)) for _ in range(1200)]
            off = rms(z - height(x, y) for x, y, z in self.denoised([(x, y, height(x, y) + rng.gauss(0, .03)) for x, y in places]))
            self.assertLess(off, .1 * math.sqrt(100 * 100 / 1200), seed)  # spacings

    def test_small_frames_with_steps_of_depth_become_planes(self):
        for side, slope, steps, cell, most in ((60, .006, 400, .004, .55), (50, .006, 300, .0048, .4)):
            points = []
            for column, row in itertools.product(range(side), repeat=2):
                z = steps / round(steps / (1 + slope * column))
                points.append(((column - side / 2) * cell * z, (row - side / 2) * cell * z, z))

            def off(p):
                ray = side / 2 + p[0] / (cell * p[2])
                columns = (ray + step / 32 for step in range(-64, 65))
                return min(math.hypot(p[0] - (c - side / 2) * cell * (1 + slope * c), p[2] - (1 + slope * c)) for c in columns)

            before, after = rms(map(off, points)), rms(map(off, self.denoised(points)))
            self.assertLess(after, most * before, (side, slope, steps))

    @unittest.skipUnless(WOOD.exists(), "no such scan")
    def test_a_wood_from_the_air_is_no_frame_of_a_camera(self):
        """Its crowns are the rougher the sparser they are, as a camera's noise is."""
        self.ok("run", WOOD, self.path("out.pcd"), "-q", "--report", self.path("out.json"))
        report = json.loads(pathlib.Path(self.path("out.json")).read_text())
        self.assertLess(report["noise"]["before"], .5 * report["spacing"])
