#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Installs Open3D and PyMeshLab from PyPI into an environment of the build, and puts the methods of smoothers.py beside the other
peers, BUILD/bin/peers.

    bench/python_peers.py --build build/bench

Where the packages cannot be installed, it says so, and the benchmarks do without these peers."""
import argparse
import subprocess
import sys
import venv
from pathlib import Path

import smoothers

HERE = Path(__file__).resolve().parent
REQUIREMENTS = HERE / "smoothers.requirements.txt"


def make_environment(folder):
    """Its Python, or None where the packages cannot be installed."""
    done, wanted = folder / "installed", sys.version + REQUIREMENTS.read_text()
    if not done.exists() or done.read_text() != wanted:
        venv.create(folder, with_pip=True, clear=True)
        pip = [folder / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        if subprocess.run([*pip, "-r", REQUIREMENTS]).returncode != 0:
            return None
        done.write_text(wanted)
    return folder / "bin/python"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, required=True)
    build = parser.parse_args().build.resolve()
    programs = build / "bin/peers"
    programs.mkdir(parents=True, exist_ok=True)
    for name in smoothers.METHODS:
        (programs / name).unlink(missing_ok=True)
    python = make_environment(build / "python-peers")
    if python is None:
        print("Open3D and PyMeshLab cannot be installed here: measured without them", file=sys.stderr)
        return
    _, _, code = (HERE / "smoothers.py").read_text().partition("\n")
    for name in smoothers.METHODS:
        # quality.py knows a program by its bytes
        (programs / name).write_text(f"#!{python}\n# {name}\n{code}")
        (programs / name).chmod(0o755)


if __name__ == "__main__":
    main()
