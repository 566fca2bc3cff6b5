#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the program on small clouds of all kinds and compares the SHA-256 of each file that it writes with
tests/golden/hashes.txt: the same bytes on every processor, system, number of threads, instruction set, and in tiles.

    tests/golden/golden.py build/bin/pointfair                        every case in every way this processor has
    tests/golden/golden.py --runner 'qemu-aarch64-static' FILE        a program of another platform
    tests/golden/golden.py --device cuda --isa '' FILE                on a card
    tests/golden/golden.py build/bin/pointfair --regenerate           after results changed on purpose; writes hashes.txt
"""
import argparse
import concurrent.futures
import hashlib
import itertools
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

from clouds import CLOUDS, MESHES

HASHES = pathlib.Path(__file__).with_name("hashes.txt")
METHODS = ["laplacian", "taubin", "hc-laplacian", "mls", "wiener", "mollified", "learned", "implicit"]
# a few of each kind
SOME = ["sphere.ply", "waves_large.ply", "cube.ply", "plate.ply", "sweep.pcd", "depth_image.pcd", "repeated.ply",
        "far_off.ply", "holes.ply", "nine.ply"]
ALL_WORDS = {"default": [], "paper": ["--preset", "paper"], "k8": ["--k", "8"]}
MORE_WORDS = {
    "iterations": ["--iterations", "3"],
    "outliers": ["--outliers", "move"],
    "normals": ["--normals", "write"],
    "noise": ["--write-noise"],
    "las": [],  # written in that format
    "e57": [],
}
ALONG_MESH = {"mesh": [], "mesh_rings": ["--rings", "2"], **{f"mesh_{method}": ["--method", method] for method in
              ["laplacian", "taubin", "hc-laplacian", "mollified", "implicit", "fleishman", "jones"]}}
NOT_IN_TILES = {"learned", "implicit", "normals", "noise", "las", "e57", *ALONG_MESH}  # refused there
NOT_ON_CARDS = {"mesh_implicit", "mesh_fleishman", "mesh_jones"}  # likewise
RAY = {"ray": ["--along", "ray", "--viewpoint", "0,0,0"]}
OUTPUT = {"las": "las", "e57": "e57", "normals": "ply", "noise": "ply"}


def cases():
    """{name: (cloud, words, ending of the output)}"""
    found = {}
    for words, clouds in [(ALL_WORDS, CLOUDS), ({method: ["--method", method] for method in METHODS}, SOME),
                          (MORE_WORDS, SOME), (RAY, ["sweep.pcd", "depth_image.pcd"])]:
        for (name, options), cloud in itertools.product(words.items(), clouds):
            found[f"{cloud} {name}"] = (cloud, options, OUTPUT.get(name, cloud.rpartition(".")[2]))
    for (name, options), mesh in itertools.product(ALONG_MESH.items(), MESHES):
        found[f"{mesh} {name}"] = (mesh, ["--connectivity", "mesh", *options], "ply")
    return found


def ways(isas, threads, tiles):
    """Environments and words that must not change a result: {name: (environment, words)}."""
    return {f"{isa or 'best'}, {n} threads, {'in memory' if t == 0 else f'{t} tiles'}":
            ({"POINTFAIR_ISA": isa} if isa else {}, ["--threads", str(n)] + (["--tiles", str(t)] if t else []))
            for isa, n, t in itertools.product(isas, threads, tiles)}


def hash_of(program, folder, device, case, environment, words):
    """Of the file that the program writes, or its exit code."""
    cloud, options, ending = case
    with tempfile.TemporaryDirectory(dir=folder) as work:
        out = pathlib.Path(work) / f"out.{ending}"
        command = [*program, "run", str(folder / cloud), str(out), "--quiet", "--device", device, *options, *words]
        done = subprocess.run(command, capture_output=True, env={**os.environ, **environment}, cwd=work)
        if done.returncode != 0:
            return f"exit code {done.returncode}{' and a file' if out.exists() else ''}"
        return hashlib.sha256(out.read_bytes()).hexdigest()[:32]


def numbers(text):
    return [int(word) for word in text.split(",")]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--runner", default="", help="words before the program, as 'qemu-aarch64-static', wine or node")
    parser.add_argument("--device", default="cpu", help="cpu, cuda or cuda:N")
    parser.add_argument("--isa", default="sse2,avx2,avx512", help="instruction sets; an empty word: the best")
    parser.add_argument("--threads", type=numbers, default=[1, 2, 7])
    parser.add_argument("--tiles", type=numbers, default=[0, 3], help="0: in memory")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--slice", default="0/1", help="I/N: every Nth case from the Ith on, each in every way")
    parser.add_argument("--regenerate", action="store_true")
    args = parser.parse_args()
    program = [*shlex.split(args.runner), str(pathlib.Path(args.program).resolve())]
    first, step = map(int, args.slice.split("/"))
    wanted = dict(itertools.islice(cases().items(), first, None, step))
    if args.device != "cpu":
        wanted = {name: case for name, case in wanted.items() if name.split()[1] not in NOT_ON_CARDS}
    known = dict(line.rsplit(": ", 1) for line in HASHES.read_text().splitlines()) if HASHES.exists() else {}
    all_ways = ways(args.isa.split(","), args.threads, args.tiles)
    if args.regenerate:
        wanted, all_ways = cases(), dict(itertools.islice(all_ways.items(), 1))
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        folder = pathlib.Path(folder)
        for name in {cloud for cloud, _, _ in wanted.values()}:
            (folder / name).write_bytes({**CLOUDS, **MESHES}[name]())
        runs = {(case, way): pool.submit(hash_of, program, folder, args.device, wanted[case], *all_ways[way])
                for case in wanted for way in all_ways if not (case.split()[1] in NOT_IN_TILES and "--tiles" in all_ways[way][1])}
        got = {key: run.result() for key, run in runs.items()}
    if args.regenerate:
        HASHES.write_text("".join(f"{case}: {value}\n" for (case, _), value in got.items()))
        print(f"wrote {len(got)} hashes to {HASHES}")
        return
    wrong = [f"{case} ({way}): {value}, not {known.get(case)}" for (case, way), value in got.items() if known.get(case) != value]
    print("\n".join(wrong[:40]))
    print(f"{len(got) - len(wrong)} of {len(got)} runs agree: {len(wanted)} cases, each in {len(all_ways)} ways")
    sys.exit(1 if wrong else 0)


main()
