#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Imports the module of the wheel for Windows in wine, in CPython for Windows, and compares the bytes of its results with
tests/golden/hashes.txt. Needs CPython 3.12, wine, gcc-mingw-w64-x86-64-win32, and the packages below from PyPI.

    tests/golden/wheel_in_wine.py dist build/wheels/windows-x86_64/python3.12/windows/python3.def

PyPI has no Python for Windows, but panda3d's wheel has its parts but for python.exe, python3.dll and the library in Python,
which is this Python's own. A DLL that passes each name of the stable interface on, as python3.dll does, comes from the list
that the import library was made of."""
import pathlib
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile

from wheel import check_module, run

# NumPy 2 calls functions that wine 8 lacks.
PACKAGES = """\
panda3d==1.10.16 --hash=sha256:f6493e2ecc0d1b7c1556a999556e5278cbc9484fe5fe1e159a1ccc02b870b18f
numpy==1.26.4 --hash=sha256:08beddf13648eb95f8d867350f6a018a4be2e5ad54c8d8caed89ebca558b2818
"""
PROGRAM = r"""#include <windows.h>
typedef int (*Main)(int, wchar_t**);
int wmain(int count, wchar_t** words) { return ((Main)GetProcAddress(LoadLibraryW(L"python312.dll"), "Py_Main"))(count, words); }
"""
COMPILER = "x86_64-w64-mingw32-gcc-win32"


def make_python(folder, names, wheel):
    """A Python for Windows in the folder, with NumPy and the wheel."""
    downloads = folder / "downloads"
    (folder / "packages.txt").write_text(PACKAGES)
    run(sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet", "--no-deps", "--require-hashes",
        "--only-binary", ":all:", "--platform", "win_amd64", "--python-version", "3.12", "--dest", downloads,
        "-r", folder / "packages.txt")
    (folder / "DLLs").mkdir()
    with zipfile.ZipFile(next(downloads.glob("panda3d-*.whl"))) as parts:
        for part in map(pathlib.PurePosixPath, parts.namelist()):
            if part.parent.name == "deploy_libs" and (part.suffix == ".pyd" or part.name.startswith(("python312", "libffi"))):
                where = folder if part.name.startswith("python312") else folder / "DLLs"
                (where / part.name).write_bytes(parts.read(str(part)))
    shutil.copytree(sysconfig.get_path("stdlib"), folder / "Lib",
                    ignore=shutil.ignore_patterns("lib-dynload", "site-packages", "test", "__pycache__"))
    for package in [next(downloads.glob("numpy-*.whl")), wheel]:
        zipfile.ZipFile(package).extractall(folder / "Lib/site-packages")
    exported = names.read_text().split("EXPORTS\n")[1].splitlines()
    passed_on = [f"{name} = python312.{name}" for name in (line.split()[0] for line in exported)]
    (folder / "python3.def").write_text("\n".join(["LIBRARY python3.dll", "EXPORTS", *passed_on]) + "\n")
    (folder / "nothing.c").write_text("int pointfair_nothing(void) { return 0; }\n")
    (folder / "python.c").write_text(PROGRAM)
    run(COMPILER, "-shared", folder / "nothing.c", folder / "python3.def", "-o", folder / "python3.dll")
    run(COMPILER, "-municode", "-s", folder / "python.c", "-o", folder / "python.exe")
    # wine's Python starts with pipes only
    start = folder / "python"
    program = shlex.quote(str(folder / "python.exe"))
    start.write_text(f"#!/bin/bash\nset -o pipefail\n: | WINEDEBUG=-all wine {program} -X utf8 \"$@\" 2>&1 | cat\n")
    start.chmod(0o755)
    return start


def main():
    dist, names = map(pathlib.Path, sys.argv[1:])
    if sys.version_info[:2] != (3, 12):
        sys.exit(f"{sys.argv[0]} needs CPython 3.12: its library in Python goes with python312.dll")
    wheel, = dist.glob("*-win_amd64.whl")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        folder = pathlib.Path(folder)
        python = make_python(folder, names, wheel.resolve())
        run(python, "-c", "import sys; print('CPython', sys.version)")
        check_module(python, folder)


main()
