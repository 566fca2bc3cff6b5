#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""make demo: denoises a noisy Armadillo, whose true surface is known, and a scanned building, whose is not. Prints the errors
and times, and leaves clouds and pictures in build/demo. The models come from Debian's libcgal-demo."""
import json
import pathlib
import subprocess
import tempfile

import models

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "build/demo"
POINTFAIR, PICTURE = ROOT / "build/bin/pointfair", ROOT / "build/bin/picture"
SEED = 1


def pointfair(*arguments):
    """Runs a verb and returns its JSON report."""
    command = [str(a) for a in arguments]
    shown = " ".join(a.replace(str(ROOT) + "/", "") for a in command)
    print("$ pointfair", shown, flush=True)
    wants_report = command[0] in ("run", "compare")
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "report.json"
        more = ["--report", report] if wants_report else []
        subprocess.run([POINTFAIR, *command, *more], check=True, stdout=subprocess.DEVNULL)
        return json.loads(report.read_text()) if wants_report else None


def percent(compared, key):
    return f"{100 * compared[key] / compared['diagonal']:.4f} %"


def print_table(rows):
    widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]))]
    for row in rows:
        print("  " + row[0].ljust(widths[0]), *(cell.rjust(width + 2) for cell, width in zip(row[1:], widths[1:])))


models.fetch(OUT)
mesh, noisy, denoised = OUT / "armadillo.off", OUT / "noisy.ply", OUT / "denoised.ply"
pointfair("noise", mesh, noisy, "--points", 200000, "--sigma", "0.3%", "--seed", SEED, "--force")
armadillo = pointfair("run", noisy, denoised, "--force")
distance_before, distance_after = pointfair("compare", noisy, mesh), pointfair("compare", denoised, mesh)
building = pointfair("run", OUT / "building.ply", OUT / "building_denoised.ply", "--force")
for before, after, out, angles in ((noisy, denoised, "before_after.png", (200, 8)),
                                   (OUT / "building.ply", OUT / "building_denoised.ply", "building_before_after.png", (0, -40))):
    subprocess.run([PICTURE, before, after, "--out", OUT / out, "--angles", *map(str, angles)], check=True)

print(f"\nArmadillo, {armadillo['points']} points, noise 0.3 %: distance to the true surface, of the diagonal\n")
print_table([["", "before", "after"]] + [[key, percent(distance_before, key), percent(distance_after, key)] for key in ("mean", "rms", "p95")])
print("\nNoise estimated on the input and mean displacement, in file units\n")
print_table([["", "noise", "moved"]] + [[name, f"{r['noise']['before']:.4f}", f"{r['displacement']['mean']:.4f}"]
                                        for name, r in (("armadillo", armadillo), ("building", building))])
print(f"\nMilliseconds on {armadillo['device']['name']}\n")
names = list(dict.fromkeys(stage["name"] for r in (armadillo, building) for stage in r["stages"]))
rows = [["", *names, "total"]]
for name, r in (("armadillo", armadillo), ("building", building)):
    times = {stage["name"]: stage["ms"] for stage in r["stages"]}
    rows.append([name, *(f"{times[n]:.1f}" if n in times else "-" for n in names), f"{r['total_ms']:.1f}"])
print_table(rows)
print(f"\nClouds and pictures: {OUT.relative_to(ROOT)}: noisy.ply, denoised.ply, building_denoised.ply, before_after.png, building_before_after.png")
