#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Times reading and writing LAZ against lazrs' parallel codec (PyPI), in turns in one run: medians in millions of points
a second, and the processor time (user and system) of a million points, which other programs on the machine disturb
less. pointfair reads a file into points, and writes it with every point moved; lazrs decodes the same file into records
in memory, and encodes these into memory. It has no waveforms (point formats 4 and 5).

make bench-laz runs it; bench/laz.py --points 1000000 --rounds 1 is a quick look."""
import argparse
import io
import json
import pathlib
import statistics
import struct
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "outside"))


WAVEFORMS = (4, 5)


def packages(folder):
    import packages
    return packages.use(folder, ["laspy==2.7.0", "lazrs==0.8.2", "laszip==0.3.0", "numpy"], ["numpy", "laspy", "lazrs"])


def make(np, laspy, path, count, point_format):
    """A survey from the air: scan lines over a terrain, a third of the points in vegetation."""
    rng = np.random.default_rng(1)
    header = laspy.LasHeader(point_format=point_format, version="1.4" if point_format >= 6 else "1.3")
    header.scales, header.offsets = [0.001] * 3, [500000, 5400000, 0]
    las, i, per_line = laspy.LasData(header), np.arange(count), 2000
    line, k = i // per_line, i % per_line
    forward = line % 2 == 0
    k = np.where(forward, k, per_line - 1 - k)
    x, y = 500000 + k * 0.25 + rng.normal(0, .02, count), 5400000 + line * 0.4 + rng.normal(0, .02, count)
    high = rng.random(count) < 0.3
    z = 100 + 10 * np.sin((x - 500000) / 40) + 8 * np.cos((y - 5400000) / 60) + rng.normal(0, .03, count)
    z += np.where(high, rng.random(count) * 15, 0)
    las.x, las.y, las.z = x, y, z
    returns = np.where(high, rng.integers(1, 4, count), 1)
    las.number_of_returns = returns.astype(np.uint8)
    las.return_number = np.minimum(returns, rng.integers(1, 4, count)).astype(np.uint8)
    las.intensity = rng.gamma(4, 300, count).clip(0, 65535).astype(np.uint16)
    las.classification = np.where(high, 5, 2).astype(np.uint8)
    las.scan_direction_flag = forward.astype(np.uint8)
    las.point_source_id = (line // 500).astype(np.uint16)
    if point_format >= 6:
        las.scan_angle = ((k - 1000) * 3).astype(np.int16)
    else:
        las.scan_angle_rank = ((k - 1000) // 50).astype(np.int8)
    if point_format != 0 and point_format != 2:
        las.gps_time = 3e8 + i * 2e-6 * (1 + (i % 3 == 0))
    if point_format in (2, 3, 5, 7, 8, 10):
        shade = (z * 100) % 30000
        for name, factor in (("red", 1), ("green", .8), ("blue", .5)):
            las[name] = (shade * factor + rng.integers(0, 2000, count)).astype(np.uint16) // 256 * 256
    backends = laspy.LazBackend
    las.write(str(path), laz_backend=backends.Laszip if point_format in WAVEFORMS else backends.LazrsParallel)


def lazrs_times(np, laspy, lazrs, path):
    data = path.read_bytes()
    at, begin, record = struct.unpack_from("<H", data, 94)[0], struct.unpack_from("<I", data, 96)[0], None
    while at < begin and record is None:
        number, size = struct.unpack_from("<HH", data, at + 18)
        record = data[at + 54:at + 54 + size] if number == 22204 else None
        at += 54 + size
    with laspy.open(str(path)) as file:
        points = np.zeros(file.header.point_count * file.header.point_format.size, np.uint8)
    points[:] = 1  # its pages are there
    clocks = lambda: np.array([time.monotonic(), time.process_time()])
    start = clocks()
    source = io.BytesIO(data)
    source.seek(begin)
    lazrs.ParLasZipDecompressor(source, record).decompress_many(points)
    read, start = clocks() - start, clocks()
    encoder = lazrs.ParLasZipCompressor(io.BytesIO(), lazrs.LazVlr(record))
    encoder.compress_many(points)
    encoder.done()
    return read, clocks() - start


def cells(ours, theirs, millions):
    """Of seconds by clock and of processor: both rates and how many times faster ours is, then the same of the other."""
    row = []
    for clock, figure in ((0, lambda seconds: millions / seconds), (1, lambda seconds: seconds / millions)):
        mine = statistics.median(pair[clock] for pair in ours)
        other = statistics.median(float(pair[clock]) for pair in theirs) if theirs else None
        row += [f"{figure(mine):.2f}", f"{figure(other):.2f}" if other else "-", f"{other / mine:.2f}" if other else "-"]
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=10_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--formats", default="0,1,2,3,4,5,6,7")
    parser.add_argument("--build", default="build", help="where bin/bench_laz is; files of 150 MB go beside it")
    options = parser.parse_args()
    folder = pathlib.Path(options.build).resolve()
    np, laspy, lazrs = packages(folder / "tests" / "packages")
    print(f"{options.points} points, {options.rounds} rounds; millions of points a second")
    print("| point format | read | lazrs | times | s/M | lazrs | times | write | lazrs | times | s/M | lazrs | times | peak bytes a point |")
    print("|" + "---|" * 14)
    for point_format in map(int, options.formats.split(",")):
        path, out = folder / f"bench_{point_format}.laz", folder / "bench_out.laz"
        make(np, laspy, path, options.points, point_format)
        ours, theirs = [], []
        for _ in range(options.rounds):
            done = subprocess.run([folder / "bin" / "bench_laz", path, out], capture_output=True, text=True, check=True)
            ours.append(json.loads(done.stdout))
            if point_format not in WAVEFORMS:
                theirs.append(lazrs_times(np, laspy, lazrs, path))
        row = []
        for i, what in enumerate(("read", "write")):
            row += cells([o[what] for o in ours], [t[i] for t in theirs], options.points / 1e6)
        peak = max(o["peak"] for o in ours) / options.points
        print(f"| {point_format} | " + " | ".join(row) + f" | {peak:.0f} |", flush=True)
        path.unlink()
        out.unlink()


if __name__ == "__main__":
    main()
