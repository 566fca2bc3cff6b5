#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures how much noise is left on simulated scans whose true surface is known: pointfair with default parameters, and the smoothers of
Open3D and PyMeshLab at their defaults and at a small sweep of neighbourhoods, of which the best counts, chosen with the truth in hand.

    bench/scans.py [CLOUDS] [--names NAME..] [--peers none|open3d|pymeshlab|all]

CLOUDS (default: $POINTFAIR_DATA/simulated) holds NAME.ply, the scan; NAME.npz with `scene`, the name of the true mesh in
CLOUDS/meshes, `part`, the part of the scene that each point is of, `names` of the parts, and `mixed`, points that lie on no surface; and
meshes/SCENE.ply. Mixed points and leaves are not measured.

A row a cloud: mean distance of the points to the true surface, in thousandths of the unit (mm), of the scan, of what pointfair leaves, of
what the best peer leaves; and the same of points near an edge, where two true normals within two spacings differ by 40 degrees or more.
Peers that know no noise get neighbourhoods of 8 to 480 points. Needs NumPy, SciPy, Open3D and PyMeshLab from PyPI; minutes a cloud with all
peers. Each result is kept in FOLDER/scans.jsonl as it comes. --write puts the table between the marks <!-- quality scans of simulated sensors --> and <!-- end -->.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

from quality_tables import put, table
from smoothers import METHODS

EDGE_COSINE = math.cos(math.radians(40))
MEASURED = 50_000


def read(path):
    return np.asarray(o3d.t.io.read_point_cloud(str(path)).point.positions.numpy(), np.float32)


class Scan:
    """A scan, and how far points lie from its true surface."""

    def __init__(self, path):
        truth = np.load(path.with_suffix(".npz"))
        names = [str(name) for name in truth["names"]]
        self.path, self.name, self.points = path, path.stem, read(path)
        self.surface = o3d.t.geometry.RaycastingScene()
        self.surface.add_triangles(o3d.t.io.read_triangle_mesh(str(path.parent / "meshes" / f"{truth['scene']}.ply")))
        sound = ~truth["mixed"] & ~np.isin(truth["part"], [i for i, name in enumerate(names) if name == "leaf"])
        chosen = np.random.default_rng(1).permutation(len(self.points))[:MEASURED]
        self.measured = np.sort(chosen[sound[chosen]])
        self.tree = cKDTree(self.points)
        self.spacing = float(np.median(self.tree.query(self.points[self.measured], 7)[0][:, 1:].mean(1)))
        self.at_edge = self._near_edges()

    def _near_edges(self):
        """Of the measured points: whether true normals around differ by much."""
        normals = self.surface.compute_closest_points(self.points)["primitive_normals"].numpy()
        near = self.tree.query(self.points[self.measured], 12, distance_upper_bound=2 * self.spacing)[1]
        known = near < len(self.points)
        cosines = np.einsum("nij,nj->ni", normals[np.where(known, near, 0)], normals[self.measured])
        return (known & (np.abs(cosines) < EDGE_COSINE)).any(1)

    def left(self, points):
        """Mean distances to the surface, and near edges."""
        at = np.where(np.isfinite(points), points, self.points)[self.measured].astype(np.float32)
        distances = self.surface.compute_distance(at).numpy()
        return float(distances.mean()), float(distances[self.at_edge].mean()) if self.at_edge.any() else math.nan


def by_pointfair(program):
    def run(scan):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "out.ply"
            subprocess.run([program, "run", scan.path, out, "-q"], check=True)
            return read(out)
    return run


def by_peer(method, settings):
    return lambda scan: method.prepare(scan.points, **settings)()


def peers_of(package):
    """{name: function}, at the defaults and at each setting of the sweep."""
    methods = [method for name, method in METHODS.items() if name.startswith(package)]
    return {" ".join([method.title, *(f"{name} {value}" for name, value in settings.items())]): by_peer(method, settings)
            for method in methods for settings in ({}, *method.sweep)}


def contenders(options):
    runs = {"pointfair": by_pointfair(options.program)}
    for package in ("open3d", "pymeshlab"):
        if options.peers in (package, "all"):
            runs.update(peers_of(package))
    return runs


def measure(paths, runs, kept):
    """{(cloud, contender): (mean, near edges)}; contenders are measured where `kept` does not have them, but pointfair always."""
    known = {}
    if kept.exists():
        for line in kept.read_text().splitlines():
            row = json.loads(line)
            known[row["cloud"], row["by"]] = tuple(row["left"])
    for path in paths:
        scan = Scan(path)
        results = {"the scan": lambda scan: scan.points, **runs}
        for by, run in results.items():
            if (scan.name, by) in known and by != "pointfair":
                continue
            known[scan.name, by] = left = scan.left(np.asarray(run(scan)))
            with kept.open("a") as file:
                print(json.dumps({"cloud": scan.name, "by": by, "left": left}), file=file)
        print(scan.name, file=sys.stderr, flush=True)
    return known


def report(paths, known):
    rows, least, logs = [], 0, []
    for path in paths:
        its = {by: left for (cloud, by), left in known.items() if cloud == path.stem}
        noisy, ours = its.pop("the scan"), its.pop("pointfair")
        name, best = min(its.items(), key=lambda item: item[1][0]) if its else ("", (math.nan, math.nan))
        texts = [["" if math.isnan(value[i]) else f"{1000 * value[i]:.3g}" for value in (noisy, ours, best)] for i in range(2)]
        rows.append([path.stem, *texts[0], name, *texts[1]] if its else [path.stem, *texts[0][:2], *texts[1][:2]])
        least += not ours[0] > best[0]
        logs.append(math.log(ours[0] / noisy[0]) if noisy[0] > 1e-5 and ours[0] > 0 else None)
    noisy_ones = [log for log in logs if log is not None]
    mean = math.exp(sum(noisy_ones) / len(noisy_ones)) if noisy_ones else math.nan
    of_peers = "; default parameters, and the best of the peers' settings" if its else "; default parameters"
    wins = f" pointfair leaves least on {least} of {len(rows)}." if its else ""
    header = (["scan", "noisy", "pointfair", "best peer", "which", "near edges: noisy", "pointfair", "that peer"] if its
              else ["scan", "noisy", "pointfair", "near edges: noisy", "pointfair"])
    return (f"Mean distance to the true surface, mm{of_peers}.{wins} Geometric mean of what pointfair leaves over the scan's: {mean:.3f}\n\n"
            + table(header, rows))


def main():
    root = Path(__file__).resolve().parent.parent
    default = Path(os.environ["POINTFAIR_DATA"]) / "simulated" if "POINTFAIR_DATA" in os.environ else None
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clouds", nargs="?", type=Path, default=default)
    parser.add_argument("--names", nargs="*", help="of clouds (default: all)")
    parser.add_argument("--peers", choices=("none", "open3d", "pymeshlab", "all"), default="all")
    parser.add_argument("--program", default=root / "build/bin/pointfair")
    parser.add_argument("--folder", type=Path, default=root / "build", help="for results (default: build)")
    parser.add_argument("--write", type=Path, metavar="PAGE")
    options = parser.parse_args()
    if options.clouds is None or not options.clouds.is_dir():
        print("no simulated scans: give their folder, or set POINTFAIR_DATA", file=sys.stderr)
        return
    paths = [path for path in sorted(options.clouds.glob("*.npz")) if not options.names or path.stem in options.names]
    paths = [path.with_suffix(".ply") for path in paths if path.with_suffix(".ply").exists()]
    put(options.write, "scans of simulated sensors", report(paths, measure(paths, contenders(options), options.folder / "scans.jsonl")))


if __name__ == "__main__":
    main()
