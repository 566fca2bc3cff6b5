#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The paper's table II and figures 6 and 7 on this machine (`make paper-tables`).

Makes clouds of the paper's sizes with `pointfair noise`, measures with the program paper_tables, which writes CSV, and
turns the CSV into table2.md, figure6.svg and figure7.svg; hard.md is of clouds that a dense grid is not made for. Without a card the table and plots hold the CPU and the
paper's published numbers. --draw FOLDER only draws, from CSV that was written anywhere; plots need matplotlib.
"""
import argparse
import array
import csv
import math
import struct
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
import models  # noqa: E402

# "Interactive Point Clouds Fairing on Many-Core System", table II, seconds; k = 8, transfers included.
PAPER_POINTS = (12683, 50833, 114446, 458074, 1272739)
PAPER_SECONDS = {
    "the paper, CPU": (23, 106, 250, 719, 1439),
    "the paper, GeForce 9800GT": (0.135, 0.533, 1.202, 4.954, 14.682),
    "the paper, Tesla C1060": (0.027, 0.099, 0.215, 0.883, 2.617),
}
FIGURE_POINTS = 543652  # the Buddha of figures 6 and 7
HARD_POINTS, STRAY = 1000000, 20
PARTS = ("table2", "hard", "figures")
DESIGN, BRUTE, CUKNN, CUDA, CPU = "paper's design", "brute force", "CUKNN", "pointfair CUDA", "pointfair CPU"


def bumpy_mesh(path, rings=200):
    """A bumpy sphere as triangles, where there is no model."""
    sectors = 2 * rings
    lines = []
    for i in range(rings + 1):
        for j in range(sectors):
            theta, phi = math.pi * i / rings, 2 * math.pi * j / sectors
            x, y, z = math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)
            r = 1 + 0.1 * math.sin(8 * x) * math.sin(7 * y + 1) * math.cos(9 * z) + 0.03 * math.sin(30 * x + 20 * y)
            lines.append(f"{r * x:.9g} {r * y:.9g} {r * z:.9g}")
    faces = []
    for i in range(rings):
        for j in range(sectors):
            a, b = i * sectors + j, i * sectors + (j + 1) % sectors
            faces += [f"3 {a} {a + sectors} {b}", f"3 {b} {a + sectors} {b + sectors}"]
    path.write_text(f"OFF\n{len(lines)} {len(faces)} 0\n" + "\n".join(lines + faces) + "\n")


def find_mesh(folder):
    """The Armadillo of Debian's libcgal-demo, or a bumpy sphere."""
    try:
        models.fetch(folder)
        return folder / "armadillo.off"
    except (OSError, subprocess.CalledProcessError, StopIteration):
        print("No Armadillo here (libcgal-demo): measuring a bumpy sphere", flush=True)
        bumpy_mesh(folder / "bumpy_sphere.off")
        return folder / "bumpy_sphere.off"


def make_cloud(options, points, name=None, *flags):
    path = options.out / "clouds" / f"{name or options.mesh.stem + '_' + str(points)}.ply"
    if not path.exists():
        subprocess.run([options.bin / "pointfair", "noise", options.mesh, path, "--points", str(points), "--sigma", "0.1%",
                        "--seed", "1", "-q", *flags], check=True)
    return path


def with_stray(cloud, name):
    """The cloud with its last point STRAY diagonals away: binary PLY of nothing but x, y and z as floats."""
    data = bytearray(cloud.read_bytes())
    values = array.array("f", data[data.index(b"end_header\n") + 11:])
    diagonal = math.dist(*([edge(values[axis::3]) for axis in range(3)] for edge in (min, max)))
    data[-12:-8] = struct.pack("<f", values[-3] + STRAY * diagonal)
    path = cloud.with_name(name + ".ply")
    path.write_bytes(data)
    return path


def hard_clouds(options):
    even = make_cloud(options, HARD_POINTS, "even")
    return [even, make_cloud(options, HARD_POINTS, "uneven_50", "--uneven", "50"),
            make_cloud(options, HARD_POINTS, "uneven_1000", "--uneven", "1000"), with_stray(even, "one_stray_point")]


def measure(options):
    clouds = options.out / "clouds"
    clouds.mkdir(parents=True, exist_ok=True)
    options.mesh = options.mesh or find_mesh(clouds)
    command = [options.bin / "paper_tables", "--out", options.out, "--repeat", str(options.repeat)]
    if "figures" in options.only:
        command += ["--figure-cloud", make_cloud(options, FIGURE_POINTS)]
    if "hard" in options.only:
        command += ["--hard", *hard_clouds(options), "--"]
    if "table2" in options.only:
        command += [make_cloud(options, points) for points in PAPER_POINTS]
    code = subprocess.run(command).returncode
    if code != 0:
        sys.exit(code)


def read_csv(path):
    if not path.exists():
        return []
    with path.open() as file:
        return list(csv.DictReader(file))


def shown(number):
    return f"{number:,.0f}" if number >= 100 else f"{number:.3g}"


def fastest(rows, key):
    """By contender and column: the row of the least time, since the paper's design is given its best resolution."""
    best = {}
    for row in rows:
        place = row["contender"], row[key]
        if place not in best or float(row["ms"]) < float(best[place]["ms"]):
            best[place] = row
    return best


def markdown(columns, titles, lines):
    """Lines are a name and a function of a column; those with nothing in any column are left out."""
    rows = [(name, [cell(column) for column in columns]) for name, cell in lines]
    body = [f"| {name} | " + " | ".join(cells) + " |" for name, cells in rows if any(cells)]
    return "\n".join(["| | " + " | ".join(titles) + " |", "|---" * (len(columns) + 1) + "|", *body]) + "\n"


def comparison(rows, key, published):
    """The lines of a table: milliseconds of every contender, the best resolution, and ratios."""
    best = fastest(rows, key)
    times = {place: float(row["ms"]) for place, row in best.items()} | published

    def time(name):
        return lambda column: shown(times[name, column]) if (name, column) in times else ""

    def ratio(above, below):
        return lambda column: (shown(times[above, column] / times[below, column])
                               if (above, column) in times and (below, column) in times else "")

    return [*((f"{name}, ms", time(name)) for name in (*PAPER_SECONDS, CPU, BRUTE, CUKNN)),
            ("the paper's design on this card, ms", time(DESIGN)),
            ("its best resolution", lambda column: best.get((DESIGN, column), {}).get("resolution", "")),
            (f"{CUDA}, ms", time(CUDA)),
            (f"{CPU}: times faster than the paper's CPU", ratio("the paper, CPU", CPU)),
            (f"{CUDA}: times faster than the paper's Tesla C1060", ratio("the paper, Tesla C1060", CUDA)),
            ("than the paper's design on this card", ratio(DESIGN, CUDA)),
            ("than brute force on this card", ratio(BRUTE, CUDA)),
            ("than CUKNN on this card", ratio(CUKNN, CUDA))]


def table2(rows):
    sizes = sorted({row["points"] for row in rows}, key=int)
    published = {(name, str(points)): 1000 * s for name, seconds in PAPER_SECONDS.items()
                 for points, s in zip(PAPER_POINTS, seconds)}
    return markdown(sizes, [f"{int(size):,}" for size in sizes], comparison(rows, "points", published))


def hard(rows):
    clouds = list(dict.fromkeys(row["cloud"] for row in rows))
    return markdown(clouds, [cloud.replace("_", " ") for cloud in clouds], comparison(rows, "cloud", {}))


def card_of(folder):
    """The last usable device of the machine that was measured, a card if it has one."""
    path = folder / "environment.txt"
    lines = [line for line in path.read_text().splitlines() if line[:1] != " "] if path.exists() else []
    usable = [line.split(":")[0] for line in lines if line.endswith(("always available", "can be used"))]
    return usable[-1] if usable else ""


STYLES = {DESIGN: ("o-", "the paper's design"), BRUTE: ("-.", BRUTE), CUKNN: ("-", CUKNN), CPU: (":", CPU), CUDA: ("--", CUDA)}


def plot(plt, rows, folder, name, title, colors):
    """Lines over resolution for the paper's design, levels for the others; a color a k."""
    from matplotlib.lines import Line2D
    figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
    drawn = set()
    for k, color in colors.items():
        of_k = [row for row in rows if row.get("k", k) == k]
        for contender, (style, _) in STYLES.items():
            mine = [row for row in of_k if row["contender"] == contender]
            times = [float(row["ms"]) for row in mine]
            if mine and mine[0]["resolution"]:
                axes.plot([int(row["resolution"]) for row in mine], times, style, color=color)
            elif mine:
                axes.axhline(times[0], linestyle=style, color=color)
            drawn |= {contender} if mine else set()
    axes.set(title=f"{title} of {int(rows[0]['points']):,} points, {card_of(folder)}", ylabel="ms",
             xlabel="resolution of the grid: cells along the longest side", xscale="log", yscale="log")
    ticks = [16, 32, 64, 128, 256, 512, 1024]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.yaxis.set_major_formatter("{x:g}")
    axes.grid(alpha=0.3)
    handles = [Line2D([], [], color=color, label=f"k = {k}") for k, color in colors.items() if len(colors) > 1]
    handles += [Line2D([], [], color="black", linestyle=style.lstrip("o"), marker="o" if "o" in style else "", label=label)
                for contender, (style, label) in STYLES.items() if contender in drawn]
    figure.get_layout_engine().set(rect=(0, 0.12, 1, 0.88))  # room for the legend; Debian 12 has Matplotlib 3.6
    figure.legend(handles=handles, loc="lower center", ncols=4, fontsize="small")
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
    print(f"{folder / name}.svg")


def draw(folder):
    """What can be made of the CSV in the folder."""
    for name, make in (("table2", table2), ("hard", hard)):
        rows = read_csv(folder / f"{name}.csv")
        if rows:
            (folder / f"{name}.md").write_text(make(rows))
            print(make(rows))
    try:
        import matplotlib
        matplotlib.use("svg")
        import matplotlib.pyplot as plt
    except ImportError:
        print(f"No plots: matplotlib is missing; elsewhere: bench/paper_tables.py --draw {folder}")
        return
    plt.rcParams |= {"svg.hashsalt": "pointfair", "svg.fonttype": "none"}  # the same data give the same file
    rows = read_csv(folder / "figure6.csv")
    if rows:
        plot(plt, rows, folder, "figure6", "Index", {"": "black"})
    rows = read_csv(folder / "figure7.csv")
    if rows:
        ks = sorted({row["k"] for row in rows}, key=int)
        plot(plt, rows, folder, "figure7", "Neighbours", {k: f"C{n}" for n, k in enumerate(ks)})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin", help="folder of pointfair and paper_tables")
    parser.add_argument("--out", type=Path, default=ROOT / "build/paper", help="folder for clouds, CSV, table and plots")
    parser.add_argument("--mesh", type=Path, help="default: the Armadillo of libcgal-demo, else a bumpy sphere")
    parser.add_argument("--repeat", type=int, default=9, help="median of so many runs")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--draw", type=Path, metavar="FOLDER", help="only draw the CSV of this folder")
    options = parser.parse_args()
    if not options.draw:
        measure(options)
    draw(options.draw or options.out)


if __name__ == "__main__":
    main()
