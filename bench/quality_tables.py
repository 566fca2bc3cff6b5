# SPDX-License-Identifier: Apache-2.0
"""Tables of quality in Markdown, and the marks of a page between which they stand."""
import math
import re
import sys

TITLES = {"chamfer": "Chamfer distance x 1e-4", "squared": "Mean squared distance to the mesh x 1e-4",
          "mean": "Mean distance, % of the diagonal", "edge": "Edge rms, % of the diagonal",
          "normals": "Mean error of normals, degrees", "seconds": "Processor seconds on one thread, files included"}


class Row:
    """A line of each table."""

    def __init__(self, contender):
        self.contender, self.cells, self.seeds = contender, {}, []

    def seeds_text(self):
        return "-".join(map(str, sorted({min(self.seeds), max(self.seeds)})))


def table(header, rows):
    return "\n".join("| " + " | ".join(row) + " |" for row in [header, ["---"] * len(header), *rows]) + "\n"


def cell_text(figure, value):
    return "" if value is None else f"{value:.2g}" if figure == "seconds" else f"{value:.3g}"


def best_peers(rows):
    """{(figure, column): the best of all peers}, times left out."""
    best = {}
    for row in rows:
        if row.contender.is_peer:
            for cell, value in row.cells.items():
                if cell[0] != "seconds":
                    best[cell] = min(value, best.get(cell, math.inf))
    return best


def figure_table(rows, figure, columns):
    """Markdown; a cell of the default run that the best of the peers beats is bold."""
    best, lines = best_peers(rows), []
    for row in rows:
        if not any((figure, column) in row.cells for column in columns):
            continue
        line = []
        for column in columns:
            value = row.cells.get((figure, column))
            text = cell_text(figure, value)
            is_lost = row.contender.name == "pointfair" and value is not None and value > best.get((figure, column), math.inf)
            line.append(f"**{text}**" if is_lost else text)
        lines.append([row.contender.name, row.seeds_text(), *line])
    return table(["", "seeds", *columns], lines)


def verdict(rows, figures):
    """In which cells CGAL's bilateral filter, and the best of all peers, leaves less than the default run; only cells for
    which the whole sweep is known count."""
    ours = next(row for row in rows if row.contender.name == "pointfair")
    swept = [row for row in rows if row.contender.is_peer and len(row.contender.settings) > 1]
    bilateral = [row for row in swept if row.contender.program == "cgal_bilateral"]
    text = []
    for name, peers in (("CGAL's bilateral filter at its best", bilateral),
                        ("the best of " + ", ".join(row.contender.name.split(",")[0] for row in swept), swept)):
        best = best_peers(peers)
        compared = [cell for cell in ours.cells if cell[0] in figures and best and all(cell in row.cells for row in peers)]
        if compared:
            lost = [f"{TITLES[figure].split(',')[0].lower()} {column} ({100 * (ours.cells[figure, column] / best[figure, column] - 1):+.1f} %)"
                    for figure, column in compared if ours.cells[figure, column] > best[figure, column]]
            text.append(f"{name[0].upper() + name[1:]} leaves less than the default run in {len(lost) or 'none'} of {len(compared)} cells"
                        + (f": {'; '.join(lost)}." if lost else "."))
    return "\n".join(text) + "\n"


def tables(rows, figures, columns):
    """Markdown of one set of cases."""
    primary = [figure for figure in figures if figure not in ("normals", "seconds")]
    parts = [f"{TITLES[figure]}:\n\n{figure_table(rows, figure, columns)}" for figure in figures]
    return "\n".join([verdict(rows, primary), *parts])


def put(page, name, text):
    """Between the marks of the page, if one is given and has them, else on standard output."""
    block = f"<!-- quality {name} -->\n{text}<!-- end -->"
    if page is None:
        print(text, flush=True)
        return
    old = page.read_text()
    new, count = re.subn(rf"<!-- quality {re.escape(name)} -->\n.*?<!-- end -->", lambda _: block, old, flags=re.S)
    if count == 0:
        sys.exit(f"{page}: no mark <!-- quality {name} -->")
    page.write_text(new)
