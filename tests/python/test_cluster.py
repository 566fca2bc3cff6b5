# SPDX-License-Identifier: Apache-2.0
"""A run on a Dask cluster has the bits of the run in memory."""
import importlib
import os
import pathlib
import random
import struct
import subprocess
import sys
import types

import pytest

distributed = pytest.importorskip("distributed")
pytest.importorskip("fsspec")

import pointfair.cluster  # noqa: E402
from pointfair._program import program_path  # noqa: E402

PROGRAM = os.environ.get("POINTFAIR_BIN") or program_path()


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        yield cluster


@pytest.fixture
def client(cluster):
    with distributed.Client(cluster) as client:
        yield client


@pytest.fixture
def source(tmp_path):
    generator = random.Random(1)
    head = ("ply\nformat binary_little_endian 1.0\nelement vertex 20000\n"
            "property float x\nproperty float y\nproperty float z\nend_header\n").encode()
    points = b"".join(struct.pack("<3f", generator.random(), generator.random(), generator.gauss(0, 0.004))
                      for _ in range(20000))
    path = tmp_path / "in.ply"
    path.write_bytes(head + points)
    subprocess.run([PROGRAM, "run", path, tmp_path / "whole.ply", "-q"], check=True)
    return path


def denoise(client, source, folder, **more):
    return pointfair.cluster.denoise(client, str(source), str(folder / "out.ply"), work=str(folder / "work"), tiles=9,
                                     program=PROGRAM, **more)


def test_has_the_bits_of_the_run_in_memory(client, source, tmp_path):
    report = denoise(client, source, tmp_path)
    assert (tmp_path / "out.ply").read_bytes() == (tmp_path / "whole.ply").read_bytes()
    assert report["points"] == 20000 and report["tiles"] == 9


def test_files_of_a_store_are_copied(client, source, tmp_path):
    out = f"file://{tmp_path}/store.ply"
    pointfair.cluster.denoise(client, f"file://{source}", out, work=str(tmp_path / "work"), tiles=3, program=PROGRAM)
    assert (tmp_path / "store.ply").read_bytes() == (tmp_path / "whole.ply").read_bytes()


def test_a_bad_parameter_is_the_programs_own_line(client, source, tmp_path):
    with pytest.raises(pointfair.Error, match="k"):
        denoise(client, source, tmp_path, k=-3, retries=0)


@pytest.mark.parametrize("where", ["laptop", "slurm", "cards"])
def test_the_example_runs_on_each_kind_of_cluster(monkeypatch, source, tmp_path, where):
    monkeypatch.syspath_prepend(str(pathlib.Path(__file__).parents[2] / "examples/python"))
    dask_clusters = importlib.import_module("dask_clusters")

    class Local(distributed.LocalCluster):  # in place of those of other packages
        def __init__(self, *arguments, **given):
            super().__init__(n_workers=1, threads_per_worker=1, dashboard_address=None)

        def adapt(self, **bounds):
            assert bounds == {"minimum": 1, "maximum": 32}

    for module, name in (("dask_jobqueue", "SLURMCluster"), ("dask_cuda", "LocalCUDACluster")):
        monkeypatch.setitem(sys.modules, module, types.SimpleNamespace(**{name: Local}))
    monkeypatch.setitem(dask_clusters.CLUSTERS["cards"][1], "device", "cpu")
    report = dask_clusters.denoise(where, [str(source)], str(tmp_path / "out"), str(tmp_path / "work"))
    assert (tmp_path / "out" / source.name).read_bytes() == (tmp_path / "whole.ply").read_bytes()
    assert report["points"] == 20000


def test_the_program_of_the_package_has_the_verb_cluster():
    done = subprocess.run([pathlib.Path(sys.executable).with_name("pointfair"), "cluster", "--help"], capture_output=True,
                          text=True)
    assert done.returncode == 0 and done.stdout.startswith("usage: pointfair cluster ")
