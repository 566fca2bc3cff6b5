#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Installs the wheel, or of several each one's own, into fresh environments, without a compiler, and runs the tests there.

    tests/python/run.py --dist build/python/dist --work build/python/tests [--program build/bin/pointfair] [--integrations]

The whole suite runs on the Python that runs this; every other CPython from 3.10 on that is found (python3.N, pyenv's, and
those of POINTFAIR_PYTHONS, separated by ':') installs the wheel, runs the examples of the documentation and removes it
again. Ends with 77 where packages cannot be installed."""
import argparse
import os
import pathlib
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ASK = "import sys; print(sys.implementation.name, *sys.version_info[:2], sys.executable)"


def version_of(python):
    """(3, N) of a CPython that works, or None."""
    try:
        done = subprocess.run([python, "-c", ASK], capture_output=True, text=True)
    except OSError:
        return None
    words = done.stdout.split()
    return (int(words[1]), int(words[2])) if done.returncode == 0 and words[0] == "cpython" else None


def candidates():
    yield from filter(None, os.environ.get("POINTFAIR_PYTHONS", "").split(":"))
    yield from (f"python3.{minor}" for minor in range(10, 20))
    if shutil.which("pyenv"):
        root = subprocess.run(["pyenv", "root"], capture_output=True, text=True).stdout.strip()
        yield from map(str, pathlib.Path(root).glob("versions/*/bin/python"))


def other_pythons():
    """One for each version but this one's."""
    found = {sys.version_info[:2]: sys.executable}
    for python in candidates():
        version = version_of(python)
        if version and version >= (3, 10):
            found.setdefault(version, python)
    del found[sys.version_info[:2]]
    return dict(sorted(found.items()))


def wheel_for(version, wheels):
    """Of wheels for this machine, the one that a CPython of this version takes; None."""
    for wheel in wheels:
        python, abi, platform = wheel.stem.split("-")[2:5]
        its = (int(python[2]), int(python[3:]))
        if "linux" in platform and platform.endswith(os.uname().machine) and (its == version or abi == "abi3" and its < version):
            return wheel
    return None


def environment():
    """Without a compiler, and without what the caller's Python has."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return {**kept, "CC": "/nonexistent", "CXX": "/nonexistent"}


def call(*command, **options):
    return subprocess.run([str(part) for part in command], env={**environment(), **options.pop("env", {})}, **options)


def make_environment(folder, python, wheel, *more):
    """A fresh environment with the wheel; its programs' folder. The packages come from where pip is set up to look."""
    shutil.rmtree(folder, ignore_errors=True)
    call(python, "-m", "venv", folder, check=True)
    pip = [folder / "bin/python", "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    if call(*pip, "numpy", "nanobind-backend", *more).returncode != 0:
        print(f"skipped: the packages of the tests cannot be installed for {python}")
        sys.exit(77)
    call(*pip, "--only-binary", ":all:", wheel, check=True)
    return folder / "bin"


def files_of(folder):
    return {path.relative_to(folder) for path in folder.rglob("*") if "__pycache__" not in path.parts}


def check_uninstall(folder, wheel):
    """What pip installs for the wheel is gone after pip removes it."""
    pip = [folder / "bin/python", "-m", "pip", "--disable-pip-version-check", "--quiet"]
    call(*pip, "uninstall", "--yes", "pointfair", check=True)
    without = files_of(folder)
    call(*pip, "install", "--no-deps", wheel, check=True)
    call(folder / "bin/python", "-c", "import pointfair", check=True)
    call(*pip, "uninstall", "--yes", "pointfair", check=True)
    left = files_of(folder) - without
    if left or any("pointfair" in str(path) for path in without):
        sys.exit(f"pip uninstall leaves {sorted(map(str, left))[:5]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dist", type=pathlib.Path, required=True, help="where the wheel is")
    parser.add_argument("--work", type=pathlib.Path, required=True, help="a folder for the environments")
    parser.add_argument("--program", type=pathlib.Path, help="the build's own pointfair, whose results must be the same")
    parser.add_argument("--integrations", action="store_true", help="the tests of the add-on for Blender, with bpy of PyPI (370 MB), and of the provider for QGIS, alone")
    args, more = parser.parse_known_args()
    # the highest version first: a wheel for one version is closer to it than one for all from an older one on
    wheels = sorted(args.dist.glob("pointfair-*.whl"), key=lambda path: int(path.name.split("-cp3")[1].split("-")[0]), reverse=True)
    wheel = wheel_for(sys.version_info[:2], wheels)
    if not wheel:
        print("skipped: there is no wheel for this Python; python.wheel makes one")
        sys.exit(77)
    pytest = ["-m", "pytest", "-c", HERE.parent.parent / "pyproject.toml", "--rootdir", HERE, "-p", "no:cacheprovider"]
    if args.integrations:
        programs = make_environment(args.work / "integrations", sys.executable, wheel, "bpy", "pytest")
        call(programs / "python", *pytest, HERE / "test_blender.py", HERE / "test_qgis.py", *more, check=True)
        return
    programs = make_environment(args.work / "whole", sys.executable, wheel, "-r", HERE / "requirements.txt")
    variables = {"POINTFAIR_BIN": str(args.program.resolve())} if args.program else {}
    call(programs / "python", *pytest, HERE, *more, env=variables, check=True)
    call(programs / "python", "-m", "pytest", "-q", "-p", "no:cacheprovider", "--doctest-modules",
         "--doctest-ignore-import-errors", "--pyargs", "pointfair",
         cwd=args.work, check=True)
    check_uninstall(args.work / "whole", wheel)
    for version, python in other_pythons().items():
        wheel = wheel_for(version, wheels)
        if not wheel:
            print(f"CPython {version[0]}.{version[1]}: no wheel for it")
            continue
        folder = args.work / "python{}.{}".format(*version)
        programs = make_environment(folder, python, wheel)
        call(programs / "python", "-m", "doctest", HERE / "every_python.txt", check=True)
        call(programs / "pointfair", "--version", check=True, stdout=subprocess.DEVNULL)
        print(f"CPython {version[0]}.{version[1]} runs {wheel.name}")


main()
