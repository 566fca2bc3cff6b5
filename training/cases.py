# SPDX-License-Identifier: Apache-2.0
"""Small clouds that used to go wrong, each with the right result as numbers: a table of passed and failed.

    python training/cases.py [PROGRAM] [--only CASE,...] [--files FOLDER]

Each case is run on a file of POINTFAIR_DATA/cases, if it is there, and on clouds made here."""
import argparse
import os
import pathlib
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import case_clouds
import store
import tables

ROOT = pathlib.Path(__file__).resolve().parent.parent


@dataclass
class Check:
    """One number and what it must be."""
    what: str
    value: float
    at_least: float = -float("inf")
    at_most: float = float("inf")

    @property
    def passed(self) -> bool:
        return self.at_least <= self.value <= self.at_most

    def limits(self) -> str:
        low, high = self.at_least > -float("inf"), self.at_most < float("inf")
        if low and high:
            return f"{self.at_least:.3g} to {self.at_most:.3g}"
        return f"≥ {self.at_least:.3g}" if low else f"≤ {self.at_most:.3g}"


class Run:
    """Runs the program on arrays or files in a folder of its own."""

    def __init__(self, program: pathlib.Path, folder: pathlib.Path):
        self.program, self.folder, self.count = program, folder, 0

    def __call__(self, source, options: list[str] | None = None):
        """Points, attributes, report, words. source: a path, points, or points with attributes."""
        path = source
        if not isinstance(source, pathlib.Path):
            self.count += 1
            path = self.folder / f"{self.count}.ply"
            case_clouds.write(path, source)
        return store.run_program(self.program, path, options or [])


Checks = Iterator[Check]
CASES: dict[str, tuple[Callable, Callable]] = {}


def case(inputs: Callable):
    """Registers a function of (run, input), the checks of one cloud; inputs(folder of files or None) gives (label, cloud)."""
    def register(function: Callable) -> Callable:
        CASES[function.__name__] = (function, inputs)
        return function
    return register


@case(case_clouds.forests)
def sparse_forest(run: Run, forest: case_clouds.Forest) -> Checks:
    """The ground between crowns gets no worse, crowns stay, and a line says so; with --where too."""
    for name, options in (("", []), (", --where", ["--where", "classification=2"])):
        points, _, _, words = run(forest.source, options)
        yield Check(f"ground, rms after over before{name}", forest.ground_error(points) / forest.ground_error(None), at_most=1.05)
        yield Check(f"crown points moved, %{name}", 100 * forest.crowns_moved(points), at_most=5)
        if not options:
            yield Check("says that no surface shows", float("surface" in words), at_least=1)


@case(case_clouds.repeated)
def repeated_points(run: Run, cloud: case_clouds.Repeated) -> Checks:
    """As for one copy, and copies stay together."""
    once = cloud.error(run(cloud.once)[0], cloud.one_copy)
    points = run(cloud.points)[0]
    yield Check("rms over that of one copy", cloud.error(points, cloud.same) / once, at_most=1.1)
    yield Check("copies apart, spacings", cloud.apart(points), at_most=1e-3)


@case(case_clouds.soups)
def unwelded_mesh(run: Run, cloud: case_clouds.Repeated) -> Checks:
    """As for the welded mesh, and the copies of a vertex stay together."""
    yield from repeated_points(run, cloud)


@case(case_clouds.two_exports)
def same_scan_two_roundings(run: Run, cloud: case_clouds.Repeated) -> Checks:
    """The noise is found, and removed as if there were one export."""
    once = cloud.error(run(cloud.once)[0], cloud.one_copy)
    points, _, report, _ = run(cloud.points)
    yield Check("said over true noise", report["noise"]["before"] / cloud.noise, at_least=.75, at_most=1.3)
    yield Check("rms over that of one export", cloud.error(points, cloud.same) / once, at_most=1.15)


@case(case_clouds.stepped)
def disparity_steps(run: Run, cloud: case_clouds.Known) -> Checks:
    """The steps of a depth camera become the slanted surface."""
    points = run(cloud.points)[0]
    yield Check("rms after over before", cloud.error(points) / cloud.error(cloud.points), at_most=cloud.limit)


@case(case_clouds.clean_grids)
def clean_grid(run: Run, cloud: case_clouds.Known) -> Checks:
    """Nothing moves by more than 5 % of the spacing."""
    points = run(cloud.points)[0]
    yield Check("most moved, spacings", cloud.most_moved(points), at_most=.05)


@case(case_clouds.with_normals)
def consistent_normals(run: Run, cloud: case_clouds.Known) -> Checks:
    """--normals write --orient: all outwards or all inwards."""
    _, attributes, _, _ = run(cloud.points, ["--normals", "write", "--orient"])
    yield Check("consistently oriented, %", 100 * cloud.consistent(attributes), at_least=98)


@case(case_clouds.blurred_planes)
def blurred_plane(run: Run, cloud: case_clouds.Known) -> Checks:
    """Correlated noise is seen and most of it removed."""
    points, _, report, _ = run(cloud.points)
    yield Check("said over true noise", report["noise"]["before"] / cloud.noise, at_least=.67, at_most=1.5)
    yield Check("rms after over before", cloud.error(points) / cloud.error(cloud.points), at_most=cloud.limit)


@case(case_clouds.plates)
def thin_plate(run: Run, cloud: case_clouds.Plate) -> Checks:
    """A plate of 3 to 4 noise keeps two sides."""
    points, _, report, _ = run(cloud.points)
    yield Check("said over true noise", report["noise"]["before"] / cloud.noise, at_least=.67, at_most=1.5)
    yield Check("thickness left, share", cloud.thickness(points), at_least=.4)
    yield Check("rms after over before", cloud.error(points) / cloud.error(cloud.points), at_most=1.0)


@case(case_clouds.between_walls)
def mixed_pixels(run: Run, cloud: case_clouds.Walls) -> Checks:
    """Points between two walls of a depth image, without the place of the sensor, are found as outliers."""
    _, attributes, _, _ = run(cloud.points, ["--outliers", "mark"])
    marked = attributes["outlier"] > 0
    yield Check("found, % of the mixed", 100 * float(marked[cloud.mixed].mean()), at_least=66)
    yield Check("false, % of the others", 100 * float(marked[~cloud.mixed].mean()), at_most=1)


@case(case_clouds.gardens)
def mixed_among_leaves(run: Run, gardens: list[case_clouds.Garden]) -> Checks:
    """Mixed pixels are found, and of all else, leaves and wires too, few points are marked."""
    for way, least_of_worst in (("place told", 70), ("place found", 60)):
        shares, found = [], []
        for garden in gardens:
            place = ["--viewpoint", ",".join(map(str, garden.place))] if way == "place told" else []
            marked = run(garden.points, ["--outliers", "mark", *place])[1]["outlier"] > 0
            found.append(marked[garden.mixed])
            kinds = [~garden.mixed] + [~garden.mixed & (garden.part == name) for name in (case_clouds.LEAF, "wire")]
            shares.append([100 * float(marked[kind].mean()) for kind in kinds])
        others, leaves, wires = np.array(shares).T
        yield Check(f"{way}: of the mixed, %, all scans", 100 * float(np.concatenate(found).mean()), at_least=80)
        yield Check(f"{way}: of the mixed, %, worst scan", 100 * min(float(its.mean()) for its in found), at_least=least_of_worst)
        yield Check(f"{way}: of all others, %, worst scan", max(others), at_most=5)
        yield Check(f"{way}: of the leaves, %, median scan", float(np.median(leaves)), at_most=80)
        yield Check(f"{way}: of the wires, %, median scan", float(np.median(wires)), at_most=50)


def judge(program: pathlib.Path, names: list[str], files: pathlib.Path | None) -> list[list[str]]:
    """Lines of the table."""
    lines = [["case", "cloud", "what", "is", "must be", ""]]
    with tempfile.TemporaryDirectory() as folder:
        run = Run(program, pathlib.Path(folder))
        for name in names:
            function, inputs = CASES[name]
            for label, cloud in inputs(files):
                try:
                    for check in function(run, cloud):
                        verdict = "pass" if check.passed else "FAIL"
                        lines.append([name, label, check.what, f"{check.value:.3g}", check.limits(), verdict])
                except store.ProgramFailed as why:
                    lines.append([name, label, str(why), "", "", "FAIL"])
    return lines


def summary(lines: list[list[str]]) -> str:
    """How many cases hold in all of their clouds."""
    def right(columns: int) -> str:
        all_ = {tuple(line[:columns]) for line in lines[1:]}
        failed = {tuple(line[:columns]) for line in lines[1:] if line[-1] == "FAIL"}
        return f"{len(all_ - failed)} of {len(all_)}"

    return f"{right(1)} cases, {right(2)} clouds are right"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", nargs="?", type=pathlib.Path, default=ROOT / "build/bin/pointfair")
    parser.add_argument("--only", help="cases, with commas")
    data = os.environ.get("POINTFAIR_DATA")
    parser.add_argument("--files", type=pathlib.Path, default=pathlib.Path(data) / "cases" if data else None,
                        help="folder of the files; default: POINTFAIR_DATA/cases")
    args = parser.parse_args()
    names = args.only.split(",") if args.only else list(CASES)
    unknown = [name for name in names if name not in CASES]
    if unknown or not args.program.is_file():
        sys.exit(f"{unknown[0]} is no case: choose from {', '.join(CASES)}" if unknown
                 else f"{args.program}: no such program: run make build, or name one")
    files = args.files if args.files and args.files.is_dir() else None
    lines = judge(args.program, names, files)
    print(tables.aligned(lines, left=3))
    print("\n" + summary(lines) + ("" if files else "; without the files of POINTFAIR_DATA/cases"))


if __name__ == "__main__":
    main()
