# SPDX-License-Identifier: Apache-2.0
"""The program pointfair, which comes with the package."""
from __future__ import annotations

import os
import subprocess
import sys

from ._errors import Error


def program_path() -> str:
    """Where the program is. Raises Error in a package that was built without it."""
    path = os.path.join(os.path.dirname(__file__), "bin", "pointfair.exe" if sys.platform == "win32" else "pointfair")
    if not os.access(path, os.X_OK):
        raise Error("this package was built without the program pointfair: build it with POINTFAIR_TOOLS=ON")
    return path


def main() -> int:
    """What `pointfair` calls on Windows, where no process becomes another: runs the program with the same words; its exit
    code."""
    if sys.argv[1:2] == ["cluster"]:
        return subprocess.call([sys.executable, "-m", "pointfair.cluster", *sys.argv[2:]])
    try:
        program = program_path()
    except Error as error:
        sys.exit(f"pointfair: {error}")
    running = subprocess.Popen([program, *sys.argv[1:]])
    while True:
        try:
            return running.wait()
        except KeyboardInterrupt:
            pass  # Ctrl-C reached the program too, which says so and ends
