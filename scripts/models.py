#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""models.py FOLDER: puts the models of Debian's libcgal-demo that the demo, the figures and the paper's
tables use into the folder: meshes, armadillo.off, dragon.off and fandisk.off, and scans, hippo.ply and building.ply."""
import fcntl
import pathlib
import subprocess
import sys
import tarfile
import tempfile

ARCHIVE = "usr/share/doc/libcgal-demo/data.tar.gz"
MODELS = {
    "armadillo.off": "data/meshes/armadillo.off",
    "dragon.off": "data/meshes/ChineseDragon-10kv.off",
    "fandisk.off": "data/meshes/fandisk.off",
    "hippo.ply": "data/points_3/hippo1.ply",
    "building.ply": "data/points_3/building.ply",
}


def extract(archive, folder):
    """Each is there once it is whole, and all others are once the last is: tests run side by side and look for that one."""
    with tarfile.open(archive) as tar:
        for name, member in MODELS.items():
            unfinished = folder / f"{name}.unfinished"
            unfinished.write_bytes(tar.extractfile(member).read())
            unfinished.replace(folder / name)


def fetch(folder):
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / ".lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        fetch_alone(folder)


def fetch_alone(folder):
    if all((folder / name).exists() for name in MODELS):
        return
    if (pathlib.Path("/") / ARCHIVE).exists():
        return extract(pathlib.Path("/") / ARCHIVE, folder)
    # container images often leave /usr/share/doc out of every package; the package itself still holds it
    with tempfile.TemporaryDirectory() as work:
        print("The models are not in /usr/share/doc here: downloading the package libcgal-demo")
        subprocess.run(["apt-get", "download", "-q", "libcgal-demo"], cwd=work, check=True)
        package = next(pathlib.Path(work).glob("*.deb"))
        subprocess.run(["dpkg-deb", "-x", package, work], check=True)
        extract(pathlib.Path(work) / ARCHIVE, folder)


if __name__ == "__main__":
    fetch(pathlib.Path(sys.argv[1]))
