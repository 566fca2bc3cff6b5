#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures how much noise is left: every method of pointfair and the peers, programs of bench/peers and the smoothers of Open3D and
PyMeshLab (bench/smoothers.py), on clouds whose truth is known.

Clouds are made by `pointfair noise`, several seeds and levels, from
  - the shapes of $POINTFAIR_DATA/punet_train (NAME_COUNT.ply, clean, and NAME_mesh.ply), noise in % of the bounding
    radius; left: Chamfer distance (squared, both ways) and squared distance to the mesh, x 1e-4 at radius 1, and beside
    it what noise along the surface alone leaves: that of the noisy points put onto the mesh;
  - the meshes of --meshes, by default the Armadillo and the fandisk of Debian's libcgal-demo, 100,000 points even and of
    density 50:1, noise in % of the diagonal; left: mean distance and edge rms, both in % of the diagonal;
and from both the mean error of normals, of planes through 16 points, in degrees. pointfair makes its default run, or as
--contender says. A peer runs at its documented defaults and at each setting of a small sweep, of which the best counts
column by column, chosen with the truth in hand. Needs a build with -DPOINTFAIR_BENCH=ON for the peers (`make quality`
does all of it).

Each result is kept in FOLDER/results.jsonl as it comes, so a run that was stopped goes on where it was, and a changed
program is measured again alone. By default, some hours of one core, most of them the peers'; what is left is said while
it runs. Prints Markdown; --write puts it between the marks <!-- quality NAME --> and <!-- end --> of a page.
A quick look: bench/quality.py --seeds 1 --peers none --shapes cad dino
Another setting: bench/quality.py --peers none --contender "sharper=--crease-angle 15"
"""
import argparse
import functools
import hashlib
import json
import math
import os
import statistics
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from quality_clouds import cgal_meshes, mesh_cases, shape_cases
from quality_tables import Row, put, tables
from smoothers import METHODS as SMOOTHERS
from smoothers import flags_of

EDGE_DEGREES = 40
NORMAL_NEIGHBORS = 16


@dataclass(frozen=True)
class Contender:
    """A way from a noisy file to a fair one: settings, of which the best counts if there are several."""

    name: str
    program: str | None  # of bench/peers; None: pointfair
    settings: tuple  # of flags

    @property
    def is_peer(self):
        return self.program not in (None, "noisy", "on_mesh")


NOISY = Contender("noisy", "noisy", ((),))
ON_MESH = Contender("noisy, put onto the mesh", "on_mesh", ((),))  # about what the best move along the normals leaves
METHODS = ("laplacian", "taubin", "hc-laplacian", "mls", "wiener", "mollified", "learned")
PEERS = (  # the quick ones first
    Contender("PCL MLS, default", "pcl_mls", (("--k", "48"),)),
    Contender("PCL MLS, best of 4", "pcl_mls", tuple(("--k", str(k)) for k in (24, 48, 96, 192))),
    Contender("CGAL jet, default", "cgal_jet", (("--k", "24"),)),
    Contender("CGAL jet, best of 4", "cgal_jet", tuple(("--k", str(k)) for k in (24, 48, 96, 192))),
    Contender("CGAL bilateral, default", "cgal_bilateral", (("--k", "24"),)),
    Contender("CGAL bilateral, best of 5", "cgal_bilateral", tuple(("--k", str(k)) for k in (12, 24, 48, 96, 192))),
    *(Contender(f"{method.title}, {kind}", program, settings)
      for program, method in SMOOTHERS.items()
      for kind, settings in (("default", ((),)),
                             (f"best of {len(method.sweep) + 1}", ((), *(flags_of(setting) for setting in method.sweep))))),
)


def run(command):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"stopped: exit code {done.returncode} of {' '.join(map(str, command))}")
    return done.stdout


def processor_seconds(command):
    """Runs it; what it took of the processor, which other work on the machine changes little."""
    child = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        sys.exit(f"stopped: exit code {child.returncode} of {' '.join(map(str, command))}")
    return usage.ru_utime + usage.ru_stime


def digest(*parts):
    return hashlib.sha256(b"\0".join(part if isinstance(part, bytes) else str(part).encode() for part in parts)).hexdigest()[:20]


@functools.cache
def file_digest(path):
    return digest(path.read_bytes())


class Bench:
    def __init__(self, options, folder):
        self.options, self.folder = options, folder
        self.pointfair = options.build / "bin" / "pointfair"
        self.log = folder / "results.jsonl"
        self.results = {}
        if self.log.exists():
            for line in self.log.read_text().splitlines():
                result = json.loads(line)
                self.results[result.pop("key")] = result

    def noisy(self, case):
        path = self.folder / f"{case.name}.ply"
        if not path.exists():
            part = path.with_suffix(".part.ply")
            run([self.pointfair, "noise", case.source, part, *case.flags, "--force", "-q", "--threads", 1])
            part.rename(path)
        return path

    def program(self, contender):
        if contender.program is None:
            return self.pointfair
        return self.options.build / "bin" / "peers" / contender.program

    def key(self, case, contender, flags):
        """Of one result: the cloud, the program and its flags."""
        program = "" if contender.program == "noisy" else file_digest(self.program(contender))
        return digest(file_digest(self.noisy(case)), program, *flags)

    def measure(self, case, cloud):
        """What is left, by name of the figure."""
        report = json.loads(run([self.pointfair, "compare", cloud, case.mesh, "--edges", EDGE_DEGREES, "--normals",
                                 NORMAL_NEIGHBORS, "--threads", 1, "--report", "-"]))
        normals = {"normals": report["normal_error"]}
        if case.clean is None:
            percent = 100 / report["diagonal"]
            return {"mean": percent * report["mean"], "edge": percent * (report["edge_rms"] or math.nan)} | normals
        to_clean = json.loads(run([self.pointfair, "compare", cloud, case.clean, "--as", "cloud", "--threads", 1,
                                   "--report", "-"]))
        return {"chamfer": 1e4 * to_clean["chamfer"], "squared": 1e4 * (report["rms"] / case.radius) ** 2} | normals

    def fair(self, case, contender, flags):
        """Figures of one setting on one cloud, and its seconds."""
        noisy = self.noisy(case)
        if contender.program == "noisy":
            return self.measure(case, noisy)
        out = self.folder / f"{case.name}.{digest(contender.program, *flags)}.ply"
        if contender == ON_MESH:
            command = [self.program(contender), noisy, case.mesh, out]
        elif contender.program is None:
            command = [self.pointfair, "run", noisy, out, *flags, "--force", "-q", "--device", "cpu", "--threads", 1]
        else:
            command = [self.program(contender), noisy, "--out", out, "--threads", 1, "--repeat", 1, *flags]
        seconds = processor_seconds(command)
        figures = self.measure(case, out) | {"seconds": seconds}
        out.unlink()
        return figures

    def measure_all(self, cases, contenders):
        """What is not known yet: seed by seed, contender by contender."""
        wanted = {}
        for case, contender in sorted(((case, contender) for contender in contenders for case in cases),
                                      key=lambda pair: (pair[0].seed, pair[1].is_peer)):
            if contender.is_peer and case.seed > self.options.peer_seeds:
                continue
            if contender == ON_MESH and case.clean is None:
                continue
            for flags in contender.settings:
                key = self.key(case, contender, flags)
                if key not in self.results:
                    wanted[key] = (case, contender, flags)
        start = time.monotonic()
        with ThreadPoolExecutor(self.options.jobs) as pool, self.log.open("a") as log:
            jobs = {pool.submit(self.fair, *job): key for key, job in wanted.items()}
            for done, job in enumerate(as_completed(jobs), 1):
                self.results[jobs[job]] = job.result()
                print(json.dumps({"key": jobs[job]} | job.result()), file=log, flush=True)
                if done % 20 == 0 or done == len(wanted):
                    print(f"{done} of {len(wanted)} results, {(time.monotonic() - start) / 60:.1f} min", file=sys.stderr,
                          flush=True)

    def row(self, cases, contender):
        """The contender's Row, of all seeds whose every result is known."""
        row = Row(contender)
        for column in dict.fromkeys(case.column for case in cases):
            mine = [case for case in cases if case.column == column]
            by_setting = [self.seed_averages(mine, contender, flags) for flags in contender.settings]
            seeds = set.intersection(*(set(averages) for averages in by_setting))
            if not seeds:
                continue
            row.seeds.append(len(seeds))
            found = [{figure: statistics.fmean(averages[seed][figure] for seed in seeds)
                      for figure in averages[min(seeds)]} for averages in by_setting]
            best = min(found, key=lambda figures: figures.get("chamfer", figures.get("mean")))  # whose time counts
            for figure in set.intersection(*map(set, found)):
                row.cells[figure, column] = best[figure] if figure == "seconds" else min(its[figure] for its in found)
        return row

    def seed_averages(self, cases, contender, flags):
        """{seed: {figure: mean over the cases}} of the seeds whose results are complete."""
        averages = {}
        for seed in sorted({case.seed for case in cases}):
            known = [self.results.get(self.key(case, contender, flags)) for case in cases if case.seed == seed]
            if all(known):
                figures = set.intersection(*map(set, known))  # of results that an older version left, some may be missing
                averages[seed] = {figure: statistics.fmean(result[figure] for result in known) for figure in figures}
        return averages


def parse_options():
    root = Path(__file__).resolve().parent.parent
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=root / "build", help="folder of the build (default: build)")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--peer-seeds", type=int, default=1, help="of the peers, which take most of the time (default: 1)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="clouds at a time, each on one thread")
    parser.add_argument("--shapes", nargs="*", metavar="NAME", help="only these of the test shapes; none: no shapes")
    parser.add_argument("--counts", nargs="*", type=int, default=(10_000, 50_000), help="points of the test shapes")
    parser.add_argument("--meshes", nargs="*", type=Path, help="instead of Armadillo and fandisk; none: no meshes")
    parser.add_argument("--methods", nargs="*", default=METHODS, choices=METHODS, help="beside the default one")
    parser.add_argument("--peers", choices=("all", "none"), default="all")
    parser.add_argument("--contender", action="append", default=[], metavar="NAME=FLAGS",
                        help="pointfair with these flags; instead of the methods")
    parser.add_argument("--folder", type=Path, help="for clouds and results (default: BUILD/quality)")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="put the tables between the marks of this page")
    parser.add_argument("--known", action="store_true", help="tables of the results that are there; measures nothing")
    return parser.parse_args()


def contenders_of(options):
    yield NOISY
    if (options.build / "bin" / "peers" / ON_MESH.program).exists():
        yield ON_MESH
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
            print(f"{peer.program} is missing: its library was not found", file=sys.stderr)


def processor():
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown processor"


def main():
    options = parse_options()
    folder = options.folder or options.build / "quality"
    folder.mkdir(parents=True, exist_ok=True)
    bench = Bench(options, folder)
    contenders = list(contenders_of(options))
    data = os.environ.get("POINTFAIR_DATA")
    groups = []
    meshes = cgal_meshes(folder) if options.meshes is None else options.meshes
    groups += [(mesh.stem, ("mean", "edge", "normals", "seconds"), list(mesh_cases([mesh], options.seeds)))
               for mesh in meshes]
    if data and options.shapes != []:
        groups.append(("shapes", ("chamfer", "squared", "normals", "seconds"),
                       list(shape_cases(Path(data), options.shapes, options.counts, options.seeds))))
    if not options.known:
        bench.measure_all([case for _, _, cases in groups for case in cases], contenders)
    for name, figures, cases in groups:
        rows = [row for contender in contenders if (row := bench.row(cases, contender)).seeds]
        columns = list(dict.fromkeys(case.column for case in cases))
        put(options.write, name, f"{processor()}, {time.strftime('%Y-%m-%d')}.\n{tables(rows, figures, columns)}")


if __name__ == "__main__":
    main()
