# SPDX-License-Identifier: Apache-2.0
"""What each rule of the estimates is worth: switches them off one by one, on the same fresh clouds.

    python training/switches.py [--clouds N] [--seed S] [--jobs J] [--only SWITCH,...] [--try NAME=VALUE[,NAME=VALUE..] ...]

Builds the program once more, in build/training/switches, with the numbers of src/estimate/constants.hpp read from the
environment. A line is a switch: clouds that come out otherwise; what is left of them all over what is left with every rule,
mean and rms, families alike; how far clouds without noise move at most, in spacings (rms); the families that lose and gain
most.
--try sets numbers by hand instead. A rule that no family and no case (cases.py) pays 1 % for can go."""
import argparse
import collections
import math
import os
import pathlib
import re
import secrets
import shutil
import subprocess
from multiprocessing import Pool

os.environ.setdefault("OMP_NUM_THREADS", "1")

import families
import store
import tables
from measure import Subject

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDER = ROOT / "build/training/switches"
CONSTANTS = "src/estimate/constants.hpp"
VARIABLE = "POINTFAIR_SWITCHES"                   # read by that program alone
OFF, NEVER = 0, 1e9
WORTH = .01                                       # of the logarithm: families that change by less are not named
SWITCHES = {
    "repeats": {"kEvenDistances": OFF}, "rows that share an error": {"kRowShare": NEVER}, "hidden surface": {"kMessyNoise": NEVER},
    "quiet places": {"kQuietNoise": OFF}, "growth of volumes": {"kGrowthOfVolume": OFF}, "further points agree": {"kFurtherShare": OFF},
    "planes meet": {"kSameSurface": NEVER}, "regular grids": {"kRegularShare": NEVER}, "gaps of depth widen": {"kWideningOfGaps": OFF},
    "wider for depths": {"kDepthWidening": 1}, "bound by the flattest": {"kHiddenFromFew": 0}, "far correlation": {"kMostFarNoise": OFF},
    "dense noise": {"kDenseNoise": NEVER}, "share of the spacing": {"kMostOfSecond": NEVER}, "growth goes on": {"kFarSlowing0": -NEVER},
    "growth slows": {"kFarSlowing1": NEVER}, "growth by scale": {"kMoreGrowth": NEVER}, "triangulation": {"kLeastStepRange": NEVER},
    "pixels": {"kMostUneven": NEVER}, "rows of small clouds": {"kLeastMeasurements": 1},
    "two sheets": {"kSheetShare": NEVER}, "similarity of sheets": {"kSheetSimilarity": NEVER}, "least quantile": {"kMostOverLeast": NEVER},
    "room": {"kRoominess": 1}, "confinement": {"kConfinement": 1}, "flat scale": {"kFlatPercent0": 100, "kFlatPercent1": 100},
    "levels": {"kLargestLevel": 1}, "shrinking": {"kChanceOfLevels": OFF}, "cut off": {"kWideAgainstResiduals": OFF},
    "prior": {"kSpread": NEVER}, "width": {"kWidestReach": 1.000001}, "fading": {"kNoiseOfWidth": NEVER}, "trusted noise": {"kTrustedNoise": OFF},
    "share of a step": {"kDamage": OFF}, "similarity": {"kSimilarityWidth": NEVER}, "farthest move": {"kFarthestMove": NEVER},
    "crease angle": {"kCreaseAngle": 180}, "second iteration": {"kIterations": 1},
}
NUMBER = r"inline constexpr (double|int|std::size_t|std::uint64_t) "
FIXED = ("kPool", "kSmoothed", "kMostNodes", "kSpans", "kLookedAt", "kStepNeighbors", "kRepeatNeighbors", "kRowNeighbors", "kLeastShape",
         "kReachPoints", "kBeyondCopies", "kGlance", "kFewestRows", "kEndless")   # sizes of arrays, and what others share
READER = """#include <cstdlib>
#include <string>
inline double switched(const char* name, double value) {
  const char* all = std::getenv("%s");
  const std::string text = std::string(",") + (all ? all : ""), key = std::string(",") + name + "=";
  const auto at = text.find(key);
  return at == std::string::npos ? value : std::strtod(text.c_str() + at + key.size(), nullptr);
}
""" % VARIABLE


def adjustable(text: str) -> str:
    """constants.hpp with its numbers from the environment; NAME0 and NAME1 of a pair."""
    def declared(line: re.Match) -> str:
        kind, names = line.group(1), re.split(r",\s*(?=k[A-Z])", line.group(2))
        parts = [part.split("=", 1) for part in names]
        if any(name.strip() in FIXED for name, _ in parts):
            return line.group(0)
        return " ".join(f'inline const {kind} {name} = {kind}(switched("{name}", double({value})));'
                        for name, value in ((name.strip(), value.strip()) for name, value in parts))

    def pair(line: re.Match) -> str:
        values = ", ".join(f'switched("{line.group(1)}{k}", {value.strip()})'
                           for k, value in enumerate(line.group(2).split(",")))
        return f"inline const double {line.group(1)}[] = {{{values}}};"

    text = re.sub(NUMBER + r"\s*(k\w+\s*=\s*[^;{}]*);", declared, text)
    text = re.sub(r"inline constexpr double (k\w+)\[\] = \{([^}]*)\};", pair, text)
    return text.replace("#pragma once\n", "#pragma once\n" + READER, 1)


def names() -> set[str]:
    """Of the numbers that can be changed."""
    return set(re.findall(r'switched\("(k\w+)"', adjustable((ROOT / CONSTANTS).read_text())))


def numbers_of(words: str) -> dict[str, float]:
    """Of NAME=VALUE[,NAME=VALUE..]; ValueError says what is wrong."""
    numbers = {name: float(value) for name, _, value in (word.partition("=") for word in words.split(","))}
    for name in numbers:
        if name not in names():
            raise ValueError(f"{name} is no number of {CONSTANTS} that can be changed")
    return numbers


def wanted_switches(only: str | None) -> dict[str, dict]:
    chosen = only.split(",") if only else list(SWITCHES)
    for name in chosen:
        if name not in SWITCHES:
            raise ValueError(f"{name} is no switch: choose from {', '.join(SWITCHES)}")
    return {name: SWITCHES[name] for name in chosen}


def build(jobs: int) -> pathlib.Path:
    """The program; compiles what changed."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True).stdout.split("\0")
    for name in filter(None, listed):
        source, copy = ROOT / name, FOLDER / "source" / name
        wanted = adjustable(source.read_text()).encode() if name == CONSTANTS else source.read_bytes()
        if not copy.exists() or copy.read_bytes() != wanted:
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(wanted)
            shutil.copymode(source, copy)
    options = ["-DCMAKE_BUILD_TYPE=Release", "-DPOINTFAIR_CUDA=OFF", "-DPOINTFAIR_TESTS=OFF", "-DPOINTFAIR_VIEWER=OFF", "-DPOINTFAIR_PYTHON=OFF"]
    subprocess.run(["cmake", "-S", FOLDER / "source", "-B", FOLDER / "build", *options], check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", FOLDER / "build", "--target", "pointfair_cli", "-j", str(jobs)], check=True, stdout=subprocess.DEVNULL)
    return FOLDER / "build/bin/pointfair"


def judge_one(task: tuple) -> dict:
    """One cloud: its result with every rule, and for each switch the result without one."""
    family, seed, program, switches = task
    subject, results = Subject(family, seed), {}
    for name, numbers in {"": {}, **switches}.items():
        os.environ[VARIABLE] = ",".join(f"{number}={value!r}" for number, value in numbers.items())
        try:
            points, _, _, _ = store.run_program(program, subject.ply, [])
            results[name] = subject.truth.of(points, None)
        except store.ProgramFailed as why:
            results[name] = {"failed": str(why)}
    return {"family": family, "before": subject.facts(), "results": results}


def line_of(name: str, rows: list[dict]) -> list[str]:
    of_family, changed, moved = collections.defaultdict(list), 0, 0.0
    for row in rows:
        with_all, without = row["results"][""], row["results"][name]
        if "failed" in with_all or "failed" in without:
            continue
        changed += with_all != without
        if row["before"]["clean"]:
            moved = max(moved, without["moved"])
            continue
        pair = {"before": row["before"], "all": with_all, "without": without}
        logs = [math.log(tables.ratio(pair, "without", "all", which)) for which in ("mean", "rms")]
        of_family[row["family"]].append(sum(logs) / 2)
    means = sorted((sum(logs) / len(logs), family) for family, logs in of_family.items())
    gain = [f"{math.exp(mean):.2f} {family}" for mean, family in means if mean < -WORTH][:3]
    lose = [f"{math.exp(mean):.2f} {family}" for mean, family in means[::-1] if mean > WORTH][:3]
    whole = math.exp(sum(mean for mean, _ in means) / len(means)) if means else float("nan")
    return [name, str(changed), f"{whole:.4f}", f"{moved:.3f}", ", ".join(lose), ", ".join(gain)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clouds", type=int, default=2, help="of each family; default: 2")
    parser.add_argument("--seed", type=int, help="of the first cloud of each family; default: drawn")
    parser.add_argument("--jobs", type=int, default=2, help="clouds at a time; default: 2")
    parser.add_argument("--only", help="switches, with commas")
    parser.add_argument("--try", dest="tried", action="append", metavar="NAME=VALUE,..", help="numbers in place of the switches")
    args = parser.parse_args()
    seed = secrets.randbelow(1_000_000_000) if args.seed is None else args.seed
    try:
        switches = {words: numbers_of(words) for words in args.tried} if args.tried else wanted_switches(args.only)
    except ValueError as why:
        parser.error(str(why))
    program = build(args.jobs)
    print(f"seed {seed}, program {os.path.relpath(program)}", flush=True)
    tasks = [(family, seed + k, program, switches) for k in range(args.clouds) for family in families.FAMILIES]
    with Pool(args.jobs) as pool:
        rows = list(pool.imap_unordered(judge_one, tasks))
    head = ["switch", "clouds", "all", "clean", "families that lose", "families that gain"]
    print(tables.aligned([head, *(line_of(name, rows) for name in switches)]))


if __name__ == "__main__":
    main()
