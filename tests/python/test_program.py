# SPDX-License-Identifier: Apache-2.0
"""The program that comes with the package, and the same bits from it, from the build's own and from Python."""
import importlib.metadata
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import urllib.request

import numpy as np
import pytest
from clouds import read_ply, same_bits, waves, write_ply

import pointfair as pf

PROGRAM = pathlib.Path(sys.executable).with_name("pointfair")
PROGRAMS = [PROGRAM] + [pathlib.Path(path) for path in [os.environ.get("POINTFAIR_BIN")] if path]


def run(program, *words, **options):
    return subprocess.run([str(program), *map(str, words)], capture_output=True, text=True, **options)


def test_what_pip_starts_on_windows_runs_the_program(tmp_path):
    start = "import sys; from pointfair._program import main; sys.exit(main())"
    for words in (["--version"], ["run", tmp_path / "missing.ply", tmp_path / "out.ply"], ["cluster", "--help"]):
        through, expected = run(sys.executable, "-c", start, *words), run(PROGRAM, *words)
        assert (through.returncode, through.stdout, through.stderr) == (expected.returncode, expected.stdout, expected.stderr)


def test_python_m_pointfair_is_the_program(tmp_path):
    for words in (["--version"], ["run", tmp_path / "missing.ply", tmp_path / "out.ply"], ["cluster", "--help"]):
        through, expected = run(sys.executable, "-m", "pointfair", *words), run(PROGRAM, *words)
        assert (through.returncode, through.stdout, through.stderr) == (expected.returncode, expected.stdout, expected.stderr)


@pytest.mark.skipif(not shutil.which("dpkg"), reason="the licences are those of Debian's packages")
def test_the_wheel_has_the_licences_of_what_it_holds():
    files = importlib.metadata.files("pointfair")
    licenses = {file.stem: file.read_text() for file in files if "licenses" in file.parts}
    needs = (pathlib.Path(__file__).parents[2] / "cmake/dependencies.cmake").read_text().split("if(POINTFAIR_TESTS)")[0]
    page = {"three.js"} if any("share" in file.parts for file in files) else set()
    assert {"LICENSE", "nanobind", *page, *re.findall(r"^ *pointfair_need\((\w+)", needs, re.M)} <= licenses.keys()
    assert all(len(text) > 500 for text in licenses.values())
    # what auditwheel puts beside the module: libtbb-1b2c3d.so.12
    bundled = {re.match("lib([a-z]+)", file.name)[1] for file in files if file.parts[0] == "pointfair.libs"}
    assert bundled <= {name.lower() for name in licenses}


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("centre", [(0, 0, 0), (500000.1, 5.8e6, 120)])
@pytest.mark.parametrize("parameters", [{}, {"k": 12, "iterations": 2}, {"radius": "3s", "outliers": "move"}, {"strength": 0.25}])
def test_python_gives_the_bits_of_the_program(tmp_path, program, dtype, centre, parameters):
    xyz = waves(4000, dtype=dtype, centre=centre)
    xyz[5] = np.nan
    write_ply(tmp_path / "in.ply", xyz)
    flags = [word for name, value in parameters.items() for word in (f"--{name.replace('_', '-')}", value)]
    done = run(program, "run", tmp_path / "in.ply", tmp_path / "out.ply", "--device", "cpu", *flags)
    assert done.returncode == 0, done.stderr
    expected = read_ply(tmp_path / "out.ply", dtype)
    assert (expected != xyz).any()
    assert same_bits(pf.denoise(xyz, device="cpu", **parameters), expected)
    assert same_bits(pf.denoise(pf.Cloud(xyz), device="cpu", **parameters).xyz, expected)


@pytest.mark.parametrize("offset", [(0, 0, 0), (5e5, 5.4e6, 100)])
@pytest.mark.parametrize("extent", [1e4, 1e5, 1e6, 1e7])
def test_clouds_too_wide_for_floats_have_the_bits_of_the_program(tmp_path, extent, offset):
    """Ten patches with a spacing of 1, as far apart as `extent`."""
    rng = np.random.default_rng(1)
    across = rng.uniform(0, 40, (10, 1600, 2)) + rng.uniform(0, extent, (10, 1, 2))
    x, y = across.reshape(-1, 2).T
    points = np.stack([x, y, 3 * np.sin(x / 9) + 2 * np.cos(y / 11) + rng.normal(0, .3, x.shape)], 1) + offset
    pf.write(tmp_path / "in.ply", points)
    done = run(PROGRAMS[0], "run", tmp_path / "in.ply", tmp_path / "out.ply", "--device", "cpu")
    assert done.returncode == 0, done.stderr
    of_program = pf.read(tmp_path / "out.ply").xyz
    assert same_bits(of_program, pf.denoise(points, device="cpu"))
    assert same_bits(of_program, pf.read(tmp_path / "in.ply").denoise(device="cpu").xyz)
    assert np.abs(of_program - points).mean() > .05


def test_the_program_passes_on_words_and_exit_codes(tmp_path):
    assert re.fullmatch(r"pointfair [0-9.]+\n", run(PROGRAM, "--version").stdout)
    assert run(PROGRAM, "run", tmp_path / "no.ply", tmp_path / "out.ply").returncode == 3
    assert run(PROGRAM, "run", "--no-such-flag").returncode == 2
    assert run(PROGRAM, "--version").stdout.split()[1] == pf.__version__


def test_view_serves_its_page(tmp_path):
    write_ply(tmp_path / "in.ply", waves())
    viewer = subprocess.Popen([PROGRAM, "view", tmp_path / "in.ply", "--no-open", "--port", "0"], stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
    try:
        address = None
        for line in viewer.stdout:
            address = re.search(r"http://\S+", line)
            if address:
                break
        assert address
        page = urllib.request.urlopen(address.group(), timeout=20).read().decode()
        assert "<script" in page
    finally:
        viewer.send_signal(signal.SIGTERM)
        viewer.wait(20)
        viewer.stdout.close()
