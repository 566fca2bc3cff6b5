# SPDX-License-Identifier: Apache-2.0
"""The package and what its documentation shows are clean under `mypy --strict`."""
import pathlib
import subprocess
import sys

import pytest

pytest.importorskip("mypy")
EXAMPLES = sorted(pathlib.Path(__file__).parents[2].joinpath("examples/python").glob("*.py"))


def mypy(*arguments, cwd):
    return subprocess.run([sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(cwd / "cache"), *map(str, arguments)],
                          capture_output=True, text=True, cwd=cwd)


def test_the_package(tmp_path):
    done = mypy("-p", "pointfair", cwd=tmp_path)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.name)
def test_an_example(tmp_path, example):
    done = mypy("--ignore-missing-imports", example, cwd=tmp_path)
    assert done.returncode == 0, done.stdout


def test_wrong_uses_are_found(tmp_path):
    (tmp_path / "wrong.py").write_text(
        "import numpy as np\nimport pointfair as pf\n"
        "points = np.zeros((5, 3))\n"
        "pf.denoise(points, k='x')\n"             # 4
        "pf.denoise(points, method='magic')\n"    # 5
        "pf.denoise(points, sigma=3)\n"           # 6
        "a, b = pf.denoise(points)\n"             # 7: unpacking rows is no error; the next line is
        "c: int = pf.denoise(points)\n"           # 8
        "out, report = pf.denoise(points, return_report=True)\n"
        "report.unmoved.strays\n")                # 10
    done = mypy("wrong.py", cwd=tmp_path)
    lines = {int(line.split(":")[1]) for line in done.stdout.splitlines() if ": error:" in line}
    assert {4, 5, 6, 8, 10} <= lines and 9 not in lines, done.stdout
