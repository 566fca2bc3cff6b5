#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures how much noise is left: every method of pointfair and the peers, on clouds whose truth is known.

Clouds are made by `pointfair noise`, several seeds and levels, from
  - the shapes of $POINTFAIR_DATA/punet_train (NAME_COUNT.ply, clean, and NAME_mesh.ply), noise in % of the bounding
    radius; left: Chamfer distance (squared, both ways) and squared distance to the mesh, x 1e-4 at radius 1;
  - the meshes of --meshes, by default the Armadillo and the fandisk of Debian's libcgal-demo, 100,000 points even and of
    density 50:1, noise in % of the diagonal; left: mean distance and edge rms, both in % of the diagonal.
pointfair runs with nothing set, or as --contender says. A peer runs at its documented defaults and at each setting of
a small sweep, of which the best counts column by column, chosen with the truth in hand. Prints Markdown. Needs a build
with -DPOINTFAIR_BENCH=ON for the peers (`make quality` does all of it).
A quick look: bench/quality.py --seeds 1 --peers none --shapes cad dino
Another setting: bench/quality.py --peers none --contender "sharper=--normal-angle 15"
"""
import argparse
import array
import json
import math
import os
import statistics
import subprocess
import sys
import tarfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

SHAPE_LEVELS = (1, 2, 3)  # % of the bounding radius
MESH_LEVELS = (0.1, 0.3, 0.5)  # % of the diagonal
MESH_POINTS = 100_000
EDGE_DEGREES = 40


@dataclass(frozen=True)
class Contender:
    """A way from a noisy file to a fair one: settings, of which the best counts if there are several."""

    name: str
    program: str | None  # of bench/peers; None: pointfair
    settings: tuple  # of flags


METHODS = ("laplacian", "taubin", "hc-laplacian", "mls", "wiener", "mollified")
PEERS = (
    Contender("CGAL bilateral, default", "cgal_bilateral", (("--k", "24"),)),
    Contender("CGAL bilateral, best of 5", "cgal_bilateral", tuple(("--k", str(k)) for k in (12, 24, 48, 96, 192))),
    Contender("CGAL jet, default", "cgal_jet", (("--k", "24"),)),
    Contender("CGAL jet, best of 4", "cgal_jet", tuple(("--k", str(k)) for k in (24, 48, 96, 192))),
    Contender("PCL MLS, default", "pcl_mls", (("--k", "48"),)),
    Contender("PCL MLS, best of 4", "pcl_mls", tuple(("--k", str(k)) for k in (24, 48, 96, 192))),
)


def run(command):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"stopped: exit code {done.returncode} of {' '.join(map(str, command))}")
    return done.stdout


def bounding_radius(path):
    """Largest distance to the centre of the bounding box; of a binary PLY whose vertices are three floats."""
    data = path.read_bytes()
    header, _, body = data.partition(b"end_header\n")
    words = header.decode().split("\n")
    count = next(int(line.split()[2]) for line in words if line.startswith("element vertex"))
    if "format binary_little_endian 1.0" not in words:
        sys.exit(f"{path}: not a binary little-endian PLY")
    values = array.array("f", body[:12 * count])
    axes = [values[axis::3] for axis in range(3)]
    centre = [(min(axis) + max(axis)) / 2 for axis in axes]
    return math.sqrt(max(sum((v - c) ** 2 for v, c in zip(point, centre)) for point in zip(*axes)))


@dataclass(frozen=True)
class Case:
    """A noisy cloud and its truth."""

    column: str  # that its results are averaged in
    name: str
    source: Path  # to sample or to add noise to
    flags: tuple  # of `pointfair noise`
    mesh: Path
    clean: Path | None  # a cloud, for the Chamfer distance
    radius: float = 1.0


def shape_cases(data, names, counts, seeds):
    meshes = sorted((data / "punet_train").glob("*_mesh.ply"))
    for mesh in meshes:
        name = mesh.name.removesuffix("_mesh.ply")
        if names and name not in names:
            continue
        for count in counts:
            clean = mesh.with_name(f"{name}_{count}.ply")
            radius = bounding_radius(clean)
            for level in SHAPE_LEVELS:
                for seed in range(1, seeds + 1):
                    yield Case(f"{count // 1000}K {level} %", f"{name}_{count}_{level}_{seed}", clean,
                               ("--sigma", repr(level / 100 * radius), "--seed", seed), mesh, clean, radius)


def mesh_cases(meshes, seeds):
    for mesh in meshes:
        for density, flags in (("even", ()), ("50:1", ("--uneven", 50))):
            for level in MESH_LEVELS:
                for seed in range(1, seeds + 1):
                    yield Case(f"{mesh.stem} {density} {level} %", f"{mesh.stem}_{density.replace(':', '_')}_{level}_{seed}",
                               mesh, ("--points", MESH_POINTS, "--sigma", f"{level}%", "--seed", seed, *flags), mesh, None)


class Bench:
    def __init__(self, options, folder):
        self.options, self.folder = options, folder
        self.pointfair = options.build / "bin" / "pointfair"

    def noisy(self, case):
        path = self.folder / f"{case.name}.ply"
        if not path.exists():
            part = path.with_suffix(".part.ply")
            run([self.pointfair, "noise", case.source, part, *case.flags, "--force", "-q", "--threads", 1])
            part.rename(path)
        return path

    def measure(self, case, cloud):
        """What is left, by name of the figure."""
        report = json.loads(run([self.pointfair, "compare", cloud, case.mesh, "--edges", EDGE_DEGREES, "--threads", 1,
                                 "--report", "-"]))
        if case.clean is None:
            percent = 100 / report["diagonal"]
            return {"mean": percent * report["mean"], "edge": percent * (report["edge_rms"] or math.nan)}
        to_clean = json.loads(run([self.pointfair, "compare", cloud, case.clean, "--as", "cloud", "--threads", 1,
                                   "--report", "-"]))
        return {"chamfer": 1e4 * to_clean["chamfer"], "squared": 1e4 * (report["rms"] / case.radius) ** 2}

    def fair(self, case, contender, flags):
        """Figures of one setting on one cloud, and its seconds."""
        noisy, out = self.noisy(case), self.folder / f"{case.name}.{contender.name.replace(' ', '_')}.ply"
        start = time.monotonic()
        if contender.program is None:
            run([self.pointfair, "run", noisy, out, *flags, "--force", "-q", "--device", "cpu", "--threads", 1])
        else:
            run([self.options.build / "bin" / "peers" / contender.program, noisy, "--out", out, "--threads", 1,
                 "--repeat", 1, *flags])
        seconds = time.monotonic() - start
        figures = self.measure(case, out) | {"seconds": seconds}
        out.unlink()
        return figures

    def averages(self, cases, contender):
        """{figure: {column: mean over shapes and seeds}}; of several settings the best of each column and figure."""
        with ThreadPoolExecutor(self.options.jobs) as pool:
            jobs = [(case, flags, pool.submit(self.fair, case, contender, flags))
                    for flags in contender.settings for case in cases]
            found = {}
            for case, flags, job in jobs:
                for figure, value in job.result().items():
                    found.setdefault(figure, {}).setdefault(case.column, {}).setdefault(flags, []).append(value)
        return {figure: {column: min(statistics.fmean(values) for values in settings.values())
                         for column, settings in columns.items()} for figure, columns in found.items()}

    def untouched(self, cases):
        with ThreadPoolExecutor(self.options.jobs) as pool:
            jobs = [(case, pool.submit(lambda case=case: self.measure(case, self.noisy(case)))) for case in cases]
            found = {}
            for case, job in jobs:
                for figure, value in job.result().items():
                    found.setdefault(figure, {}).setdefault(case.column, []).append(value)
        return {figure: {column: statistics.fmean(values) for column, values in columns.items()}
                for figure, columns in found.items()}

    def results(self, cases, contenders):
        """(name, averages) of the noisy clouds and of each contender, as they are measured."""
        yield "noisy", self.untouched(cases)
        for contender in contenders:
            print(contender.name, file=sys.stderr, flush=True)
            yield contender.name, self.averages(cases, contender)


def table(header, rows):
    return "\n".join("| " + " | ".join(row) + " |" for row in [header, ["---"] * len(header), *rows]) + "\n"


def figure_table(results, figure, columns):
    rows = [[name] + [f"{averages[figure][column]:.3g}" if figure == "seconds" else f"{averages[figure][column]:.4f}"
                      for column in columns] for name, averages in results if figure in averages]
    return table(["", *columns], rows)


def cgal_meshes(folder):
    """Unpacks the Armadillo and the fandisk from where dpkg put CGAL's demo data."""
    names = ("armadillo.off", "fandisk.off")
    if not all((folder / name).exists() for name in names):
        try:
            listed = subprocess.run(["dpkg", "-L", "libcgal-demo"], capture_output=True, text=True, check=True).stdout
            archive = next(path for path in listed.split() if path.endswith("data.tar.gz"))
        except (OSError, subprocess.CalledProcessError, StopIteration):
            sys.exit("no meshes: apt-get install libcgal-demo, or give --meshes FILE...")
        with tarfile.open(archive) as files:
            for member in files:
                if (name := member.name.rsplit("/", 1)[-1]) in names:
                    (folder / name).write_bytes(files.extractfile(member).read())
    return [folder / name for name in names]


def parse_options():
    root = Path(__file__).resolve().parent.parent
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=root / "build", help="folder of the build (default: build)")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="clouds at a time, each on one thread")
    parser.add_argument("--shapes", nargs="*", metavar="NAME", help="only these of the test shapes; none: no shapes")
    parser.add_argument("--counts", nargs="*", type=int, default=(10_000, 50_000), help="points of the test shapes")
    parser.add_argument("--meshes", nargs="*", type=Path, help="instead of Armadillo and fandisk; none: no meshes")
    parser.add_argument("--methods", nargs="*", default=METHODS, choices=METHODS, help="beside the default one")
    parser.add_argument("--peers", choices=("all", "none"), default="all")
    parser.add_argument("--contender", action="append", default=[], metavar="NAME=FLAGS",
                        help="pointfair with these flags; instead of the methods")
    parser.add_argument("--folder", type=Path, help="for the clouds (default: BUILD/quality)")
    return parser.parse_args()


def contenders_of(options):
    yield Contender("pointfair", None, ((),))
    if options.contender:
        for text in options.contender:
            name, _, flags = text.partition("=")
            yield Contender(name, None, (tuple(flags.split()),))
    else:
        for method in options.methods:
            yield Contender(f"pointfair --method {method}", None, (("--method", method),))
    for peer in PEERS if options.peers == "all" else ():
        if (options.build / "bin" / "peers" / peer.program).exists():
            yield peer
        else:
            print(f"{peer.program} was not built: its library was not found", file=sys.stderr)


def main():
    options = parse_options()
    folder = options.folder or options.build / "quality"
    folder.mkdir(parents=True, exist_ok=True)
    bench = Bench(options, folder)
    contenders = list(contenders_of(options))
    data = os.environ.get("POINTFAIR_DATA")
    if data and options.shapes != []:
        cases = list(shape_cases(Path(data), options.shapes, options.counts, options.seeds))
        results = list(bench.results(cases, contenders))
        columns = list(dict.fromkeys(case.column for case in cases))
        print(f"Chamfer distance x 1e-4, {options.seeds} seeds:\n\n{figure_table(results, 'chamfer', columns)}")
        print(f"Mean squared distance to the mesh x 1e-4:\n\n{figure_table(results, 'squared', columns)}")
        print(f"Seconds on one thread, files included:\n\n{figure_table(results, 'seconds', columns)}", flush=True)
    meshes = cgal_meshes(folder) if options.meshes is None else options.meshes
    for mesh in meshes:
        cases = list(mesh_cases([mesh], options.seeds))
        results = list(bench.results(cases, contenders))
        columns = list(dict.fromkeys(case.column for case in cases))
        print(f"Mean distance, % of the diagonal:\n\n{figure_table(results, 'mean', columns)}")
        print(f"Edge rms, % of the diagonal:\n\n{figure_table(results, 'edge', columns)}")
        print(f"Seconds on one thread, files included:\n\n{figure_table(results, 'seconds', columns)}", flush=True)


if __name__ == "__main__":
    main()
