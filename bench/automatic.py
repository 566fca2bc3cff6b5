#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures what the default run promises, beside the quality that bench/quality.py compares.

Parts: estimates (noise estimate over known noise), steady (clean clouds, a second run), low (noise below the spacing),
sheets (thin plates), outliers, scans (real ones, of $POINTFAIR_DATA/scans), cost (of the estimates). Shapes are those of
$POINTFAIR_DATA/punet_train; without it, only what the Armadillo and the fandisk of Debian's libcgal-demo show. Prints
Markdown; --write puts it between the marks <!-- quality PART --> and <!-- end --> of a page. A few minutes on one core.
"""
import argparse
import array
import json
import math
import os
import random
import statistics
import struct
import sys
from pathlib import Path

from quality import run
from quality_clouds import bounding_radius, cgal_meshes
from quality_tables import put, table

MESH_LEVELS = (0.1, 0.3, 0.5)  # % of the diagonal
DENSITIES = (("even", ()), ("50:1", ("--uneven", 50)))
ESTIMATED = (0.1, 0.25, 0.5, 1, 2)  # spacings
PLANES = (30, 60, 120)  # points of a plane
PLACES = 1000


class Bench:
    def __init__(self, options, folder):
        self.folder, self.meshes = folder, options.meshes or cgal_meshes(folder)
        self.pointfair = options.build / "bin" / "pointfair"
        data = os.environ.get("POINTFAIR_DATA")
        self.shapes = sorted((Path(data) / "punet_train").glob("*_mesh.ply")) if data else []
        self.scans = sorted((Path(data) / "scans").iterdir()) if data else []

    def path(self, name):
        return self.folder / name

    def report(self, *words):
        return json.loads(run([self.pointfair, *words, "--threads", 1, "--report", "-"]))

    def noisy(self, source, *flags):
        """A cloud made by `pointfair noise`, kept."""
        path = self.path("_".join([source.stem, *(str(flag).strip("-").replace(":", "_") for flag in flags)]) + ".ply")
        if not path.exists():
            run([self.pointfair, "noise", source, path, *flags, "--force", "-q", "--threads", 1])
        return path

    def fair(self, cloud, name, *flags):
        out = self.path(name)
        return out, self.report("run", cloud, out, "--force", "-q", "--device", "cpu", *flags)

    def left(self, cloud, mesh):
        """Mean distance and edge rms, % of the diagonal."""
        found = self.report("compare", cloud, mesh, "--edges", 40)
        return [100 * found[key] / found["diagonal"] for key in ("mean", "edge_rms")]


def read_points(path):
    """Of a binary PLY whose vertices begin with three floats, and the bytes of each vertex."""
    header, _, body = path.read_bytes().partition(b"end_header\n")
    lines = [line.split() for line in header.decode().split("\n")]
    count = next(int(words[2]) for words in lines if words[:2] == ["element", "vertex"])
    sizes = {"char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2, "uint16": 2, "int": 4,
             "uint": 4, "int32": 4, "uint32": 4, "float": 4, "float32": 4, "double": 8, "float64": 8}
    size = sum(sizes[words[1]] for words in lines if words[:1] == ["property"])
    records = [body[i * size:(i + 1) * size] for i in range(count)]
    return [struct.unpack_from("<3f", record) for record in records], records


def write_points(path, points):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    body = array.array("f", (value for point in points for value in point)).tobytes()
    path.write_bytes((header + "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n").encode() + body)


# --- parts ----------------------------------------------------------------------------------------------------------

def estimates(bench):
    rows = []
    sources = bench.shapes or bench.meshes
    for density, flags in DENSITIES:
        ratios = {level: [] for level in ESTIMATED}
        clean = []
        for mesh in sources:
            def noise(sigma):  # in file units
                cloud = bench.noisy(mesh, "--points", 50000, "--sigma", repr(sigma) if sigma > 0 else 0, "--seed", 1, *flags)
                found = bench.report("info", cloud)
                return found["noise"], found["spacing"]
            still, spacing = noise(0)
            clean.append(still / spacing)
            for level in ESTIMATED:
                ratios[level].append(noise(level * spacing)[0] / (level * spacing))
        rows.append([f"random by area, {density}", f"{max(clean):.3f}"] + [
            f"{statistics.median(found):.2f} ({min(found):.2f}-{max(found):.2f})" for found in ratios.values()])
    return (f"`info` on {len(sources)} shapes of 50,000 points: estimate over truth, median (least-largest), and the largest estimate on "
            "clean clouds, in spacings:\n\n"
            + table(["", "clean, at most", *(f"{level} spacings" for level in ESTIMATED)], rows))


def steady(bench):
    rows = []
    for mesh in bench.meshes:
        for density, flags in DENSITIES:
            changes = []
            for level in MESH_LEVELS:
                once, _ = bench.fair(bench.noisy(mesh, "--points", 100000, "--sigma", f"{level}%", "--seed", 1, *flags), "once.ply")
                twice, _ = bench.fair(once, "twice.ply")
                changes.append(100 * (bench.left(twice, mesh)[0] / bench.left(once, mesh)[0] - 1))
            rows.append([f"{mesh.stem} {density}", *(f"{change:+.1f} %" for change in changes)])
    text = ("A second run on the own output, mean distance, change:\n\n" + table(["", *(f"{level} %" for level in MESH_LEVELS)], rows))
    moved = []
    for mesh in bench.shapes:
        for cloud in sorted(mesh.parent.glob(mesh.name.replace("_mesh.ply", "_?0000.ply"))):
            _, report = bench.fair(cloud, "once.ply")
            moved.append(100 * report["displacement"]["mean"] / report["spacing"])
    if moved:
        text += f"\nThe {len(moved)} clouds without noise move by {min(moved):.2f} to {max(moved):.2f} % of the spacing on average.\n"
    return text


def low(bench):
    rows = []
    for mesh in bench.meshes:
        for points, levels in ((100_000, (0.01, 0.02, 0.03, 0.05)), (200_000, (0.01, 0.02, 0.03, 0.05)), (1_000_000, (0.005, 0.01, 0.02))):
            for level in levels:
                cloud = bench.noisy(mesh, "--points", points, "--sigma", f"{level}%", "--seed", 1)
                out, report = bench.fair(cloud, "once.ply")
                before, after = bench.left(cloud, mesh), bench.left(out, mesh)
                rows.append([f"{mesh.stem}, {points:,}", f"{level} %", str(report["params"]["relaxation"]),
                             *(f"{b:.4f} to {a:.4f}" for b, a in zip(before, after))])
    return ("Noise far below the spacing, before and after a run, % of the diagonal:\n\n"
            + table(["", "noise", "relaxation", "mean distance", "edge rms"], rows))


def sheets(bench):
    """Two unit squares above each other; distance to the own one, away from the border."""
    rows = []
    generator = random.Random(1)
    for points, gap, sigma in ((40000, 0.6, 0.05), (40000, 0.6, 0.1), (40000, 1.1, 0.0), (40000, 1.1, 0.05), (40000, 1.1, 0.1), (40000, 2, 0.1),
                               (40000, 2, 0.3), (10000, 1.1, 0.1), (10000, 1.5, 0.1), (10000, 2, 0.1), (200000, 0.5, 0.05)):
        percent = math.sqrt(2) / 100
        height = [gap * percent * (i % 2) for i in range(points)]
        cloud = [(generator.random() + generator.gauss(0, sigma * percent), generator.random() + generator.gauss(0, sigma * percent),
                  h + generator.gauss(0, sigma * percent)) for h in height]
        write_points(bench.path("sheets.ply"), cloud)
        out, report = bench.fair(bench.path("sheets.ply"), "once.ply")
        inner = [i for i, p in enumerate(cloud) if all(0.03 < c < 0.97 for c in p[:2])]
        left = [statistics.fmean(abs(its[i][2] - height[i]) for i in inner) / percent for its in (cloud, read_points(out)[0])]
        rows.append([f"{points:,}", f"{gap} %", f"{gap * percent / math.sqrt(2 / points):.1f}", f"{sigma} %",
                     f"{report['noise']['before'] / percent:.3f} %", f"{left[0]:.3f} to {left[1]:.3f}"])
    return ("Two parallel sheets, default run, lengths in % of the diagonal:\n\n"
            + table(["points", "gap", "in spacings", "noise", "estimate", "mean distance to the own sheet"], rows))


def outliers(bench):
    rows = []
    for mesh in bench.meshes:
        for density, flags in DENSITIES:
            for level in MESH_LEVELS:
                words = ("--points", 100000, "--sigma", f"{level}%", "--seed", 1, *flags)
                plain, strewn = bench.noisy(mesh, *words), bench.noisy(mesh, *words, "--outliers", "1%")
                others = [i for i, (a, b) in enumerate(zip(read_points(plain)[1], read_points(strewn)[1])) if a == b]
                means = []
                for cloud in (plain, strewn):
                    out, report = bench.fair(cloud, "once.ply", "--outliers", "mark")
                    points, records = read_points(out)
                    write_points(bench.path("others.ply"), [points[i] for i in others])
                    means.append(bench.left(bench.path("others.ply"), mesh)[0])
                marked = {i for i, record in enumerate(records) if record[12] != 0}  # of the strewn cloud
                found = len(marked - set(others)) / (len(points) - len(others))
                rows.append([f"{mesh.stem} {density}", f"{level} %", f"{means[1] / means[0]:.3f}", f"{100 * found:.0f} %",
                             f"{100 * len(marked & set(others)) / len(others):.3f} %"])
    return ("1 % of the points anywhere in the box grown by a tenth: mean distance of the others over the same without outliers, share of the "
            "outliers that are marked, share of the others that are:\n\n" + table(["", "noise", "others", "marked", "others marked"], rows))


def nearest(points, places, most):
    """The `most` nearest points of each place, by cells of about so many points' size."""
    finite = [p for p in points if all(map(math.isfinite, p))]
    spans = [max(axis) - min(axis) for axis in zip(*finite)]
    size = max(spans) / math.sqrt(len(finite) / most) * 1.2
    cells = {}
    for p in finite:
        cells.setdefault(tuple(int(c // size) for c in p), []).append(p)
    for place in places:
        x, y, z = (int(c // size) for c in place)
        near = [p for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) for p in cells.get((x + i, y + j, z + k), ())]
        near.sort(key=lambda p: math.dist(p, place))
        yield near[:most] if len(near) >= most and math.dist(near[most - 1], place) < size else None


def plane_residual(points):
    """Root of the least eigenvalue of the covariance, by the closed form of Smith 1961."""
    n = len(points)
    centre = [sum(axis) / n for axis in zip(*points)]
    offsets = [[c - m for c, m in zip(p, centre)] for p in points]
    a = [[sum(o[i] * o[j] for o in offsets) / n for j in range(3)] for i in range(3)]
    mean = sum(a[i][i] for i in range(3)) / 3
    spread = math.sqrt(sum((a[i][j] - (mean if i == j else 0)) ** 2 for i in range(3) for j in range(3)) / 6)
    if spread == 0:
        return 0.0
    b = [[(a[i][j] - (mean if i == j else 0)) / spread for j in range(3)] for i in range(3)]
    half = (b[0][0] * (b[1][1] * b[2][2] - b[1][2] ** 2) - b[0][1] * (b[0][1] * b[2][2] - b[1][2] * b[0][2])
            + b[0][2] * (b[0][1] * b[1][2] - b[1][1] * b[0][2])) / 2
    angle = math.acos(max(-1.0, min(1.0, half))) / 3
    return math.sqrt(max(0.0, mean + 2 * spread * math.cos(angle + 2 * math.pi / 3)))


def residuals(points, places):
    """{points of the plane: [residual at each place]}; planes through the cloud's own points, at the same places before and after."""
    found = {count: [] for count in PLANES}
    for near in nearest(points, places, max(PLANES)):
        for count in PLANES:
            found[count].append(plane_residual(near[:count]) if near else None)
    return found


def scans(bench):
    """Planes: the residual at flat places (the flatter half of those before); steep: at the worst tenth, where edges are."""
    rows = []
    for scan in bench.scans:
        convert = ("--strength", 0, "--k", 3, "--iterations", 1, "--format", "ply", "--encoding", "binary")
        before, _ = bench.fair(scan, "before.ply", *convert)
        out, report = bench.fair(scan, "after" + scan.suffix, "--outliers", "mark")
        after, _ = bench.fair(out, "after.ply", *convert) if scan.suffix != ".ply" else (out, None)
        (start, records), (end, moved) = read_points(before), read_points(after)
        generator = random.Random(1)
        finite = [i for i, p in enumerate(start) if all(map(math.isfinite, p))]
        sample = sorted(generator.sample(finite, min(PLACES, len(finite))))
        pairs = [residuals(its, [its[i] for i in sample]) for its in (start, end)]
        cells = []
        for count in PLANES:
            both = sorted((b, a) for b, a in zip(*(pair[count] for pair in pairs)) if b is not None and a is not None and b > 0)
            flat, steep = both[:len(both) // 2], both[-(len(both) // 10 or 1):]
            cells += ["/".join(f"{statistics.median(a / b for b, a in part):.2f}" for part in (flat, steep)) if both else ""]
        attributes = all(a[12:] == b[12:len(a)] for a, b in zip(records, moved))
        noise, farthest = report["noise"]["before"], report["displacement"]["max"]
        rows.append([scan.name, f"{report['points']:,}", f"{noise / report['spacing']:.3f}", str(report["params"]["relaxation"]), *cells,
                     f"{farthest / noise:.2f}", f"{100 * report['unmoved']['outliers'] / report['points']:.2f} %",
                     "same" if attributes and len(start) == len(end) else "DIFFER"])
    return ("Real scans, default run with `--outliers mark`: residuals of planes after over before, median of the flatter half / of the steepest "
            "tenth of the places; farthest move in noise sigmas:\n\n"
            + table(["", "points", "noise, spacings", "relaxation", *(f"{count} points" for count in PLANES), "farthest", "outliers", "attributes"], rows))


def cost(bench):
    rows = []
    for points, level in ((100_000, 0.1), (100_000, 0.3), (1_000_000, 0.1), (1_000_000, 0.3)):
        cloud = bench.noisy(bench.meshes[0], "--points", points, "--sigma", f"{level}%", "--seed", 1)
        found = []
        for _ in range(3):
            report = json.loads(run([bench.pointfair, "run", cloud, bench.path("once.ply"), "--force", "-q", "--device", "cpu", "--threads", 2,
                                     "--report", "-"]))
            estimates = sum(stage["ms"] for stage in report["stages"] if stage["name"] == "estimate")
            found.append((estimates / (report["total_ms"] - estimates), report["total_ms"], estimates))
        share, whole, estimates = sorted(found)[1]
        rows.append([f"{bench.meshes[0].stem}, {points:,}, {level} %", f"{whole:.0f}", f"{estimates:.0f}", f"{100 * share:.0f} %"])
    return (f"What the estimates add to the same run with its parameters typed in, from array to array, 2 threads (load {os.getloadavg()[0]:.0f}), "
            "median of 3:\n\n" + table(["", "run, ms", "estimates, ms", "added"], rows))


PARTS = {"estimates": estimates, "steady": steady, "low": low, "sheets": sheets, "outliers": outliers, "scans": scans, "cost": cost}


def main():
    root = Path(__file__).resolve().parent.parent
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help="of " + ", ".join(PARTS) + " (default: all)")
    parser.add_argument("--build", type=Path, default=root / "build", help="folder of the build (default: build)")
    parser.add_argument("--meshes", nargs="*", type=Path, help="instead of Armadillo and fandisk")
    parser.add_argument("--folder", type=Path, help="for clouds (default: BUILD/automatic)")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="put the tables between the marks of this page")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(PARTS):
        parser.error("no such part: " + ", ".join(sorted(unknown)))
    folder = options.folder or options.build / "automatic"
    folder.mkdir(parents=True, exist_ok=True)
    bench = Bench(options, folder)
    for part in options.parts or PARTS:
        if part == "scans" and not bench.scans:
            print("scans: none, POINTFAIR_DATA is not set", file=sys.stderr)
            continue
        print(part, file=sys.stderr, flush=True)
        put(options.write, part, PARTS[part](bench))


if __name__ == "__main__":
    main()
