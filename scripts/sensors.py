#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Part of make gallery: a scan of each kind of sensor, simulated, before and after a default run, into docs/pictures/sensors. The
scenes are made up (training/), with fixed seeds.

    scripts/sensors.py PROGRAM PICTURE [NAME..]     build/bin/pointfair build/bin/picture

Needs numpy, scipy and pillow; ends with 77 where they are missing."""
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "training"))
os.environ.pop("POINTFAIR_DATA", None)  # objects are made up, too
try:
    import numpy as np
    from PIL import Image

    import case_clouds
    import families
except ImportError as error:
    print(f"skipped: {error.name} is missing")
    sys.exit(77)

FOLDER = ROOT / "docs/pictures/sensors"
# name: family, seed, degrees from the sensor's own view (to the side, up), zoom
SCANS = {
    "terrestrial": ("terrestrial", 4, (10, 10), 1.6),
    "street": ("terrestrial_street", 3, (20, 15), 1.3),
    "vehicle": ("spinning_accumulated", 1, (20, 25), 4),
    "structured_light": ("structured_light", 2, (10, 0), 1.3),
    "structured_light_steps": ("structured_light_steps", 3, (10, 0), 1.2),
    "stereo": ("stereo_windows", 3, (10, 0), 1.2),
    "time_of_flight": ("time_of_flight", 2, (10, 0), 1.1),
    "airborne_village": ("airborne_village", 3, (40, -50), 1.3),
    "airborne_terrain": ("airborne_terrain", 1, (40, -65), 2.5),
    "airborne_forest": ("airborne_forest", 1, (40, -65), 2),
    "photogrammetry": ("photogrammetry_object", 3, (20, 0), 1.1),
    "turntable": ("multiview_object", 3, (20, 0), 1.1),
}


def view_of(cloud):
    """Azimuth and elevation of the sensor, in degrees, as the picture has them; of objects seen from all sides, a usual view."""
    if cloud.sensor is None:
        return 25.0, 20.0
    to = np.nanmean(cloud.sensor, axis=0) - cloud.points.mean(axis=0)
    flat = np.hypot(to[0], to[1])
    if flat < 0.2 * np.ptp(cloud.points, axis=0).max():
        return 25.0, 60.0 if to[2] > flat else 20.0
    return float(np.degrees(np.arctan2(to[0], -to[1]))), float(np.degrees(np.arctan2(to[2], flat)))


def positions(path):
    """Of a binary PLY of floats x, y, z."""
    data = path.read_bytes()
    return np.frombuffer(data[data.index(b"end_header\n") + 11:], "<f4").reshape(-1, 3).astype(float)


def draw(name, program, picture):
    family, seed, turn, zoom = SCANS[name]
    cloud = families.draw(family, seed)
    with tempfile.TemporaryDirectory() as folder:
        before, after = (pathlib.Path(folder) / f"{word}.ply" for word in ("before", "after"))
        turned = cloud.points[:, [0, 2, 1]] * (1, 1, -1)  # y is up in pictures
        case_clouds.write(before, turned.astype(np.float32))
        subprocess.run([program, "run", before, after, "--quiet"], check=True, capture_output=True)
        moved = positions(after)[:, [0, 2, 1]] * (1, -1, 1)
        azimuth, elevation = view_of(cloud)
        path = FOLDER / f"{name}.png"
        subprocess.run([picture, before, after, "--out", path, "--angles", str(azimuth + turn[0]), str(min(85.0, max(5.0, elevation + turn[1]))),
                        "--zoom", str(zoom), "--panel", "440", "330"], check=True)
    Image.open(path).quantize(40).save(path, optimize=True)
    caster = cloud.caster()
    off = [caster.distance(points[cloud.surface].astype(float)).mean() * 1e3 for points in (cloud.points, moved)]
    print(f"{name}: {len(moved):,} points, {off[0]:.3g} mm off the surface on average, then {off[1]:.3g} mm; {path.stat().st_size // 1024} KiB")


def main():
    program, picture, *names = sys.argv[1:]
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or SCANS:
        draw(name, program, picture)


if __name__ == "__main__":
    main()
