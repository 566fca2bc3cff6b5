# SPDX-License-Identifier: Apache-2.0
"""The judge's rows as tables of text."""
import numpy as np

from families import FAMILIES

FLOOR = 1e-3                                      # of the spacing: errors below it count as it
CLEARLY_WORSE = 1.10                              # times the baseline's error


def geometric(values: list[float]) -> float:
    return float(np.exp(np.mean(np.log(values)))) if values else float("nan")


def ratio(row: dict, of: str, to: str, which: str = "mean") -> float:
    """An error over another, both at least a thousandth of the spacing."""
    floor = FLOOR * row["before"]["spacing"]
    return max(row[of][which], floor) / max(row[to][which], floor)


def aligned(lines: list[list[str]], left: int = 1) -> str:
    """Columns, the first ones to the left."""
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]

    def laid_out(line: list[str]) -> str:
        return "  ".join(cell.ljust(widths[k]) if k < left else cell.rjust(widths[k]) for k, cell in enumerate(line))

    return "\n".join(map(laid_out, lines))


def _number(value: float) -> str:
    return "" if value != value else f"{value:.2f}"


def _percent(values: list[float], digits: int = 0) -> str:
    return f"{100 * np.mean(values):.{digits}f}" if values else ""


def _noisy_cells(rows: list[dict], baseline: bool, bounds: bool) -> list[str]:
    results = [row["after"] for row in rows]
    ratios = {which: [ratio(row, "after", "before", which) for row in rows] for which in ("mean", "rms")}
    cells = [_number(geometric([row["before"]["sigma"] / row["before"]["spacing"] for row in rows])),
             _number(geometric(ratios["mean"])), _number(geometric(ratios["rms"])), _number(max(ratios["rms"])),
             _percent([result["worse"] for result in results], 1),
             *(_percent([result[share] for result in results]) for share in ("within_25", "within_50")),
             _number(float(np.exp(np.mean([result["log_bias"] for result in results])))),
             _percent([result["loose"] for result in results if "loose" in result])]
    if baseline:
        ratios = {which: [ratio(row, "after", "baseline", which) for row in rows] for which in ("mean", "rms")}
        cells += [_number(geometric(ratios["mean"])), _number(geometric(ratios["rms"])),
                  _percent([r > CLEARLY_WORSE for r in ratios["mean"]]), _number(max(ratios["mean"], default=float("nan")))]
    if bounds:
        cells += [_number(geometric([ratio(row, "told", "before") for row in rows])),
                  _number(geometric([ratio(row, "width", "before") for row in rows])),
                  _number(geometric([row["factor"] for row in rows]))]
    return cells


def _noisy_head(baseline: bool, bounds: bool) -> list[str]:
    return ["family", "clouds", "noise", "mean", "rms", "worst", "worse%", "in25%", "in50%", "said", "loose%",
            *(["b.mean", "b.rms", "b.>1.1%", "b.worst"] if baseline else []), *(["told", "width", "wider"] if bounds else [])]


def _usable(rows: list[dict], baseline: bool, bounds: bool) -> list[dict]:
    needed = ["after", *(["baseline"] if baseline else []), *(["told"] if bounds else [])]
    return [row for row in rows if all("failed" not in row.get(key, {}) for key in needed)]


def noisy_table(rows: list[dict], baseline: bool, bounds: bool) -> str:
    """A line a family, then groups of families."""
    lines = [_noisy_head(baseline, bounds)]

    def add(name: str, chosen: list[dict]) -> None:
        if chosen:
            lines.append([name, str(len(chosen)), *_noisy_cells(chosen, baseline, bounds)])

    for name in FAMILIES:
        add(name, [row for row in rows if row["family"] == name])
    lines.append([""] * len(lines[0]))
    for group in ("scans", "objects", "special"):
        add(f"all {group}", [row for row in rows if FAMILIES[row["family"]].group == group])
    add("all correlated", [row for row in rows if FAMILIES[row["family"]].correlated])
    add("all others", [row for row in rows if not FAMILIES[row["family"]].correlated])
    add("all", rows)
    return aligned(lines)


def clean_table(rows: list[dict], baseline: bool) -> str:
    """How far clouds without noise move, in spacings."""
    lines = [["no noise", "clouds", "moved", "most", *(["b.moved", "b.most"] if baseline else [])]]
    for name in FAMILIES:
        chosen = [row for row in rows if row["family"] == name]
        if chosen:
            cells = []
            for key in ("after", *(["baseline"] if baseline else [])):
                moved, most = ([row[key][what] for row in chosen] for what in ("moved", "moved_most"))
                cells += [f"{np.mean(moved):.4f}", f"{max(most):.3f}"]
            lines.append([name, str(len(chosen)), *cells])
    return aligned(lines) if len(lines) > 1 else ""


def failures(rows: list[dict]) -> str:
    """A line for each run that failed."""
    return "\n".join(f"{row['family']}-{row['seed']}, {key}: {row[key]['failed']}" for row in rows
                     for key in ("after", "baseline", "told") if "failed" in row.get(key, {}))


def by_family(rows: list[dict], baseline: bool, bounds: bool) -> str:
    """All tables."""
    clean = _usable([row for row in rows if row["before"]["clean"]], baseline, False)
    noisy = _usable([row for row in rows if not row["before"]["clean"]], baseline, bounds)
    seconds = [row["after"].get("seconds", 0) for row in rows]
    parts = [noisy_table(noisy, baseline, bounds) if noisy else "", clean_table(clean, baseline), failures(rows),
             f"the program took {sum(seconds):.1f} s for {len(rows)} clouds, one thread each"]
    return "\n\n".join(part for part in parts if part)
