#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What an extension for Windows is compiled and linked with, where there is no Python for Windows: this machine's headers of
CPython with the configuration of cmake/windows/pyconfig.h, and the import library of python3.dll, made from the list of names
of the stable interface. An extension that uses another name is not linked.

    windows_python.py HEADERS ZIG INTO       by the Python of tools.txt; INTO/include and INTO/python3.lib
"""
import pathlib
import shutil
import subprocess
import sys

import abi3info
from abi3info.models import PyVersion

VERSION = PyVersion(3, 12)  # the oldest that the extension is for
CONFIGURATION = pathlib.Path(__file__).resolve().parents[2] / "cmake/windows/pyconfig.h"


def names(entries, suffix=""):
    """Those that the DLL of VERSION has."""
    return [f"{symbol.name}{suffix}" for symbol, entry in entries.items()
            if entry.added <= VERSION and (entry.ifdef is None or entry.ifdef.windows is True)]


def main(headers, zig, into):
    into = pathlib.Path(into)
    shutil.rmtree(into, ignore_errors=True)
    shutil.copytree(headers, into / "include")
    shutil.copyfile(CONFIGURATION, into / "include/pyconfig.h")
    exported = ["LIBRARY python3.dll", "EXPORTS", *names(abi3info.FUNCTIONS), *names(abi3info.DATAS, " DATA")]
    (into / "python3.def").write_text("\n".join(exported) + "\n")
    subprocess.run([zig, "dlltool", "-m", "i386:x86-64", "-d", into / "python3.def", "-l", into / "python3.lib"], check=True)
    # CMake looks for the library of one version, too, which nothing is linked with
    shutil.copyfile(into / "python3.lib", into / "python312.lib")


main(*sys.argv[1:])
