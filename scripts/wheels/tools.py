# SPDX-License-Identifier: Apache-2.0
"""Virtual environments with pinned packages, and commands that must not fail."""
import os
import subprocess
import sys


def follow_processors():
    """As many compilers at a time as there are processors, also under pip, unless the caller says another number: ninja alone
    starts two more, each of which may take a gigabyte."""
    os.environ.setdefault("CMAKE_BUILD_PARALLEL_LEVEL", str(len(os.sched_getaffinity(0))))


def run(*command, **options):
    if subprocess.run([str(part) for part in command], **options).returncode != 0:
        sys.exit(f"failed: {' '.join(map(str, command))}")


def make_environment(folder, requirements, python=None):
    """A virtual environment with the pinned packages; the folder of its programs."""
    done = folder / "installed"
    if not done.exists() or done.read_text() != requirements.read_text():
        run(python or sys.executable, "-m", "venv", "--clear", folder)
        run(folder / "bin/pip", "install", "--quiet", "--disable-pip-version-check", "--require-hashes", "-r", requirements)
        done.write_text(requirements.read_text())
    return folder / "bin"


def folder_of(bin_folder, module):
    """Where a module of a virtual environment is."""
    folder, = bin_folder.parent.glob(f"lib/python3*/site-packages/{module}")
    return folder
