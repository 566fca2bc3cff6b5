# SPDX-License-Identifier: Apache-2.0
"""Packages from PyPI that a test compares with, installed into the build folder once, and what such tests share. A test
that cannot have its packages ends with exit code 77, which CTest takes for skipped."""
import fcntl
import importlib
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest


def use(requirements, modules):
    """Makes `modules` importable, installing `requirements` (NAME==VERSION) if they are not there yet."""
    folder = pathlib.Path(os.environ["POINTFAIR_PACKAGES"])
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


def pointfair(*words):
    done = subprocess.run([os.environ["POINTFAIR_BIN"], *map(str, words)], capture_output=True, text=True, timeout=300)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, words))}: {done.stderr}")
    return done


class InFolder(unittest.TestCase):
    """Each test has a folder of its own, `self.folder`."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
