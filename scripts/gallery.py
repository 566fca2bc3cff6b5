#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""make gallery: runs the examples of examples/python and draws what they did, into docs/pictures. All data is made
here, with fixed seeds.

    scripts/gallery.py --dist dist [NAME..]

The packages come from PyPI into build/gallery; ends with 77 where they cannot be installed."""
import argparse
import os
import pathlib
import subprocess
import sys
import tempfile
import venv

ROOT = pathlib.Path(__file__).resolve().parent.parent
PICTURES, WORK = ROOT / "docs/pictures", ROOT / "build/gallery"
PICTURE = ROOT / "build/bin/picture"
REQUIREMENTS = ["laspy", "pillow", "pyvista", "scipy", "torch"]
GROUND, VEGETATION, BUILDING = 2, 5, 6


def make_python(wheel):
    """The Python of an environment with the wheel and what the examples use."""
    done = WORK / "installed"
    pip = [WORK / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    if not done.exists() or done.read_text() != f"{sys.version}{REQUIREMENTS}":
        venv.create(WORK, with_pip=True, clear=True)
        if subprocess.run([*pip, *REQUIREMENTS, wheel]).returncode != 0:
            print(f"skipped: {' '.join(REQUIREMENTS)} cannot be installed here")
            sys.exit(77)
        done.write_text(f"{sys.version}{REQUIREMENTS}")
    subprocess.run([*pip, "--force-reinstall", "--no-deps", wheel], check=True)
    return WORK / "bin/python"


def draw(clouds, name, *camera, panel=(480, 400)):
    """Clouds side by side, as clay; y is up."""
    import pointfair as pf
    with tempfile.TemporaryDirectory() as folder:
        files = [pathlib.Path(folder) / f"{number}.ply" for number in range(len(clouds))]
        for file, cloud in zip(files, clouds):
            pf.write(file, cloud)
        command = [PICTURE, *files, "--out", PICTURES / f"{name}.png", "--panel", *panel, *camera]
        subprocess.run(list(map(str, command)), check=True)
    print(f"{name}.png: {(PICTURES / f'{name}.png').stat().st_size // 1024} KiB")


def tile(seed=1):
    """Ground, a house with a pitched roof, and trees, at UTM coordinates: positions and classes. Noise of 3 cm."""
    import numpy as np
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 40, (2, 260_000))
    z, kind = 0.6 * np.sin(x / 9) + 0.4 * np.cos(y / 7), np.full(len(x), GROUND)
    in_house = (abs(x - 16) < 6) & (abs(y - 20) < 8)
    z[in_house], kind[in_house] = 7.5 - 0.6 * abs(x[in_house] - 16), BUILDING
    chimney = in_house & (abs(x - 18.5) < 0.6) & (abs(y - 23) < 0.6)
    z[chimney] = 8.4
    parts = [(np.c_[x, y, z + rng.normal(0, 0.03, len(x))], kind)]
    for tx, ty in ((31, 9), (33, 16), (30, 29), (6, 35)):
        crown = rng.normal(0, 1, (9000, 3))
        crown *= (rng.uniform(0, 1, (9000, 1)) ** 0.4) / np.linalg.norm(crown, axis=1, keepdims=True)
        parts.append((crown * (2.6, 2.6, 3.2) + (tx, ty, 5.5), np.full(9000, VEGETATION)))
    return np.concatenate([xyz for xyz, _ in parts]) + (500_000, 5_800_000, 120), np.concatenate([kind for _, kind in parts])


def draw_tile():
    import laspy
    import laspy_tile
    import numpy as np
    xyz, kind = tile()
    las = laspy.create(point_format=6, file_version="1.4")
    las.header.offsets, las.header.scales = [500_000, 5_800_000, 0], [0.001] * 3
    las.xyz, las.classification = xyz, kind
    with tempfile.TemporaryDirectory() as folder:
        las.write(f"{folder}/tile.las")
        print(laspy_tile.denoise_tile(f"{folder}/tile.las", f"{folder}/smooth.las"))
        clouds = [np.asarray(laspy.read(f"{folder}/{name}.las").xyz) - (500_000, 5_800_000, 120) for name in ("tile", "smooth")]
    draw([cloud[:, [0, 2, 1]] * (1, 1, -1) for cloud in clouds], "example_tile", "--angles", -50, 25, "--zoom", 1.5)


def simulated_frame(seed=1):
    """What a depth camera of 480 x 360 pixels sees of a desk with a ball. Noise grows with the squared depth."""
    import numpy as np
    rng = np.random.default_rng(seed)
    column, row = np.meshgrid(np.arange(480) - 239.5, np.arange(360) - 179.5)
    rays = np.stack([column / 420, row / 420, np.ones_like(column)], -1).reshape(-1, 3)
    depth = np.minimum(np.where(rays[:, 1] > 0.02, 0.35 / np.maximum(rays[:, 1], 0.02), 9), 2.2)
    center, radius = np.array([0.1, 0.13, 1.1]), 0.22
    along, squared = rays @ center, (rays**2).sum(1)
    root = along**2 - squared * (center @ center - radius**2)
    hit = root > 0
    depth[hit] = np.minimum(depth[hit], (along[hit] - np.sqrt(root[hit])) / squared[hit])
    return (rays * (depth + rng.normal(0, 0.0015, len(depth)) * depth**2)[:, None]).astype(np.float32)


def draw_frame():
    import sensor_stream
    points = simulated_frame()
    smooth, = sensor_stream.denoise_frames([points], "cpu")
    draw([cloud * (1, -1, -1) for cloud in (points, smooth)], "example_frame", "--angles", 25, 20, "--zoom", 1.4)


def shapes(count=4096, noise=0.01, seed=1):
    """A ball, a ring, a cube and a wave of about unit size: (4, count, 3) float32."""
    import numpy as np
    rng = np.random.default_rng(seed)
    ball = rng.normal(0, 1, (count, 3))
    ball /= 2 * np.linalg.norm(ball, axis=1, keepdims=True)
    a, b = rng.uniform(0, 2 * np.pi, (2, count))
    ring = np.c_[(0.36 + 0.14 * np.cos(b)) * np.cos(a), (0.36 + 0.14 * np.cos(b)) * np.sin(a), 0.14 * np.sin(b)]
    cube = rng.uniform(-0.42, 0.42, (count, 3))
    cube[np.arange(count), rng.integers(0, 3, count)] = rng.choice([-0.42, 0.42], count)
    x, y = rng.uniform(-0.5, 0.5, (2, count))
    wave = np.c_[x, y, 0.1 * np.sin(9 * x) * np.cos(7 * y)]
    clean = np.stack([ball, ring, cube, wave])
    return (clean + rng.normal(0, noise, clean.shape)).astype(np.float32)


def draw_batch():
    import numpy as np
    import torch
    import torch_batches
    noisy = [torch.from_numpy(cloud) for cloud in shapes()]
    batches = torch.stack(noisy).numpy(), torch_batches.denoised(noisy).numpy()
    places = np.array([(-0.6, 0.6, 0), (0.6, 0.6, 0), (-0.6, -0.6, 0), (0.6, -0.6, 0)])[:, None]
    draw([np.concatenate(batch + places) for batch in batches], "example_batch", "--angles", 20, 40)


def draw_before_after():
    import pyvista_before_after
    from PIL import Image
    path = PICTURES / "python_before_after.png"
    pyvista_before_after.draw(pyvista_before_after.ripples(), str(path))
    Image.open(path).quantize(128).save(path, optimize=True)  # half the bytes, and nobody sees it


DRAWN = {"tile": draw_tile, "frame": draw_frame, "batch": draw_batch, "before_after": draw_before_after}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dist", type=pathlib.Path, help="where the wheel is; without it, this Python has all packages")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of the pictures: {', '.join(DRAWN)} (default: all)")
    options = parser.parse_args()
    if options.dist:
        wheel, = options.dist.glob("pointfair-*.whl")
        python = make_python(wheel.resolve())
        os.execv(python, [python, __file__, *options.names])  # Python finds its packages by the name it is called by
    sys.path.insert(0, str(ROOT / "examples/python"))
    for name in options.names or DRAWN:
        DRAWN[name]()


if __name__ == "__main__":
    main()
