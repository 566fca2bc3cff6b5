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


def test_a_file_of_a_store_that_changed_is_copied_again_or_refused(client, source, tmp_path):
    work, address, out = tmp_path / "work", f"file://{source}", f"file://{tmp_path}/store.ply"
    words = {"work": str(work), "tiles": 3, "program": PROGRAM}
    with pytest.raises(pointfair.UsageError, match="k"):  # after the copy, before the plan
        pointfair.cluster.denoise(client, address, out, k=-3, retries=0, **words)
    before = source.read_bytes()
    assert (work / "inputs" / source.name).read_bytes() == before
    source.write_bytes(before[:-12] + struct.pack("<3f", 0.5, 0.5, 0.001))
    pointfair.cluster.denoise(client, address, out, **words)
    subprocess.run([PROGRAM, "run", source, tmp_path / "now.ply", "-q"], check=True)
    assert (tmp_path / "store.ply").read_bytes() == (tmp_path / "now.ply").read_bytes()
    pointfair.cluster.denoise(client, address, out, force=True, **words)  # goes on, as nothing has changed
    source.write_bytes(before)
    with pytest.raises(pointfair.FileError, match="in.ply: has changed since this run was planned; plan it again in another"):
        pointfair.cluster.denoise(client, address, out, force=True, retries=0, **words)
    assert (tmp_path / "store.ply").read_bytes() == (tmp_path / "now.ply").read_bytes()


def test_the_verb_ends_with_the_codes_of_the_program(cluster, source, tmp_path):
    def code(*words):
        done = subprocess.run([sys.executable, "-m", "pointfair.cluster", cluster.scheduler_address, *map(str, words), "--work",
                               tmp_path / "work", "--program", PROGRAM, "--retries", "0"], capture_output=True, text=True)
        assert done.stderr.strip().splitlines()[-1].startswith("pointfair: "), done.stderr
        return done.returncode

    out = tmp_path / "codes.ply"
    assert code(source, "--out", out, "--k", "-3") == 2
    assert code(source, "--out", out, "--k") == 2
    assert code(tmp_path / "nothing.ply", "--out", out) == 3
    assert code(f"file://{tmp_path}/nothing.ply", "--out", out) == 3
    assert not out.exists()


def test_inputs_of_one_name_in_a_store_are_refused(client, source, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / source.name).write_bytes(source.read_bytes())
    inputs = [f"file://{source}", f"file://{tmp_path}/other/{source.name}"]
    with pytest.raises(pointfair.Error, match=f"other/{source.name}: two inputs have this name"):
        pointfair.cluster.denoise(client, inputs, output_folder=f"file://{tmp_path}/out", work=str(tmp_path / "work"),
                                  program=PROGRAM)


def test_an_input_in_a_store_is_not_replaced(client, source, tmp_path):
    before = source.read_bytes()
    work, address = str(tmp_path / "work"), f"file://{source}"
    for given in ({"output": address}, {"output": f"file://{tmp_path}/./{source.name}"},
                  {"output_folder": f"file://{tmp_path}/"}):
        with pytest.raises(pointfair.Error, match="is input and output at once; name another output"):
            pointfair.cluster.denoise(client, address, work=work, program=PROGRAM, force=True, **given)
    assert source.read_bytes() == before


def test_an_output_in_a_store_is_replaced_by_force(client, source, tmp_path):
    there = tmp_path / "out.ply"
    there.write_bytes(b"precious")
    words = {"work": str(tmp_path / "work"), "tiles": 3, "program": PROGRAM}
    with pytest.raises(pointfair.Error, match="out.ply: exists already; add --force to replace it"):
        pointfair.cluster.denoise(client, f"file://{source}", f"file://{there}", **words)
    assert there.read_bytes() == b"precious"
    for _ in range(2):  # a run that goes on replaces what it wrote
        pointfair.cluster.denoise(client, f"file://{source}", f"file://{there}", **words, force=True)
        assert there.read_bytes() == (tmp_path / "whole.ply").read_bytes()


def test_results_in_a_store_have_the_names_of_the_program(client, source, tmp_path):
    octree = tmp_path / "in.copc.laz"
    subprocess.run([PROGRAM, "run", source, octree, "--strength", "0", "-q"], check=True)
    out = tmp_path / "out"
    out.mkdir()
    pointfair.cluster.denoise(client, f"file://{octree}", output_folder=f"file://{out}", work=str(tmp_path / "work"),
                              program=PROGRAM)
    assert [file.name for file in out.iterdir()] == ["in.laz"]


def test_flags_of_the_program_are_passed_on_or_refused():
    words = ["--noise=3mm", "--force", "--strict", "--k", "8", "--closeness-sigma", "0.6r"]
    assert pointfair.cluster._flags(pointfair.cluster._parameters(words)) == \
        ["--noise", "3mm", "--force", "--strict", "--k", "8", "--closeness-sigma", "0.6r"]
    for words, line in ((["--k"], "--k: takes a value"), (["--k", "8", "b.laz"], "b.laz: is neither a flag"),
                        (["--force=yes"], "--force: takes no value")):
        with pytest.raises(pointfair.Error, match=line):
            pointfair.cluster._parameters(words)
    given = {"force": False, "strict": True, "constraint": False}
    assert pointfair.cluster._flags(given) == ["--strict", "--constraint", "off"]


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
