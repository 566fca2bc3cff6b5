# SPDX-License-Identifier: Apache-2.0
"""Judges a program by what it leaves of the error of fresh random clouds, family by family.

    python training/judge.py [PROGRAM] [--baseline PROGRAM] [--bounds] [--clouds N] [--only FAMILY,...] [--seed S]

PROGRAM is build/bin/pointfair if left out. Without --seed the clouds are drawn anew; the seed is printed, and the same seed
gives the same clouds again, whose results are kept in build/training. README.md says what the columns mean."""
import argparse
import json
import os
import pathlib
import secrets
import sys
from multiprocessing import Pool

os.environ.setdefault("OMP_NUM_THREADS", "1")

import families
import tables
from measure import Subject
from store import FOLDER, forget_old_clouds

ROOT = pathlib.Path(__file__).resolve().parent.parent


def judge_one(task: tuple) -> dict:
    """One cloud with each program."""
    family, seed, program, baseline, bounds, options = task
    subject = Subject(family, seed)
    facts = subject.facts()
    row = {"family": family, "seed": seed, "before": facts, "after": subject.result(program, options)}
    if baseline:
        row["baseline"] = subject.result(baseline, [])
    if bounds and not facts["clean"]:
        row |= subject.bounds(program)
    return row


def wanted_families(only: str | None, exclude: str | None) -> list[str]:
    """Names; only and exclude also take groups (scans, objects, special, clean) and `correlated`."""
    def selected(words: str) -> set[str]:
        chosen = set()
        for word in words.split(","):
            found = {f.name for f in families.FAMILIES.values() if word in (f.name, f.group) or word == "correlated" and f.correlated}
            if not found:
                sys.exit(f"{word} is no family: choose from {', '.join(families.FAMILIES)}")
            chosen |= found
        return chosen

    names = selected(only) if only else set(families.FAMILIES)
    names -= selected(exclude) if exclude else set()
    return [name for name in families.FAMILIES if name in names]


def judge(args: argparse.Namespace) -> list[dict]:
    """A row for each cloud, in order."""
    names = wanted_families(args.only, args.exclude)
    tasks = [(name, args.seed + k, args.program, args.baseline, args.bounds, args.options.split())
             for k in range(args.clouds) for name in names]
    rows = []
    with Pool(args.jobs) as pool:
        for row in pool.imap(judge_one, tasks):
            rows.append(row)
            print(f"\r{len(rows)} of {len(tasks)} clouds", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return rows


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", nargs="?", type=pathlib.Path, default=ROOT / "build/bin/pointfair")
    parser.add_argument("--baseline", type=pathlib.Path, help="another program to compare with, cloud by cloud")
    parser.add_argument("--bounds", action="store_true", help="also: told the true noise, and the best of some widths")
    parser.add_argument("--clouds", type=int, default=3, help="of each family; default: 3")
    parser.add_argument("--only", help="families or groups, with commas")
    parser.add_argument("--exclude", help="families or groups, with commas")
    parser.add_argument("--seed", type=int, help="of the first cloud of each family; default: drawn")
    parser.add_argument("--options", default="", help="further options of PROGRAM's runs, in one word")
    parser.add_argument("--jobs", type=int, default=2, help="clouds at a time; default: 2")
    parser.add_argument("--json", type=pathlib.Path, help="file for all numbers of each cloud")
    args = parser.parse_args()
    for program in filter(None, (args.program, args.baseline)):
        if not program.is_file():
            parser.error(f"{program}: no such program: run make build, or name one")
    args.seed = secrets.randbelow(1_000_000_000) if args.seed is None else args.seed
    return args


def main() -> None:
    args = arguments()
    print(f"seed {args.seed}, clouds and results in {os.path.relpath(FOLDER)}")
    forget_old_clouds()
    rows = judge(args)
    if args.json:
        args.json.write_text(json.dumps({"seed": args.seed, "clouds": rows}, indent=1))
    print(tables.by_family(rows, bool(args.baseline), args.bounds))


if __name__ == "__main__":
    main()
