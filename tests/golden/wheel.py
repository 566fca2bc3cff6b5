#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Installs the wheel for this system into a fresh environment, and compares the bytes of its module and its program with
tests/golden/hashes.txt. On every system that has a wheel; needs no compiler, and NumPy from PyPI.

    tests/golden/wheel.py dist                   a folder with wheels of all systems
    tests/golden/wheel.py dist --slice 0/25      with words for golden.py: here a part of the cases"""
import hashlib
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import venv

from clouds import CLOUDS

HERE = pathlib.Path(__file__).resolve().parent
# by the module: cloud, arguments, case of hashes.txt
RUNS = [("cube.ply", "", "default"), ("sphere.ply", "k=8", "k8"), ("sweep.pcd", "method='mls'", "mls"), ("far_off.ply", "", "e57")]


def run(*command, **options):
    if subprocess.run([str(part) for part in command], **options).returncode != 0:
        sys.exit(f"failed: {' '.join(map(str, command))}")


def wheels_to_try(dist):
    """Those that compute on the processor, or those with CUDA where there are no others: pip prefers 0.1.0+cuda13 to 0.1.0."""
    wheels = sorted(pathlib.Path(dist).glob("pointfair-*.whl"))
    return [wheel for wheel in wheels if "+" not in wheel.name] or wheels


def check_module(python, folder):
    known = dict(line.rsplit(": ", 1) for line in (HERE / "hashes.txt").read_text().splitlines())
    for cloud, arguments, case in RUNS:
        source, out = folder / cloud, folder / f"out.{'e57' if case == 'e57' else cloud.rpartition('.')[2]}"
        source.write_bytes(CLOUDS[cloud]())
        code = f"pf.read({str(source)!r}).denoise(device='cpu', {arguments}).write({str(out)!r}, overwrite=True)"
        run(python, "-c", f"import pointfair as pf; {code}", cwd=folder)
        got = hashlib.sha256(out.read_bytes()).hexdigest()[:32]
        if got != known[f"{cloud} {case}"]:
            sys.exit(f"the module's result of {cloud} {case} is {got}, not {known[f'{cloud} {case}']}")
    print(f"{len(RUNS)} of {len(RUNS)} results of the module agree")


def main():
    dist, *words = sys.argv[1:]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        folder = pathlib.Path(folder)
        venv.create(folder / "environment", with_pip=True)
        programs = folder / "environment" / ("Scripts" if os.name == "nt" else "bin")
        python = programs / ("python.exe" if os.name == "nt" else "python")
        (folder / "wheels").mkdir()
        for wheel in wheels_to_try(dist):
            shutil.copy(wheel, folder / "wheels")
        run(python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--find-links", folder / "wheels",
            "--only-binary", ":all:", "pointfair")
        check_module(python, folder)
        program = programs / ("pointfair.exe" if os.name == "nt" else "pointfair")
        run(program, "--version")
        run(sys.executable, HERE / "golden.py", program, "--isa", "", "--threads", "2", *words)


if __name__ == "__main__":
    main()
