#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""make estimates: judges the program on fresh random clouds and on the cases, with numpy and scipy from PyPI in
build/training/python, unless this Python has them.

    scripts/estimates.py [OPTIONS OF training/judge.py]

Ends with 77 where the packages cannot be installed."""
import importlib.util
import pathlib
import subprocess
import sys
import venv

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORK = ROOT / "build/training/python"
REQUIREMENTS = ["numpy", "scipy"]


def python_with_packages():
    """This Python or that of an environment made here."""
    if all(importlib.util.find_spec(name) for name in REQUIREMENTS):
        return sys.executable
    done = WORK / "installed"
    if not done.exists() or done.read_text() != sys.version:
        venv.create(WORK, with_pip=True, clear=True)
        install = [WORK / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *REQUIREMENTS]
        if subprocess.run(install).returncode != 0:
            print(f"skipped: {' '.join(REQUIREMENTS)} cannot be installed here")
            sys.exit(77)
        done.write_text(sys.version)
    return str(WORK / "bin/python")


def main():
    python, options = python_with_packages(), sys.argv[1:]
    subprocess.run([python, ROOT / "training/judge.py", *options], check=True)
    program = options[:1] if options and not options[0].startswith("-") else []
    print()
    subprocess.run([python, ROOT / "training/cases.py", *program], check=True)


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as failed:
        sys.exit(failed.returncode)
