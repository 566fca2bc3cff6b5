# SPDX-License-Identifier: Apache-2.0
"""Clouds and results on disk, so that a comparison costs only what changed. All of it may be deleted at any time."""
import functools
import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import tempfile
import time

import numpy as np

import cloud as clouds
import families
import objects

FOLDER = pathlib.Path(__file__).resolve().parent.parent / "build/training"
JUDGES = ("judge.py", "measure.py", "cases.py", "case_clouds.py", "tables.py", "store.py", "switches.py")   # these change no cloud
PROGRAM_SECONDS = 300


def digest(*parts: bytes) -> str:
    return hashlib.sha256(b"\0".join(parts)).hexdigest()[:12]


@functools.cache
def generator_version() -> str:
    """Of the files that make clouds, and of the folder of meshes."""
    sources = sorted(path for path in pathlib.Path(__file__).parent.glob("*.py")
                     if path.name not in JUDGES and not path.name.startswith("test_"))
    meshes = " ".join(path.name for path in objects.mesh_files())
    return digest(meshes.encode(), *(path.read_bytes() for path in [*sources, pathlib.Path(__file__).with_name("rays.cpp")]))


@functools.cache
def program_version(program: pathlib.Path) -> str:
    return digest(pathlib.Path(program).read_bytes())


def forget_old_clouds() -> None:
    """Removes the clouds of other versions of the generator to which nothing came for a day."""
    for folder in (FOLDER / "clouds").glob("*"):
        if folder.name != generator_version() and time.time() - folder.stat().st_mtime > 86400:
            shutil.rmtree(folder, ignore_errors=True)


def cloud_path(family: str, seed: int) -> pathlib.Path:
    return FOLDER / "clouds" / generator_version() / f"{family}-{seed}"


def stored_cloud(family: str, seed: int) -> clouds.Cloud:
    """Drawn, or read where it was drawn before."""
    path = cloud_path(family, seed)
    if path.with_suffix(".npz").exists():
        return clouds.load(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn = families.draw(family, seed)
    drawn.save(path)
    return drawn


def stored(key: str, make) -> dict:
    """The result of this name, or what make() gives, kept as JSON."""
    path = FOLDER / "results" / f"{key}.json"
    if path.exists():
        return json.loads(path.read_text())
    result = make()
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(f".{time.monotonic_ns()}")
    unfinished.write_text(json.dumps(result))
    unfinished.replace(path)
    return result


class ProgramFailed(Exception):
    """With what the program said."""


def run_program(program: pathlib.Path, ply: pathlib.Path, options: list[str]) -> tuple[np.ndarray, dict, dict, str]:
    """Points, the other attributes, the report, and what was said on standard error."""
    with tempfile.TemporaryDirectory() as folder:
        out, report = f"{folder}/out.ply", f"{folder}/report.json"
        command = [str(program), "run", str(ply), out, "--force", "--threads", "1", "--progress", "none", "--write-noise",
                   "--report", report, *options]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=PROGRAM_SECONDS)
        except subprocess.TimeoutExpired as late:
            raise ProgramFailed(f"not done after {PROGRAM_SECONDS} s") from late
        if done.returncode:
            said = re.sub(r"\s+", " ", done.stderr).strip()
            raise ProgramFailed(f"exit status {done.returncode}: {said[-300:]}")
        points, attributes = clouds.read_ply(out)
        return points, attributes, json.loads(pathlib.Path(report).read_text()), done.stdout + done.stderr
