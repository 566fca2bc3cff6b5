# SPDX-License-Identifier: Apache-2.0
"""Packages from PyPI that a test compares with, installed into the build folder once. A test that cannot have them ends
with exit code 77, which CTest takes for skipped."""
import fcntl
import importlib
import pathlib
import subprocess
import sys


def use(folder, requirements, modules):
    """Makes `modules` importable from `folder`, installing `requirements` (NAME==VERSION) if they are not there yet."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    sys.path.insert(0, str(folder))
    with open(folder / ".lock", "w") as lock:  # tests run side by side
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = folder / (".installed " + " ".join(requirements))
        if not done.exists():
            command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--upgrade", "--target",
                       str(folder), *requirements]
            if subprocess.run(command).returncode != 0:
                print(f"skipped: {' '.join(requirements)} cannot be installed here")
                sys.exit(77)
            done.touch()
    try:
        return [importlib.import_module(module) for module in modules]
    except ImportError as error:
        print(f"skipped: {error}")
        sys.exit(77)
