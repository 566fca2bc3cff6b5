# SPDX-License-Identifier: Apache-2.0
"""Made-up outliers in terrain with a house: which of them `--outliers mark` finds with default parameters, and which Open3D's
statistical and radius outlier removal find with usual settings. Needs numpy and open3d.

    python bench/outliers_beside_peers.py PROGRAM

40,000 points of an area of 40 x 40 m, noise of 2 cm, 400 outliers, four seeds. Precision is the share of the marks that
are outliers, recall the share of the outliers that are marked, each the mean and the least of the seeds, in %."""
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import open3d

SIDE, POINTS, BAD, NOISE = 40.0, 40_000, 400, .02
KINDS = ("spikes", "low points", "dust", "floaters", "birds")
STATISTICAL = ((20, 2.0), (8, 1.0), (8, 2.0))      # neighbours, standard deviations
RADIUS = ((16, 8), (8, 5))                         # neighbours within so many median distances of nearest points


def clumps(random, low, high, sizes, spread):
    """Some `BAD` points in clumps of so many points."""
    parts, count = [], 0
    while count < BAD:
        size = int(random.integers(*sizes))
        parts.append(random.uniform(low, high) + spread * random.normal(size=(size, 3)))
        count += size
    return np.concatenate(parts)


def scene(kind, seed):
    """Points, and which of them are outliers."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(0, SIDE, (2, POINTS))
    z = 1.5 * np.sin(x / 6) * np.cos(y / 7) + NOISE * random.normal(size=POINTS)
    if seed % 2:
        roof = (abs(x - 20) < 5) & (abs(y - 20) < 4)
        z = np.where(roof, 6 - .4 * abs(y - 20) + NOISE * random.normal(size=POINTS), z)
    points, bad = np.stack([x, y, z], 1), np.zeros(POINTS, bool)
    some = random.choice(POINTS, BAD, False)
    if kind == "spikes":
        points[some, 2] += random.choice([-1, 1], BAD) * random.uniform(.3, 3, BAD)
        bad[some] = True
        return points, bad
    more = {"low points": lambda: points[some] - [0, 0, 1] * random.uniform(.5, 20, (BAD, 1)),
            "dust": lambda: random.uniform([0, 0, -1], [SIDE, SIDE, 12], (BAD, 3)),
            "floaters": lambda: clumps(random, [0, 0, 3], [SIDE, SIDE, 15], (3, 13), .15),
            "birds": lambda: clumps(random, [0, 0, 8], [SIDE, SIDE, 40], (20, 21), .2)}[kind]()
    return np.concatenate([points, more]), np.concatenate([bad, np.ones(len(more), bool)])


def marked(program, points):
    """By the program, with default parameters."""
    with tempfile.TemporaryDirectory() as folder:
        source, result = pathlib.Path(folder, "in.npy"), pathlib.Path(folder, "out.ply")
        np.save(source, points.astype(np.float32))
        subprocess.run([program, "run", source, result, "--outliers", "mark", "--encoding", "binary", "-q"], check=True)
        body = result.read_bytes().split(b"end_header\n", 1)[1]
    return np.frombuffer(body, [("place", "<f4", 3), ("outlier", "u1")])["outlier"] > 0


def removed(cloud, kept):
    gone = np.ones(len(cloud.points), bool)
    gone[np.asarray(kept)] = False
    return gone


def judge(program, kind):
    """Precision and recall of each way, a row a seed."""
    rows = {}
    for seed in (1, 2, 3, 4):
        points, bad = scene(kind, seed)
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
        step = float(np.median(np.asarray(cloud.compute_nearest_neighbor_distance())))
        ways = {"pointfair": marked(program, points)}
        for count, deviations in STATISTICAL:
            ways[f"statistical {count}, {deviations:g}"] = removed(cloud, cloud.remove_statistical_outlier(count, deviations)[1])
        for count, steps in RADIUS:
            ways[f"radius {count} in {steps}"] = removed(cloud, cloud.remove_radius_outlier(count, steps * step)[1])
        for way, found in ways.items():
            right = 100.0 * (found & bad).sum()
            rows.setdefault(way, []).append((right / max(1, found.sum()), right / bad.sum()))
    return rows


def main(program):
    columns = {kind: judge(program, kind) for kind in KINDS}
    print("| | " + " | ".join(KINDS) + " |\n|---" * 1 + "|---" * len(KINDS) + "|")
    for way in columns[KINDS[0]]:
        cells = []
        for kind in KINDS:
            mean, least = np.mean(columns[kind][way], 0), np.min(columns[kind][way], 0)
            cells.append(f"{mean[0]:.1f} ({least[0]:.1f}), {mean[1]:.1f} ({least[1]:.1f})")
        print(f"| {way} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]) if len(sys.argv) == 2 else __doc__)
