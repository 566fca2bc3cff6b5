# SPDX-License-Identifier: Apache-2.0
"""Inputs and outputs in an S3 store, which a server on this machine stands for."""
import os
import subprocess
import sys

import pytest

pytest.importorskip("distributed")
s3fs = pytest.importorskip("s3fs")
moto_server = pytest.importorskip("moto.server")

from dask_processes import PROGRAM, Cluster, write_cloud  # noqa: E402


@pytest.fixture
def store():
    server = moto_server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield {"endpoint_url": f"http://{host}:{port}", "key": "a", "secret": "b"}
    server.stop()


def test_files_of_an_s3_store_have_the_bits_of_the_run_in_memory(tmp_path, store, monkeypatch):
    files = s3fs.S3FileSystem(**store, skip_instance_cache=True)
    files.mkdir("scans")
    for number in range(2):
        source = write_cloud(tmp_path / f"{number}.ply", 5000 + number)
        files.put(str(source), f"scans/raw/{number}.ply")
    names = [str(tmp_path / f"{number}.ply") for number in range(2)]
    subprocess.run([PROGRAM, "run", *names, "--out-dir", tmp_path / "expected", "-q"], check=True)
    environment = {f"FSSPEC_S3_{name.upper()}": value for name, value in store.items()}
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    with Cluster(tmp_path, environment=lambda number: environment) as cluster:
        done = subprocess.run([sys.executable, "-m", "pointfair.cluster", cluster.address(), "s3://scans/raw/0.ply",
                               "s3://scans/raw/1.ply", "--out-dir", "s3://scans/fair", "--work", tmp_path / "work", "--tiles", "4",
                               "--program", PROGRAM], capture_output=True, text=True, env=dict(os.environ))
        assert done.returncode == 0, done.stderr
        again = subprocess.run([sys.executable, "-m", "pointfair.cluster", cluster.address(), "s3://scans/raw/nothing.ply",
                                "--out-dir", "s3://scans/fair", "--work", tmp_path / "other", "--program", PROGRAM],
                               capture_output=True, text=True, env=dict(os.environ))
        assert again.returncode == 3, again.stderr
        line = again.stderr.strip().splitlines()[-1]
        assert line.startswith("pointfair: ") and "nothing.ply" in line, again.stderr
    for number in range(2):
        assert files.cat(f"scans/fair/{number}.ply") == (tmp_path / "expected" / f"{number}.ply").read_bytes()
    assert sorted(os.path.basename(name) for name in files.ls("scans/fair")) == ["0.ply", "1.ply"]
