#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""make figures: draws every picture of docs/pictures but the viewer's, from Debian's libcgal-demo models with fixed seeds,
and writes the captions with their measured numbers between the marks <!-- figure NAME --> and <!-- end --> of
README.md and docs/*.md. figures.py NAME... draws only these. Clouds stay in build/figures."""
import bisect
import json
import math
import pathlib
import random
import re
import subprocess
import sys

import models
import principle

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT, PICTURES = ROOT / "build/figures", ROOT / "docs/pictures"
POINTFAIR, PICTURE = ROOT / "build/bin/pointfair", ROOT / "build/bin/picture"
PAGES = [ROOT / "README.md", ROOT / "docs/figures.md", ROOT / "docs/parameters.md"]
SEED = "1"
STRIP_WIDTH, STRIP_HEIGHT, PLATE_HEIGHT = 900, 250, 110


# --- clouds ---------------------------------------------------------------------------------------------------------

def pointfair(*arguments):
    subprocess.run([POINTFAIR, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def report_of(*arguments):
    path = OUT / "report.json"
    pointfair(*arguments, "--report", path)
    return json.loads(path.read_text())


class Scene:
    """A noisy cloud, the mesh that it should lie on, and where to look."""

    def __init__(self, mesh, points, sigma, angles, zoom=1, focus=(0, 0), more=()):
        self.mesh, self.points, self.sigma, self.more = mesh, points, sigma, more
        self.angles, self.zoom, self.focus = angles, zoom, focus

    def file(self):
        words = [self.mesh, self.points, self.sigma, *self.more]
        path = OUT / ("_".join(str(w).strip("-%") for w in words) + ".ply")
        if not path.exists():
            pointfair("noise", OUT / f"{self.mesh}.off", path, "--points", self.points, "--sigma", self.sigma,
                      "--seed", SEED, "--quiet", *self.more)
        return path

    def words(self):
        more = {"--uneven": ", density {}:1", "--outliers": ", {} outliers"}
        return f"{self.mesh}, {self.points:,} points, noise {self.sigma}" + (more[self.more[0]].format(self.more[1]) if self.more else "")

    def camera(self):
        return ["--frame", OUT / f"{self.mesh}.off", "--angles", *self.angles, "--zoom", self.zoom, "--focus", *self.focus]


def write_plate(path, gap=0.015):
    """Two parallel sheets."""
    corners = [(x, y, z) for y in (0, gap) for z in (0, 1) for x in (0, 1)]
    text = "".join(f"{x} {y} {z}\n" for x, y, z in corners)
    path.write_text(f"OFF\n8 2 0\n{text}4 0 2 3 1\n4 4 5 7 6\n")


def write_with_normals(path, rows):
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    text = "".join(" ".join(f"{v:.7g}" for v in row) + "\n" for row in rows)
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex {len(rows)}\n{names}end_header\n{text}")


def write_wedge(path, step=0.01, degrees=6, jitter=0.35, noise=0.1):
    """Two sheets that meet in a sharp ridge, a point in each cell of a grid, with their true normals."""
    generator = random.Random(int(SEED))
    cells, rows = round(1 / step), []
    for angle in (math.radians(degrees / 2), -math.radians(degrees / 2)):
        normal = (-math.sin(angle), 0, math.cos(angle))
        for i in range(cells * cells):
            along = (i // cells + 0.5 + generator.uniform(-jitter, jitter)) * step
            across = (i % cells + 0.5 + generator.uniform(-jitter, jitter)) * step
            height = generator.gauss(0, noise * step)
            point = (along * math.cos(angle) + height * normal[0], across, along * math.sin(angle) + height * normal[2])
            rows.append(point + normal)
    write_with_normals(path, rows)


def read_off(path):
    numbers = iter(path.read_text().split()[1:])
    vertices, faces, _ = (int(next(numbers)) for _ in range(3))
    corners = [[float(next(numbers)) for _ in range(3)] for _ in range(vertices)]
    return corners, [[int(next(numbers)) for _ in range(int(next(numbers)))] for _ in range(faces)]


def write_sampled(path, mesh, points, noise):
    """Points spread over a mesh of triangles by area, with their faces' normals; noise in % of the diagonal."""
    corners, faces = read_off(mesh)
    diagonal = math.dist(*([pick(c[a] for c in corners) for a in range(3)] for pick in (min, max)))
    generator, triangles, areas = random.Random(int(SEED)), [], [0.0]
    for face in faces:
        a, b, c = (corners[i] for i in face)
        u, v = [q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, c)]
        normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        length = math.hypot(*normal)
        if length > 0:
            triangles.append((a, u, v, [x / length for x in normal]))
            areas.append(areas[-1] + length)
    rows = []
    for _ in range(points):
        a, u, v, normal = triangles[bisect.bisect(areas, generator.random() * areas[-1]) - 1]
        s, t = generator.random(), generator.random()
        if s + t > 1:
            s, t = 1 - s, 1 - t
        height = generator.gauss(0, noise / 100 * diagonal)
        rows.append([p + s * x + t * y + height * n for p, x, y, n in zip(a, u, v, normal)] + normal)
    write_with_normals(path, rows)


# --- strips ---------------------------------------------------------------------------------------------------------

def fair(cloud, flags):
    out = OUT / "fair" / (cloud.stem + "".join(flags.split()).replace("/", "") + ".ply")
    pointfair("run", cloud, out, *flags.split(), "--force", "--quiet", "--report", out.with_suffix(".json"))
    return out


def draw(clouds, name, scene, width=None, height=STRIP_HEIGHT):
    panel = (width or STRIP_WIDTH // len(clouds), PLATE_HEIGHT if scene.mesh == "plate" else height)
    look = ["--normals", "k=20", "--spot", 0.15] if scene.mesh == "plate" else []  # discs seen from the side would hide the gap
    command = [PICTURE, *clouds, "--out", PICTURES / f"{name}.png", "--panel", *panel, *scene.camera(), *look]
    subprocess.run(list(map(str, command)), check=True)


def left(cloud, mesh, edges):
    """What `pointfair compare` finds, in % of the diagonal."""
    compared = report_of("compare", cloud, OUT / f"{mesh}.off", "--edges", 40)
    in_percent = lambda key: f"{100 * compared[key] / compared['diagonal']:.3f} %"
    return in_percent("mean") + (f" ({in_percent('edge_rms')})" if edges else "")


def left_beside_outliers(cloud):
    """The distance within which 95 % of the points lie, since a few outliers make any mean, and how many were recognised."""
    compared = report_of("compare", cloud, OUT / "fandisk.off")
    report = cloud.with_suffix(".json")
    found = f", {json.loads(report.read_text())['unmoved']['outliers']} kept" if report.exists() else ""
    return f"{100 * compared['p95'] / compared['diagonal']:.3f} %{found}"


def set_caption(name, text):
    block = f"<!-- figure {name} -->\n{text}\n<!-- end -->"
    for page in PAGES:
        if page.exists():
            old = page.read_text()
            new = re.sub(rf"<!-- figure {re.escape(name)} -->\n.*?<!-- end -->", lambda _: block, old, flags=re.S)
            if new != old:
                page.write_text(new)


def draw_strip(name, scene, variants):
    """One panel for each set of flags; "" is `auto`, None the cloud as it came."""
    source, edges = scene.file(), scene.mesh != "plate"
    clouds = [source if flags is None else fair(source, flags) for flags in variants]
    draw(clouds, name, scene)
    labels = ["as it came" if flags is None else f"`{flags}`" if flags else "auto" for flags in variants]
    measure = left_beside_outliers if "--outliers" in scene.more else lambda cloud: left(cloud, scene.mesh, edges)
    parts = [f"{label}: {measure(cloud)}" for label, cloud in zip(labels, clouds)]
    alt = "from left to right: " + ", ".join(label.replace("`", "") for label in labels)
    set_caption(name, f"![{alt}](pictures/{name}.png)\n\n{' · '.join(parts)} ({scene.words()})")


HEAD = Scene("armadillo", 100000, "0.3%", (200, 8), 2.6, (0.02, 0.52))
HEAD_CLEAN = Scene("armadillo", 100000, "0.01%", (200, 8), 2.6, (0.02, 0.52))
FANDISK = Scene("fandisk", 50000, "0.3%", (30, 30), 2, (-0.55, -0.25))
FANDISK_LITTLE_NOISE = Scene("fandisk", 50000, "0.1%", (30, 30), 2, (-0.55, -0.25))
UNEVEN = Scene("fandisk", 60000, "0.2%", (30, 30), 1.3, (0.1, 0), ("--uneven", "20"))
OUTLIERS = Scene("fandisk", 50000, "0.2%", (30, 30), 1, (0, 0), ("--outliers", "1%"))
PLATE = Scene("plate", 40000, "0.1%", (0, 0), 6, (0, 0))
LION = Scene("dragon", 200000, "0.3%", (20, 8))
ARMADILLO = Scene("armadillo", 200000, "0.3%", (200, 8))
ARMADILLO_LITTLE_NOISE = Scene("armadillo", 200000, "0.1%", (200, 8))
APART = "--k 30 --constraint on"

STRIPS = {
    "noisy": (FANDISK, ["", "--min-neighbors 32", "--iterations 3"]),
    "edges": (FANDISK_LITTLE_NOISE, ["", "--iterations 1", "--min-neighbors 8"]),
    "uneven": (UNEVEN, ["", "--radius 1%", "--k 30"]),
    "sheets": (PLATE, [None, "", "--k 30"]),
    "clean": (HEAD_CLEAN, [None, "", "--iterations 1"]),
    "noise": (HEAD, ["--noise 0.1%", "", "--noise 0.9%"]),
    "k": (HEAD, ["--k 8", "", "--k 100"]),
    "radius": (HEAD, ["--radius 0.6%", "", "--radius 4%"]),
    "min_neighbors": (UNEVEN, ["--min-neighbors 4", "", "--min-neighbors 64"]),
    "constraint": (PLATE, [None, "--k 30", f"{APART} --rho 0.9s --delta 0.5s"]),
    "rho": (PLATE, [f"{APART} --rho {rho} --delta 0.3s" for rho in ("0.2s", "1.1s", "3s")]),
    "delta": (PLATE, [f"{APART} --rho 0.9s --delta {delta}" for delta in ("0.01s", "0.5s", "2s")]),
    "normal_sigma": (HEAD, ["--normal-sigma 0.3r", "", "--normal-sigma 4r"]),
    "normal_filter": (FANDISK, ["--normal-filter off", "", "--normal-filter mollify"]),
    "crease_angle": (FANDISK, ["--crease-angle 5", "", "--crease-angle 80"]),
    "flat_scale": (FANDISK, ["--flat-scale 1", "", "--flat-scale 2"]),
    "method": (FANDISK, ["", "--method mls", "--method wiener", "--method mollified"]),
    "method_positions": (FANDISK, ["--method laplacian", "--method taubin", "--method hc-laplacian"]),
    "closeness_sigma": (FANDISK, ["--closeness-sigma 0.2r", "", "--closeness-sigma 2r"]),
    "similarity_sigma": (PLATE, ["--similarity-sigma 0.03%", "", "--similarity-sigma 1%"]),
    "area_weight": (UNEVEN, ["", "--area-weight length", "--area-weight squared"]),
    "offset": (FANDISK, ["--offset point", ""]),
    "relaxation": (HEAD, ["--relaxation 0.3", "", "--relaxation 2"]),
    "iterations": (HEAD, ["--iterations 1", "", "--iterations 10"]),
    "outliers": (OUTLIERS, [None, "--outliers move", "--outliers keep"]),
    "outlier_distance": (OUTLIERS, ["--outlier-distance 0.3%", "", "--outlier-distance 5%"]),
    "outlier_radius": (OUTLIERS, ["--outlier-radius 100%", "", "--outlier-radius 2s"]),
    "displacement_limit": (OUTLIERS, ["--displacement-limit 0.1%", "", "--displacement-limit 3%"]),
}


# --- the paper's figures and the README's -----------------------------------------------------------------------------

def draw_figure5():
    parts = []
    for scene in (LION, ARMADILLO):
        clean = Scene(scene.mesh, scene.points, "0", scene.angles)
        name = f"figure5_{scene.mesh}"
        draw([clean.file(), scene.file()], name, scene, width=400, height=400)
        parts.append(f"![the model and its noisy model](pictures/{name}.png)")
    set_caption("figure5", "\n".join(parts) + f"\n\n{LION.points:,} points each; right: noise 0.3 % of the diagonal.")


def normals(name, cloud, settings, labels, camera):
    """Draws the normals that each setting gives and returns the caption's parts with the mean angle errors."""
    flags = [word for setting in settings for word in ("--normals", setting)]
    panel = (STRIP_WIDTH // len(settings), 260)
    command = [PICTURE, cloud, "--out", PICTURES / f"{name}.png", "--panel", *panel, *camera, *flags]
    printed = subprocess.run(list(map(str, command)), check=True, stdout=subprocess.PIPE, text=True).stdout
    errors = [float(line.split()[0]) for line in printed.splitlines()]
    return " · ".join(f"{label}: {error:.2f}°" for label, error in zip(labels, errors))


def draw_figure8():
    wedge, fandisk = OUT / "wedge.ply", OUT / "fandisk_normals.ply"
    write_wedge(wedge)
    write_sampled(fandisk, OUT / "fandisk.off", 30000, 0.01)
    apart = "constraint=on rho=0.013 delta=0.001"
    ridge = normals("figure8_ridge", wedge,
                    ["k=32 normal_sigma=1000s", "k=32", f"k=32 {apart} normal_sigma=1000s", f"k=32 {apart}"],
                    ["32 nearest, equal weights", "32 nearest, Gaussian weights", "constrained, equal weights",
                     "constrained, Gaussian weights"], ["--angles", 0, 0, "--zoom", 2.5, "--focus", -0.6, 0, "--frame", wedge])
    edges = normals("figure8_edges", fandisk, ["k=32 normal_sigma=1000s", "k=32", "k=32 normal_sigma=1.2s"],
                    ["equal weights", "Gaussian weights, width auto", "Gaussian weights, 1.2 spacings"],
                    ["--angles", 30, 30, "--zoom", 1.5, "--focus", -0.4, -0.2, "--frame", fandisk])
    set_caption("figure8", f"![normals near a sharp ridge](pictures/figure8_ridge.png)\n\n{ridge}\n\n"
                           f"![normals near edges](pictures/figure8_edges.png)\n\n{edges}")


def draw_figure9():
    source = ARMADILLO_LITTLE_NOISE.file()
    clouds = [source, fair(source, "--preset paper"), fair(source, "")]
    draw(clouds, "figure9", ARMADILLO_LITTLE_NOISE, height=330)
    found = [left(cloud, ARMADILLO_LITTLE_NOISE.mesh, False) for cloud in clouds]
    set_caption("figure9", "![noisy, the paper's parameters, the default run](pictures/figure9.png)\n\n"
                           f"noisy: {found[0]} from the true surface on average, of the diagonal · `--preset paper`: {found[1]} · "
                           f"default run: {found[2]}")


def draw_readme():
    source = ARMADILLO.file()
    draw([source, fair(source, "")], "before_after", ARMADILLO, width=450, height=500)
    scan = OUT / "hippo.ply"
    draw([scan, fair(scan, "")], "scan", Scan(), width=450, height=320)


class Scan:
    mesh = "hippo"

    def camera(self):
        return ["--frame", OUT / "hippo.ply"]


def measure_times():
    """Milliseconds of some runs against those of the default, the least of five each, in turns."""
    flags = ["", "--normal-filter off", "--iterations 1", "--k 16", "--k 64", "--k 100"]
    least = dict.fromkeys(flags, math.inf)
    for _ in range(5):
        for f in flags:
            done = report_of("run", HEAD.file(), OUT / "fair/timed.ply", *f.split(), "--device", "cpu", "--force", "--quiet")
            least[f] = min(least[f], done["total_ms"])
    rows = "".join(f"| `{f}` | {least[f] / least['']:.1f} |\n" for f in flags[1:])
    set_caption("times", f"| {HEAD.words()} | time, the default run is 1 |\n|---|---|\n{rows}".rstrip())


def draw_principle():
    def run(cloud, result, *flags):
        pointfair("run", cloud, result, *flags, "--device", "cpu", "--force", "--quiet")

    principle.draw(run, OUT, PICTURES)


FIGURES = {"principle": draw_principle, "times": measure_times, "figure5": draw_figure5, "figure8": draw_figure8, "figure9": draw_figure9, "readme": draw_readme}


WITHOUT_STRIP = ("preset", "along", "connectivity", "rings", "keep-boundary", "tangential", "implicit-weights", "implicit-lambda", "weights")


def check_complete():
    """Every parameter has its strip, but those that are many at once, leave as much noise either way, or are not of clouds."""
    text = subprocess.run([POINTFAIR, "run", "--help-all"], check=True, stdout=subprocess.PIPE, text=True).stdout
    flags = re.findall(r"^  --([a-z-]+) ", text.split("\nParameters:")[1].split("\nLimits:")[0], flags=re.M)
    missing = [flag for flag in flags if flag not in WITHOUT_STRIP and flag.replace("-", "_") not in STRIPS]
    if missing:
        sys.exit("no strip for: " + ", ".join(missing))


def main():
    check_complete()
    models.fetch(OUT)
    (OUT / "fair").mkdir(exist_ok=True)
    write_plate(OUT / "plate.off")
    for name in sys.argv[1:] or [*FIGURES, *STRIPS]:
        print(name, flush=True)
        if name in FIGURES:
            FIGURES[name]()
        else:
            draw_strip(name, *STRIPS[name])


if __name__ == "__main__":
    main()
