# SPDX-License-Identifier: Apache-2.0
"""Under `mypy --strict` and pyright the package and its examples are clean, all that is public has a type, and wrong uses are found."""
import json
import os
import pathlib
import shutil
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


WRONG = (
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
WRONG_LINES = {4, 5, 6, 8, 10, 16, 17, 19, 22}


def test_wrong_uses_are_found(mypy, tmp_path):
    (tmp_path / "wrong.py").write_text(WRONG)
    done = mypy(tmp_path / "wrong.py")
    lines = {int(line.split(":")[1]) for line in done.stdout.splitlines() if ": error:" in line}
    assert lines == WRONG_LINES, done.stdout


@pytest.fixture
def pyright(tmp_path):
    """Checks the files of tmp_path. The package on PyPI fetches the program from npm when it is first called."""
    pytest.importorskip("pyright")
    command = [sys.executable, "-m", "pyright", "--outputjson"]
    path = f"{pathlib.Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # it looks for packages of that Python

    def run(*words, **settings):
        (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
        done = subprocess.run([*command, *words], capture_output=True, text=True, cwd=tmp_path, env={**os.environ, "PATH": path})
        return json.loads(done.stdout)

    if subprocess.run([*command, "--version"], capture_output=True, cwd=tmp_path).returncode != 0:
        pytest.skip("pyright cannot be fetched")
    return run


def errors(found):
    """File, line and message of each."""
    return {(pathlib.Path(one["file"]).name, one["range"]["start"]["line"] + 1, one["message"])
            for one in found["generalDiagnostics"] if one["severity"] == "error"}


def test_all_that_is_public_has_a_type(pyright):
    symbols = pyright("--verifytypes", "pointfair", "--ignoreexternal")["typeCompleteness"]["symbols"]
    public = [one for one in symbols if one["isExported"]]
    assert len(public) > 20
    assert [one["name"] for one in symbols if not one["isTypeKnown"]] == []


def test_pyright_takes_the_examples(pyright, tmp_path):
    for example in EXAMPLES:
        shutil.copy(example, tmp_path)
    found = pyright(reportMissingImports=False, reportMissingModuleSource=False)
    assert found["summary"]["filesAnalyzed"] == len(EXAMPLES)
    assert errors(found) == set()


def test_strict_pyright_finds_wrong_uses_and_no_others(pyright, tmp_path):
    (tmp_path / "wrong.py").write_text(WRONG)
    found = errors(pyright(typeCheckingMode="strict", reportUnusedExpression=False))
    assert {line for _, line, _ in found} == WRONG_LINES, found
