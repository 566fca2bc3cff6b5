#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Builds the site, build/docs/site, from docs/, the public headers and the wheel; a warning is an error.

    scripts/docs.py --dist build/python/dist

Ends with 77 where the packages that this needs cannot be installed."""
import argparse
import os
import pathlib
import subprocess
import sys
import venv

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORK = ROOT / "build/docs"


def make_tools(wheel):
    """A virtual environment with MkDocs and the wheel; its programs' folder."""
    folder, requirements = WORK / "tools", ROOT / "scripts/docs.requirements.txt"
    done = folder / "installed"
    pip = [folder / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    if not done.exists() or done.read_text() != sys.version + requirements.read_text():
        venv.create(folder, with_pip=True, clear=True)
        if subprocess.run([*pip, "-r", requirements, wheel]).returncode != 0:
            print("skipped: MkDocs cannot be installed here")
            sys.exit(77)
        done.write_text(sys.version + requirements.read_text())
    subprocess.run([*pip, "--force-reinstall", "--no-deps", wheel], check=True)
    return folder / "bin"


def run(*command):
    """The command's last lines where it fails or warns. Doxygen ends with 0 after some errors, too."""
    done = subprocess.run([str(word) for word in command], cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    warnings = [line for line in done.stdout.splitlines() if "warning" in line.lower() or line.startswith("error:")]
    if done.returncode != 0 or warnings:
        sys.exit("\n".join(warnings or done.stdout.splitlines()[-20:]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dist", type=pathlib.Path, required=True, help="where the wheel is")
    dist = parser.parse_args().dist
    wheels = sorted(dist.glob("pointfair-*.whl"))
    if len(wheels) != 1:
        parser.error(f"{dist} holds {len(wheels)} wheels of pointfair; name a folder that holds one")
    wheel = wheels[0]
    WORK.mkdir(parents=True, exist_ok=True)
    tools = make_tools(wheel.resolve())
    run("doxygen", "scripts/Doxyfile")
    run(tools / "mkdocs", "build", "--clean")
    print(WORK / "site/index.html")


main()
