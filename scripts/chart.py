#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws the chart at the beginning of docs/benchmarks.md from that page's tables, into docs/pictures/benchmarks.svg.

    scripts/chart.py [--check]

With --check it writes nothing, and ends with 1 if the picture is not what the tables say."""
import argparse
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGE, PICTURE = ROOT / "docs/benchmarks.md", ROOT / "docs/pictures/benchmarks.svg"
NOISE = "even 0.3 %"
SHAPES = {"armadillo": "Armadillo", "fandisk": "Fandisk"}
ROWS = {"noisy": "noisy", "CGAL bilateral, best of 5": "CGAL bilateral, best setting", "CGAL jet, best of 4": "CGAL jet, best setting",
        "PCL MLS, best of 4": "PCL MLS, best setting", "pointfair": "pointfair, default run",
        "pointfair --method learned": "pointfair, learned method"}
WIDTH, LEFT, PANEL, LINE, TOP = 940, 220, 290, 30, 64


def column(page, shape):
    """The mean distances of one column, by the name of the row."""
    table = re.search(rf"<!-- quality {shape} -->.*?Mean distance, % of the diagonal:\n\n((?:\|[^\n]*\n)+)", page, re.S)
    header, _, *rows = ([cell.strip() for cell in line[1:-1].split("|")] for line in table[1].splitlines())
    at = header.index(f"{shape} {NOISE}")
    return {row[0]: float(row[at].strip("*")) for row in rows if row[at]}


def chart(page):
    """The page's tables as a picture."""
    height = TOP + LINE * len(ROWS) + 20
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="14" fill="#234">',
             f'<rect width="{WIDTH}" height="{height}" fill="#fff"/>',
             '<text x="12" y="24" font-weight="bold">Mean distance to the true surface, % of the diagonal; shorter is better</text>']
    for number, (shape, title) in enumerate(SHAPES.items()):
        values = column(page, shape)
        x, longest = LEFT + number * (PANEL + 70), max(values[name] for name in ROWS)
        parts.append(f'<text x="{x}" y="{TOP - 14}">{title}, noise {NOISE.split(" ", 1)[1]}</text>')
        for line, (name, label) in enumerate(ROWS.items()):
            y, length = TOP + LINE * line, PANEL * values[name] / longest
            color = "#2a7a6f" if name.startswith("pointfair") else "#b9c4cf"
            if number == 0:
                parts.append(f'<text x="{LEFT - 10}" y="{y + 15}" text-anchor="end">{label}</text>')
            parts.append(f'<rect x="{x}" y="{y}" width="{length:.1f}" height="20" fill="{color}"/>'
                         f'<text x="{x + length + 6:.1f}" y="{y + 15}">{values[name]:.3f}</text>')
    return "\n".join([*parts, "</svg>", ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="only compare")
    options = parser.parse_args()
    drawn = chart(PAGE.read_text())
    if not options.check:
        PICTURE.write_text(drawn)
    elif not PICTURE.exists() or PICTURE.read_text() != drawn:
        sys.exit(f"{PICTURE.relative_to(ROOT)} is not what the tables of {PAGE.relative_to(ROOT)} say: run scripts/chart.py")


if __name__ == "__main__":
    main()
