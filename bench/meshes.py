# SPDX-License-Identifier: Apache-2.0
"""Meshes with known truth, noise on their vertices, and what pointfair and peers leave of it.

    python bench/meshes.py build/bin/pointfair [--noise .1 .3 .5] [--kind white correlated] [--methods NAME ...] [--peers]

Noise has a standard deviation in mean edge lengths on each axis. It is white, or correlated: white noise averaged over
the rings of vertices four times. One row for each mesh, noise and method:
distance   mean distance of the vertices to the true surface, in mean edges
normals    mean angle between faces' normals and the true ones, degrees
folds      faces whose normal is more than 90 degrees off the true one
volume     over that of the mesh without noise; - for open meshes
pymeshlab, trimesh, open3d and libigl (with scipy) are compared where they are installed, with --peers, and on quads the
smooth surface of Ni and others 2008; --sweep adds for
each the best of a small sweep, chosen for each mesh, noise and measure, and counts the rows that the default method along
the mesh loses. --table prints one row for each mesh
and noise instead, with distance, normals and folds of each method; --summary the means over all meshes, and on how many
meshes each peer and the default method along the mesh have the least distance and the least angle.
"""
import argparse
import pathlib
import subprocess
import tempfile
import time

import numpy as np

from known_meshes import MESHES, noise_of, triangles_of

POINTFAIR = {  # arguments of pointfair run
    "points": [],
    "mesh": ["--connectivity", "mesh"],
    "mesh, border moves": ["--connectivity", "mesh", "--keep-boundary", "off"],
    "mesh laplacian": ["--connectivity", "mesh", "--method", "laplacian"],
    "mesh taubin": ["--connectivity", "mesh", "--method", "taubin"],
    "mesh hc": ["--connectivity", "mesh", "--method", "hc-laplacian"],
    "mesh implicit": ["--connectivity", "mesh", "--method", "implicit"],
    "mesh, 2 rings": ["--connectivity", "mesh", "--rings", "2"],
    "mesh mollified": ["--connectivity", "mesh", "--method", "mollified"],
    "mesh fleishman": ["--connectivity", "mesh", "--method", "fleishman"],
    "mesh jones": ["--connectivity", "mesh", "--method", "jones"],
}


# --- files -----------------------------------------------------------------------------------------------------------
def write_ply(path, points, faces):
    sides = faces.shape[1]
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    rows = np.empty(len(faces), [("n", "u1"), ("v", "<i4", (sides,))])
    rows["n"], rows["v"] = sides, faces
    path.write_bytes(head.encode() + points.astype("<f4").tobytes() + rows.tobytes())


def read_points(path, count):
    data = path.read_bytes()
    begin = data.index(b"end_header\n") + len(b"end_header\n")
    return np.frombuffer(data, "<f4", 3 * count, begin).reshape(-1, 3).astype(float)


# --- measures --------------------------------------------------------------------------------------------------------
def face_normals(points, faces):
    diagonal = faces.shape[1] == 4
    a, b, c = (points[faces[:, i]] for i in range(3))
    normal = np.cross(c - a, points[faces[:, 3]] - b) if diagonal else np.cross(b - a, c - a)
    return normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]


def volume(points, faces):
    a, b, c = (points[triangles_of(faces)[:, i]] for i in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


def mean_edge(points, faces):
    return np.mean([np.linalg.norm(points[faces[:, i]] - points[faces[:, i - 1]], axis=1).mean()
                    for i in range(faces.shape[1])])


def measure(points, clean, faces, truth, edge):
    distance = np.abs(truth(points)[0]).mean() / edge
    true_normal = truth(points[faces].mean(axis=1))[1]
    cosine = np.einsum("ij,ij->i", face_normals(points, faces), true_normal)
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    counts = np.unique(np.sort(np.stack([faces, np.roll(faces, 1, 1)], -1).reshape(-1, 2), axis=1), axis=0,
                       return_counts=True)[1]
    size = f"{volume(points, faces) / volume(clean, faces):.4f}" if counts.min() == 2 else "-"
    return distance, angle.mean(), int((angle > 90).sum()), size


# --- methods ---------------------------------------------------------------------------------------------------------
def with_pointfair(program, arguments, points, faces, folder):
    write_ply(folder / "in.ply", points, faces)
    start = time.perf_counter()
    subprocess.run([program, "run", folder / "in.ply", folder / "out.ply", "--force", "-q", *arguments], check=True)
    return read_points(folder / "out.ply", len(points)), time.perf_counter() - start


# Of each peer, runs of points and faces: first its default, then a small sweep.
def pymeshlab_peers():
    import pymeshlab

    def peer(name, *settings, times=(1,)):
        def with_settings(arguments, repeat):
            def run(points, faces):
                meshes = pymeshlab.MeshSet()
                meshes.add_mesh(pymeshlab.Mesh(points, triangles_of(faces)))
                for _ in range(repeat):
                    getattr(meshes, name)(**arguments)
                return meshes.current_mesh().vertex_matrix()
            return run
        return [with_settings(arguments, repeat) for arguments in ({}, *settings) for repeat in times]
    steps = [{"stepsmoothnum": n} for n in (1, 2, 5, 10)]
    return {"MeshLab laplacian": peer("apply_coord_laplacian_smoothing", *steps),
            "MeshLab taubin": peer("apply_coord_taubin_smoothing", *({"stepsmoothnum": n} for n in (3, 5, 30, 100))),
            "MeshLab hc": peer("apply_coord_hc_laplacian_smoothing", times=(1, 2, 3, 5)),
            "MeshLab two-step": peer("apply_coord_two_steps_smoothing",
                                     *({"stepsmoothnum": n, "normalthr": t} for n in (1, 8) for t in (30, 60)))}


def trimesh_peers():
    import trimesh

    def peer(function, *settings):
        def with_settings(arguments):
            def run(points, faces):
                mesh = trimesh.Trimesh(points, triangles_of(faces), process=False)
                return np.asarray(function(mesh, **arguments).vertices)
            return run
        return [with_settings(arguments) for arguments in ({}, *settings)]
    smoothing = trimesh.smoothing
    return {"trimesh laplacian": peer(smoothing.filter_laplacian, *({"iterations": n, "volume_constraint": False}
                                                                    for n in (1, 2, 5, 10))),
            "trimesh taubin": peer(smoothing.filter_taubin, *({"iterations": n} for n in (2, 4, 30, 100))),
            "trimesh humphrey": peer(smoothing.filter_humphrey, *({"iterations": n, "alpha": alpha}
                                                                  for n in (3, 10, 30) for alpha in (0, 0.1)))}


def open3d_peers():
    import open3d

    def peer(name, *iterations):
        def with_iterations(count):
            def run(points, faces):
                mesh = open3d.geometry.TriangleMesh(open3d.utility.Vector3dVector(points),
                                                    open3d.utility.Vector3iVector(triangles_of(faces).astype(np.int32)))
                return np.asarray(getattr(mesh, name)(number_of_iterations=count).vertices)
            return run
        return [with_iterations(count) for count in iterations]
    return {"Open3D laplacian 10": peer("filter_smooth_laplacian", 10, 1, 2, 5, 20),
            "Open3D taubin 10": peer("filter_smooth_taubin", 10, 3, 5, 30, 100)}


def libigl_peers():
    """The implicit flow of libigl's tutorial 205, one step; its delta is for a mesh of area 1."""
    import igl
    from scipy.sparse.linalg import splu

    def with_delta(delta):
        def run(points, faces):
            triangles = triangles_of(faces).astype(np.int64)
            a, b, c = (points[triangles[:, i]] for i in range(3))
            area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
            mass = igl.massmatrix(points, triangles, igl.MASSMATRIX_TYPE_BARYCENTRIC)
            return splu((mass - delta * area * igl.cotmatrix(points, triangles)).tocsc()).solve(mass @ points)
        return run
    return {"libigl implicit": [with_delta(delta) for delta in (0.001, 0.00003, 0.0001, 0.0003, 0.003)]}


def limit_of_quads(points, faces):
    """Where the smooth surface of Ni and others 2008 (GPU smoothing of quad meshes) has the vertices: with four quads each
    it is the bicubic B-spline of the quads, elsewhere it has the limits of Catmull and Clark, (n^2 v + 4 sum of the n
    vertices across edges + sum of the n across quads) / (n (n + 5)). Vertices on a border stay."""
    count, places = len(points), points
    across = np.stack([faces, np.roll(faces, -2, 1)], -1).reshape(-1, 2)
    sides = np.stack([faces, np.roll(faces, -1, 1)], -1).reshape(-1, 2)
    quads = np.bincount(across[:, 0], minlength=count)[:, None]
    # an edge within the mesh has two quads, which run along it both ways
    edges = np.unique(np.concatenate([sides, sides[:, ::-1]]), axis=0)

    def sums(pairs):
        return np.stack([np.bincount(pairs[:, 0], places[pairs[:, 1], axis], count) for axis in range(3)], -1)
    limit = (quads**2 * points + 4 * sums(edges) + sums(across)) / (quads * (quads + 5))
    is_inner = np.bincount(edges[:, 0], minlength=count)[:, None] == quads
    return np.where(is_inner, limit, points)


def best_of(measures):
    """Each measure by itself; what is not finite loses."""
    distance, normals, folds = (min((m[i] for m in measures if np.isfinite(m[0])), default=np.inf) for i in range(3))
    return distance, normals, folds, "-"


BEST = ", best"


def is_peer(method):
    return method not in POINTFAIR and method != "noisy"


def print_table(rows, methods):
    """Of rows (mesh, noise, method, distance, normals, folds, volume)."""
    print("| mesh | noise | " + " | ".join(methods) + " |\n|---|---|" + "---|" * len(methods))
    for mesh, noise in dict.fromkeys((row[0], row[1]) for row in rows):
        cells = {row[2]: f"{row[3]:.3f} {row[4]:.1f} {row[5]}".replace("0.", ".", 1) if np.isfinite(row[3]) else "-"
                 for row in rows if row[:2] == (mesh, noise)}
        print(f"| {mesh} | {noise} | " + " | ".join(cells.get(method, "") for method in methods) + " |")


def print_summary(rows):
    """Means over the meshes; 1000 edges or 180 degrees stand for a result that is not finite."""
    noises, methods = (list(dict.fromkeys(row[i] for row in rows)) for i in (1, 2))
    print("| method | " + " | ".join(str(noise) for noise in noises) + " |\n|---|" + "---|" * len(noises))
    for method in methods:
        cells = []
        for noise in noises:
            its = np.array([row[3:6] for row in rows if row[1:3] == (noise, method)], float)
            its = np.where(np.isfinite(its), its, [1000, 180, 0])
            cells.append(f"{its[:, 0].mean():.3f} {its[:, 1].mean():.1f} {its[:, 2].mean():.0f}".replace("0.", ".", 1))
        print(f"| {method} | " + " | ".join(cells) + " |")
    cases = list(dict.fromkeys(row[:2] for row in rows))
    rivals = [row for row in rows if row[2] == "mesh" or (is_peer(row[2]) and not row[2].endswith(BEST))]
    for at, name in ((3, "distance"), (4, "normals")):
        for noise in noises:
            best = [min((row for row in rivals if row[:2] == case and np.isfinite(row[at])), key=lambda row: row[at])[2]
                    for case in cases if case[1] == noise]
            print(f"least {name} at {noise}: " + ", ".join(f"{method} {best.count(method)}" for method in dict.fromkeys(best)))
    for suffix, name in (("", "default"), (BEST, "best")):
        lost = {at: [] for at in (3, 4)}
        for case in cases:
            own = next((row for row in rows if row[:2] == case and row[2] == "mesh"), None)
            others = [row for row in rows if row[:2] == case and is_peer(row[2]) and row[2].endswith(BEST) == bool(suffix)]
            for at in lost if own and others else ():
                nearest = min(others, key=lambda row: row[at] if np.isfinite(row[at]) else np.inf)
                if nearest[at] < own[at]:
                    lost[at].append(f"{case[0]} {case[1]} to {nearest[2].removesuffix(BEST)} ({own[at]:.3f}, {nearest[at]:.3f})")
        if any(is_peer(row[2]) and row[2].endswith(BEST) == bool(suffix) for row in rows):
            for at, measure_name in ((3, "distance"), (4, "normals")):
                print(f"lost to a peer's {name} in {measure_name}: {len(lost[at])} of {len(cases)}: " + "; ".join(lost[at]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--noise", type=float, nargs="+", default=[0.1, 0.3, 0.5])
    parser.add_argument("--kind", nargs="+", choices=["white", "correlated"], default=["white"])
    parser.add_argument("--methods", nargs="+", choices=list(POINTFAIR), default=list(POINTFAIR))
    parser.add_argument("--meshes", nargs="+", choices=list(MESHES), default=list(MESHES))
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("--sweep", action="store_true")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--summary", action="store_true")
    options = parser.parse_args()
    rows, peers = [], {}
    for load in (pymeshlab_peers, trimesh_peers, open3d_peers, libigl_peers) if options.peers or options.sweep else ():
        try:
            peers.update(load())
        except ImportError as error:
            print(f"{error.name} is not installed")
    if not options.table and not options.summary:
        print("| mesh | noise | method | distance | normals | folds | volume |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for mesh in options.meshes:
            clean, faces, truth = MESHES[mesh]()
            edge = mean_edge(clean, faces)
            for noise, kind in [(noise, kind) for kind in options.kind for noise in options.noise]:
                noisy = clean + noise_of(clean, faces, noise * edge, kind)
                told = noise if kind == "white" else f"{noise}, {kind}"
                results = {"noisy": noisy}
                for method in options.methods:
                    results[method] = with_pointfair(options.program, POINTFAIR[method], noisy, faces, folder)[0]
                measures = {method: measure(points, clean, faces, truth, edge) for method, points in results.items()}
                of_quads = {"limit of quads": [limit_of_quads]} if (options.peers or options.sweep) and faces.shape[1] == 4 else {}
                for peer, runs in (peers | of_quads).items():
                    its = [measure(run(noisy, faces), clean, faces, truth, edge)
                           for run in (runs if options.sweep else runs[:1])]
                    measures[peer] = its[0]
                    if options.sweep:
                        measures[peer + BEST] = best_of(its)
                for method, (distance, normals, folds, size) in measures.items():
                    rows.append((mesh, told, method, distance, normals, folds, size))
                    if options.table or options.summary:
                        continue
                    print(f"| {mesh} | {told} | {method} | {distance:.4f} | {normals:.2f} | {folds} | {size} |", flush=True)
    if options.table:
        print_table(rows, list(dict.fromkeys(row[2] for row in rows)))
    if options.summary:
        print_summary(rows)


if __name__ == "__main__":
    main()
