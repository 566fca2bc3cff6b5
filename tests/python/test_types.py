# SPDX-License-Identifier: Apache-2.0
"""The package and its examples are clean under `mypy --strict`, and wrong uses are found."""
import pathlib
import subprocess
import sys

import pytest

pytest.importorskip("mypy")
EXAMPLES = sorted(pathlib.Path(__file__).parents[2].joinpath("examples/python").glob("*.py"))


@pytest.fixture(scope="module")
def mypy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mypy")

    def run(*arguments):
        command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", folder / "cache", *arguments]
        return subprocess.run([str(word) for word in command], capture_output=True, text=True, cwd=folder)

    return run


def test_the_package(mypy):
    done = mypy("-p", "pointfair")
    assert done.returncode == 0, done.stdout


def test_the_examples(mypy):
    assert len(EXAMPLES) > 5
    done = mypy("--ignore-missing-imports", *EXAMPLES)
    assert done.returncode == 0, done.stdout


def test_wrong_uses_are_found(mypy, tmp_path):
    (tmp_path / "wrong.py").write_text(
        "import numpy as np\nimport pointfair as pf\n"
        "points = np.zeros((5, 3))\n"
        "pf.denoise(points, k='x')\n"             # line 4
        "pf.denoise(points, method='magic')\n"    # 5
        "pf.denoise(points, sigma=3)\n"           # 6
        "good = pf.denoise(points, k=8, radius='2s', constraint=True)\n"
        "count: int = pf.denoise(points)\n"       # 8
        "out, report = pf.denoise(points, return_report=True)\n"
        "report.unmoved.strays\n"                 # 10
        "flag: bool = bool(len(points))\n"
        "both = pf.denoise(points, return_report=flag)\n"
        "many = pf.denoise_batch([points], return_report=flag)\n"
        "pipeline = pf.Pipeline('cpu')\n"
        "pipeline.load(points)\n"
        "count = pipeline.run(k=8)\n"             # 16
        "pipeline.run(k=8).shape, pipeline.run(k='x')\n"  # 17
        "clouds = pf.Pipeline[pf.Cloud]('cpu')\n"
        "clouds.load(points)\n"                   # 19
        "clouds.run().write('out.ply')\n"
        "pipeline.run(step=lambda points, neighbors, normals, noise: points)\n"
        "pipeline.run(step='mean')\n")  # 22
    done = mypy(tmp_path / "wrong.py")
    lines = {int(line.split(":")[1]) for line in done.stdout.splitlines() if ": error:" in line}
    assert lines == {4, 5, 6, 8, 10, 16, 17, 19, 22}, done.stdout
