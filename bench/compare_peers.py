#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares pointfair with the programs of bench/peers and the smoothers of Open3D and PyMeshLab (bench/smoothers.py), and with itself
on difficult clouds.

Everything is measured in one go on the same files: contenders take turns, round after round, so that a slow minute of
the machine hits all of them; a ratio is the median of the rounds' ratios. Prints Markdown, part by part. Needs a build
with -DPOINTFAIR_BENCH=ON (`make bench` does all of it), and the Armadillo of Debian's libcgal-demo or --mesh.
A quick look: bench/compare_peers.py --points 100000 --rounds 1 --only plain_pipeline uneven
"""
import argparse
import array
import contextlib
import hashlib
import json
import math
import os
import platform
import statistics
import subprocess
import sys
import tarfile
from dataclasses import dataclass
from pathlib import Path

SAME_FORMULAS = ["--iterations", "1", "--area-weight", "squared"]  # what plain_pipeline computes


@dataclass(frozen=True)
class Peer:
    """A program of bench/peers and how it is compared."""

    program: str
    title: str
    ks: tuple  # neighbourhood sizes
    orders: tuple = ("input",)
    slow: bool = False  # one round only
    moves: bool = True  # has a result whose quality can be measured


PEERS = (
    Peer("nanoflann_knn", "nanoflann, neighbours alone", (8, 32), ("input", "morton"), moves=False),
    Peer("plain_pipeline", "plain pipeline over nanoflann", (8, 32), ("input", "morton")),
    Peer("cgal_bilateral", "CGAL bilateral_smooth_point_set", (24,), slow=True),
    Peer("cgal_jet", "CGAL jet_smooth_point_set", (24,), slow=True),
    Peer("pcl_mls", "PCL MovingLeastSquares", (48,), slow=True),
    Peer("open3d_mls", "Open3D smooth_mls", (30,), slow=True),
    Peer("open3d_bilateral", "Open3D smooth_bilateral", (30,), slow=True),
    Peer("open3d_laplacian", "Open3D smooth_laplacian", (20,), slow=True),
    Peer("open3d_taubin", "Open3D smooth_taubin", (20,), slow=True),
    Peer("pymeshlab_apss", "PyMeshLab APSS", (16,), slow=True),
    Peer("pymeshlab_rimls", "PyMeshLab RIMLS", (16,), slow=True),
)
# How many times faster pointfair means to be.
GOALS = {("plain_pipeline", 8, "input"): 10, ("plain_pipeline", 32, "input"): 9}


def note(text):
    print(text, file=sys.stderr, flush=True)


def run(command):
    """Runs a program; returns its standard output and the most memory that it ever held, in bytes."""
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, text=True)
    output = process.stdout.read()
    process.stdout.close()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"stopped: exit code {process.returncode} of {' '.join(map(str, command))}")
    return output, usage.ru_maxrss * 1024


def alternate(rounds, contenders, once=()):
    """Lets each contender, a function, measure in turn; returns each one's results, in round order."""
    results = {name: [] for name in contenders}
    for number in range(rounds):
        for name, measure in contenders.items():
            if number == 0 or name not in once:
                note(f"round {number + 1} of {rounds}: {name}")
                results[name].append(measure())
    return results


def ratio(above, below):
    """Median of the rounds' ratios; what was measured in one round only meets the other's first."""
    return statistics.median(a / b for a, b in zip(above, below))


def table(header, rows):
    lines = ["| " + " | ".join(row) + " |" for row in [header, ["---"] * len(header), *rows]]
    return "\n".join(lines) + "\n"


class Clouds:
    """The files measured on: made by `pointfair noise` from the mesh, with the same seed, or by changing bytes."""

    HEADER = ("ply\nformat binary_little_endian 1.0\nelement vertex {}\n"
              "property float x\nproperty float y\nproperty float z\nend_header\n")

    def __init__(self, pointfair, folder, mesh, points):
        self.pointfair, self.folder, self.mesh, self.points = pointfair, folder, mesh, points
        self.made = {}

    def sampled(self, name, points, *flags, sigma="0.1%"):
        if name not in self.made:
            self.made[name] = self.folder / f"{name}.ply"
            note(f"making {self.made[name]}")
            run([self.pointfair, "noise", self.mesh, self.made[name], "--points", points, "--sigma", sigma,
                 "--seed", 1, "--force", "-q", *flags])
        return self.made[name]

    def even(self):
        return self.sampled("even", self.points)

    def uneven(self):
        return self.sampled("uneven", self.points, "--uneven", "50")

    def large(self):
        """Ten times the points and the same noise, which is 3.2 times as many spacings."""
        return self.sampled("large", 10 * self.points)

    def large_alike(self):
        """Ten times the points, noise of as many spacings as the even cloud has."""
        return self.sampled("large_alike", 10 * self.points, sigma=f"{0.1 / math.sqrt(10):.6f}%")

    def read_even(self):
        data = self.even().read_bytes()
        header = self.HEADER.format(self.points).encode()
        body = data[data.index(b"end_header\n") + 11:]
        if len(body) != 12 * self.points:
            sys.exit(f"{self.even()}: not {self.points} points of three floats; bench/peers read only such files")
        return header, array.array("f", body)

    def write(self, name, header, coordinates):
        path = self.folder / f"{name}.ply"
        path.write_bytes(header + coordinates.tobytes())
        return path

    def stray(self):
        """The even cloud with its last point a million diagonals away."""
        header, values = self.read_even()
        diagonal = math.dist(*([edge(values[axis::3]) for axis in range(3)] for edge in (min, max)))
        values[-3] += 1e6 * diagonal
        return self.write("stray", header, values)

    def identical(self):
        header, values = self.read_even()
        return self.write("identical", header, values[:3] * self.points)


class Bench:
    """One session: programs, clouds, and the settings of every measurement."""

    def __init__(self, options, clouds):
        self.options, self.clouds = options, clouds
        self.pointfair = clouds.pointfair

    def time(self, cloud, k, *flags, threads=None):
        """`pointfair bench` as a dict, with the memory of the whole process added."""
        output, resident = run([self.pointfair, "bench", "--input", cloud, "--k", k, *SAME_FORMULAS, *flags,
                                "--repeat", self.options.repeat, "--threads", threads or self.options.threads,
                                "--device", "cpu", "--report", "-"])
        return json.loads(output) | {"resident_bytes": resident}

    def peer(self, peer, k, order, out=None):
        output, resident = run([self.options.build / "bin" / "peers" / peer.program, self.clouds.even(), "--k", k,
                                "--order", order, "--threads", self.options.threads,
                                "--repeat", 1 if peer.slow else self.options.repeat, *(["--out", out] if out else [])])
        return json.loads(output) | {"resident_bytes": resident}

    def distance(self, cloud):
        """Mean distance to the mesh, in percent of its diagonal."""
        report = json.loads(run([self.pointfair, "compare", cloud, self.clouds.mesh, "--report", "-"])[0])
        return 100 * report["mean"] / report["diagonal"]

    def smooth(self, name, *flags):
        """`pointfair run`; returns its report and the distance left."""
        out = self.clouds.folder / f"{name}.ply"
        report = run([self.pointfair, "run", self.clouds.even(), out, *flags, "--force", "--device", "cpu", "-q",
                      "--report", "-"])[0]
        return json.loads(report), self.distance(out)

    def compare_peers(self, peers):
        rows = [row for k in sorted({k for peer in peers for k in peer.ks})
                for row in self.compare_at(k, [peer for peer in peers if k in peer.ks])]
        text = table(["peer", "k", "order", "peer, s", "preparation, s", "pointfair, s", "times faster", "goal",
                      "peer, bytes a point", "peer leaves, %", "pointfair leaves, %"], rows)
        report, left = self.smooth("automatic")
        return text + f"""
*order*: of the points as the peer gets them; pointfair always gets them in random order. *preparation*: what the peer
needs beyond points (normals; a radius that holds k points), not counted. PyMeshLab's k is that of the normals;
its projections take about the points within 2 spacings. For the neighbours alone, pointfair's
time is that of its index and neighbours. *leaves*: mean distance to the mesh, in % of its diagonal; the noisy points
have {self.distance(self.clouds.even()):.4f}. pointfair with every parameter automatic (k {report['params']['k']}, iterations
{report['params']['iterations']}) leaves {left:.4f}, in {report['total_ms'] / 1000:.3f} s.
"""

    def compare_at(self, k, peers):
        cases = {f"{peer.program}, k {k}, {order} order": (peer, order) for peer in peers for order in peer.orders}
        outs = {peer: self.clouds.folder / f"{peer.program}_{k}.ply" for peer in peers if peer.moves}
        contenders = {f"pointfair, k {k}": lambda: self.time(self.clouds.even(), k)}
        for name, (peer, order) in cases.items():
            contenders[name] = lambda peer=peer, order=order: self.peer(peer, k, order, outs.get(peer))
        once = {name for name, (peer, _) in cases.items() if peer.slow}
        rounds = self.options.rounds if len(once) < len(cases) else 1
        ours, *theirs = alternate(rounds, contenders, once).values()
        our_distance = self.smooth(f"pointfair_{k}", "--k", k, *SAME_FORMULAS)[1] if outs else math.nan
        distances = {peer: self.distance(out) for peer, out in outs.items()}
        return [self.row(k, peer, order, ours, results, distances.get(peer), our_distance)
                for (peer, order), results in zip(cases.values(), theirs)]

    def row(self, k, peer, order, ours, theirs, their_distance, our_distance):
        our_seconds = [seconds(result, ("index", "neighbors") if not peer.moves else None) for result in ours]
        their_seconds = [result["seconds"] for result in theirs]
        goal = GOALS.get((peer.program, k, order))
        return [f"{peer.title} ({theirs[0]['library']})", str(k), order, f"{statistics.median(their_seconds):.3f}",
                f"{theirs[0]['preparation_seconds']:.1f}", f"{statistics.median(our_seconds):.3f}",
                f"{ratio(their_seconds, our_seconds):.1f}", str(goal or ""),
                f"{theirs[0]['peak_bytes'] / self.options.points:.0f}",
                f"{their_distance:.4f}" if their_distance else "", f"{our_distance:.4f}" if their_distance else ""]

    def against_even(self, cloud):
        """Time and memory of a cloud as shares of the even one's."""
        results = alternate(self.options.rounds, {"even": lambda: self.time(self.clouds.even(), 8),
                                                  cloud.stem: lambda: self.time(cloud, 8)})
        even, other = results.values()
        return (ratio(map(seconds, other), map(seconds, even)),
                other[0]["peak_bytes"]["host"] / even[0]["peak_bytes"]["host"])

    def uneven(self):
        time, memory = self.against_even(self.clouds.uneven())
        return [["density 50:1 against even: time", f"{time:.2f}", "at most 1.3"],
                ["the same: memory", f"{memory:.2f}", ""]]

    def stray(self):
        time, memory = self.against_even(self.clouds.stray())
        return [["one point a million diagonals away against none: time", f"{time:.2f}", "at most 1.1"],
                ["the same: memory", f"{memory:.2f}", "at most 1.1"]]

    def identical(self):
        time, memory = self.against_even(self.clouds.identical())
        return [["identical points against a surface: time", f"{time:.2f}", "at most 3"],
                ["the same: memory", f"{memory:.2f}", ""]]

    def linear(self):
        time, memory = self.against_even(self.clouds.large_alike())
        rows = [["ten times the points, noise of as many spacings: time", f"{time:.2f}", "at most 11"],
                ["the same: memory", f"{memory:.2f}", ""]]
        time, memory = self.against_even(self.clouds.large())
        return rows + [["ten times the points, noise of 0.1 %: time", f"{time:.2f}", "at most 11"],
                       ["the same: memory", f"{memory:.2f}", ""]]

    def threads(self):
        contenders = {f"{count} threads": lambda count=count: self.time(self.clouds.even(), 8, threads=count)
                      for count in (1, 2)}
        one, two = alternate(self.options.rounds, contenders).values()
        hashes = set()
        for count in (1, 2, 7):
            self.smooth("same_bits", "--k", 8, *SAME_FORMULAS, "--threads", count)
            hashes.add(hashlib.sha256((self.clouds.folder / "same_bits.ply").read_bytes()).hexdigest())
        speed = ratio(map(seconds, one), map(seconds, two))
        return [["two threads against one: speed", f"{speed:.2f}", "at least 1.8"],
                ["different results with 1, 2 and 7 threads", str(len(hashes) - 1), "0"]]

    def slider(self):
        result = self.time(self.clouds.even(), 8)
        share = 100 * result["similarity_only_ms"] / result["total_ms"]
        return [["only similarity_sigma changed, k 8: share of a full run", f"{share:.0f} %", "at most 15 %"]]

    def memory(self):
        rows = []
        for k in (8, 32):
            result = self.time(self.clouds.even(), k)
            rows.append([f"peak memory beside the caller's arrays, k {k}, bytes a point",
                         f"{result['peak_bytes']['host'] / self.options.points:.0f}", f"at most {100 + 8 * k}"])
            rows.append(["the same: the whole process, file and both arrays included",
                         f"{result['resident_bytes'] / self.options.points:.0f}", ""])
            rows.append([f"finding the automatic parameters, k {k}, ms (once a cloud, beside the above)",
                         f"{result['estimation_ms']:.0f}", ""])
        return rows


ROBUSTNESS = ("uneven", "stray", "identical", "linear", "threads", "slider", "memory")


def seconds(result, stages=None):
    """Of a `pointfair bench` report: the whole, or the sum of some stages."""
    if stages is None:
        return result["total_ms"] / 1000
    return sum(stage["ms"] for stage in result["stages"] if stage["name"] in stages) / 1000


def find_mesh(folder):
    """Unpacks the Armadillo from where dpkg put CGAL's demo data."""
    try:
        listed = subprocess.run(["dpkg", "-L", "libcgal-demo"], capture_output=True, text=True, check=True).stdout
        archive = next(path for path in listed.split() if path.endswith("data.tar.gz"))
    except (OSError, subprocess.CalledProcessError, StopIteration):
        sys.exit("the Armadillo is missing: apt-get install libcgal-demo, or give --mesh FILE")
    with tarfile.open(archive) as files:
        member = next(member for member in files if member.name.endswith("/armadillo.off"))
        mesh = folder / "armadillo.off"
        mesh.write_bytes(files.extractfile(member).read())
    return mesh


def first_line(path, key):
    for line in Path(path).read_text().splitlines():
        if line.startswith(key):
            return line.split("=" if "=" in line else ":", 1)[1].strip().strip('"')
    return "unknown"


def environment(options):
    return f"""{first_line('/proc/cpuinfo', 'model name')}, {os.cpu_count()} cores;
{first_line('/etc/os-release', 'PRETTY_NAME')}, Linux {platform.release()}; load before the start {os.getloadavg()[0]:.1f}.
{options.points:,} points of the {options.mesh.stem} in random order, noise 0.1 % of the diagonal, {options.threads} threads,
array to array, index included, one pass. Median of {options.rounds} rounds in turn, each the median of {options.repeat} runs (CGAL,
PCL, Open3D and PyMeshLab: one run).
"""


def parse_options():
    root = Path(__file__).resolve().parent.parent
    names = [peer.program for peer in PEERS]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=root / "build", help="folder of the build (default: build)")
    parser.add_argument("--mesh", type=Path, help="default: the Armadillo of libcgal-demo")
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3, help="how often the contenders take turns")
    parser.add_argument("--repeat", type=int, default=3, help="runs of a contender in its turn")
    parser.add_argument("--only", nargs="+", choices=[*names, *ROBUSTNESS, "peers", "robustness"],
                        default=["peers", "robustness"], metavar="PART",
                        help="peers, robustness, or any of: " + ", ".join([*names, *ROBUSTNESS]))
    parser.add_argument("--out", type=Path, help="file for the Markdown (default: standard output)")
    options = parser.parse_args()
    options.pointfair = options.build / "bin" / "pointfair"
    if not options.pointfair.exists():
        parser.error(f"{options.pointfair} is missing: cmake -S {root} -B {options.build} -DPOINTFAIR_BENCH=ON && "
                     f"cmake --build {options.build}")
    return options


def parts(options, folder):
    """The Markdown, part by part as it is measured."""
    yield environment(options)
    bench = Bench(options, Clouds(options.pointfair, folder, options.mesh, options.points))
    wanted = [peer for peer in PEERS if {"peers", peer.program} & set(options.only)]
    built = [peer for peer in wanted if (options.build / "bin" / "peers" / peer.program).exists()]
    for peer in wanted:
        if peer not in built:
            yield f"{peer.program} is missing: its library was not found.\n"
    if built:
        yield bench.compare_peers(built)
    claims = [name for name in ROBUSTNESS if {"robustness", name} & set(options.only)]
    if claims:
        yield table(["claim", "measured", "goal"], [row for name in claims for row in getattr(bench, name)()])


def main():
    options = parse_options()
    folder = options.build / "clouds"
    folder.mkdir(exist_ok=True)
    options.mesh = options.mesh or find_mesh(folder)
    with open(options.out, "w") if options.out else contextlib.nullcontext(sys.stdout) as out:
        for part in parts(options, folder):
            print(part, file=out, flush=True)


if __name__ == "__main__":
    main()
