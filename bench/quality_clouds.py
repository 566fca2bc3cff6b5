# SPDX-License-Identifier: Apache-2.0
"""The noisy clouds of bench/quality.py, and the meshes that they are made of."""
import array
import math
import subprocess
import sys
import tarfile
from dataclasses import dataclass
from pathlib import Path

SHAPE_LEVELS = (1, 2, 3)  # % of the bounding radius
MESH_LEVELS = (0.1, 0.3, 0.5)  # % of the diagonal
MESH_POINTS = 100_000


@dataclass(frozen=True)
class Case:
    """A noisy cloud and its truth."""

    column: str  # that its results are averaged in
    name: str
    source: Path  # to sample or to add noise to
    seed: int
    flags: tuple  # of `pointfair noise`
    mesh: Path
    clean: Path | None  # a cloud, for the Chamfer distance
    radius: float = 1.0


def bounding_radius(path):
    """Largest distance to the centre of the bounding box; of a binary PLY whose vertices are three floats."""
    data = path.read_bytes()
    header, _, body = data.partition(b"end_header\n")
    words = header.decode().split("\n")
    count = next(int(line.split()[2]) for line in words if line.startswith("element vertex"))
    if "format binary_little_endian 1.0" not in words:
        sys.exit(f"{path}: not a binary little-endian PLY")
    values = array.array("f", body[:12 * count])
    axes = [values[axis::3] for axis in range(3)]
    centre = [(min(axis) + max(axis)) / 2 for axis in axes]
    return math.sqrt(max(sum((v - c) ** 2 for v, c in zip(point, centre)) for point in zip(*axes)))


def shape_cases(data, names, counts, seeds):
    meshes = sorted((data / "punet_train").glob("*_mesh.ply"))
    for mesh in meshes:
        name = mesh.name.removesuffix("_mesh.ply")
        if names and name not in names:
            continue
        for count in counts:
            clean = mesh.with_name(f"{name}_{count}.ply")
            if not clean.exists():  # a mesh that comes without points
                continue
            radius = bounding_radius(clean)
            for level in SHAPE_LEVELS:
                for seed in range(1, seeds + 1):
                    yield Case(f"{count // 1000}K {level} %", f"{name}_{count}_{level}_{seed}", clean, seed,
                               ("--sigma", repr(level / 100 * radius), "--seed", seed), mesh, clean, radius)


def mesh_cases(meshes, seeds):
    for mesh in meshes:
        for density, flags in (("even", ()), ("50:1", ("--uneven", 50))):
            for level in MESH_LEVELS:
                for seed in range(1, seeds + 1):
                    yield Case(f"{mesh.stem} {density} {level} %", f"{mesh.stem}_{density.replace(':', '_')}_{level}_{seed}",
                               mesh, seed, ("--points", MESH_POINTS, "--sigma", f"{level}%", "--seed", seed, *flags), mesh, None)


def cgal_meshes(folder):
    """Unpacks the Armadillo and the fandisk from where dpkg put CGAL's demo data."""
    names = ("armadillo.off", "fandisk.off")
    if not all((folder / name).exists() for name in names):
        try:
            listed = subprocess.run(["dpkg", "-L", "libcgal-demo"], capture_output=True, text=True, check=True).stdout
            archive = next(path for path in listed.split() if path.endswith("data.tar.gz"))
        except (OSError, subprocess.CalledProcessError, StopIteration):
            sys.exit("no meshes: apt-get install libcgal-demo, or give --meshes FILE...")
        with tarfile.open(archive) as files:
            for member in files:
                if (name := member.name.rsplit("/", 1)[-1]) in names:
                    (folder / name).write_bytes(files.extractfile(member).read())
    return [folder / name for name in names]
