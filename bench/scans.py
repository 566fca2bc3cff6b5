#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures how much noise is left on simulated scans whose true surface is known: pointfair with nothing set, and the smoothers of
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

SIZES = (8, 30, 120, 480)
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


def as_open3d(scan):
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(scan.points.astype(float)))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
    return cloud


def open3d_smoothers():
    """{name: function}, each at its defaults where these do not depend on the unit of length, and the sweep."""
    def of(call):
        return lambda scan: np.asarray(call(as_open3d(scan), scan).points)

    runs = {"Open3D Laplacian": of(lambda cloud, _: cloud.smooth_laplacian()), "Open3D Taubin": of(lambda cloud, _: cloud.smooth_taubin())}
    for k in SIZES:
        search = o3d.geometry.KDTreeSearchParamKNN(k)
        runs[f"Open3D MLS {k}"] = of(lambda cloud, _, search=search: cloud.smooth_mls(search))
        if k > 200:
            continue
        for width in (1, 3):
            runs[f"Open3D bilateral {k}, {width} spacings"] = of(
                lambda cloud, scan, search=search, width=width: cloud.smooth_bilateral(search, width * scan.spacing, width * scan.spacing / 3))
    for iterations in (1, 3):
        runs[f"Open3D Laplacian {iterations}"] = of(lambda cloud, _, i=iterations: cloud.smooth_laplacian(i))
        runs[f"Open3D Taubin {iterations}"] = of(lambda cloud, _, i=iterations: cloud.smooth_taubin(i))
    return runs


def pymeshlab_smoothers():
    import pymeshlab

    def of(name, scale):
        def run(scan):
            meshes = pymeshlab.MeshSet(verbose=False)
            meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=scan.points.astype(float)))
            meshes.compute_normal_for_point_clouds(k=16)
            of_scan = meshes.current_mesh()
            meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=of_scan.vertex_matrix(), v_normals_matrix=of_scan.vertex_normal_matrix()))
            getattr(meshes, name)(controlmesh=1, proxymesh=0, filterscale=scale)
            return meshes.mesh(0).vertex_matrix()
        return run

    filters = {"APSS": "compute_mls_projection_apss", "RIMLS": "compute_mls_projection_rimls"}
    return {f"PyMeshLab {label} {scale}": of(name, scale) for label, name in filters.items() for scale in (2, 3, 5)}


def contenders(options):
    runs = {"pointfair": by_pointfair(options.program)}
    if options.peers in ("open3d", "all"):
        runs.update(open3d_smoothers())
    if options.peers in ("pymeshlab", "all"):
        runs.update(pymeshlab_smoothers())
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
    of_peers = "; nothing set, and the best of the peers' settings" if its else "; nothing set"
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
