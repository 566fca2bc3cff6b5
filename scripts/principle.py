# SPDX-License-Identifier: Apache-2.0
"""The pictures of "What auto does" in docs/parameters.md: a yard, a third of it rough, whose noise grows from left to
right. Needs numpy and matplotlib."""
import matplotlib
import numpy

matplotlib.use("Agg")
from matplotlib import pyplot  # after the backend was chosen

LENGTH, WIDTH, BORDER = 300, 160, 100  # spacings; left of the border the ground is rough
COUNTS = numpy.array([6, 11, 20, 36, 64, 115])
AREAS = {"rough, noise 0.06 spacings": (20, 80), "smooth, noise 0.1 spacings": (120, 160), "smooth, noise 0.3 spacings": (240, 290)}
PLACES = {"rough ground": (20, 80), "the step at its border": (98, 102), "smooth ground": (240, 290)}
COLORS = ["tab:red", "tab:blue", "tab:green"]


def height(x, y):
    """Waves of 5 to 80 spacings, as high as they are long: natural ground."""
    random = numpy.random.default_rng(3)
    ground = numpy.zeros_like(x)
    for length in numpy.geomspace(5, 80, 24):
        direction, phase = random.uniform(0, 2 * numpy.pi, 2)
        ground += length / 120 * numpy.sin(2 * numpy.pi / length * (x * numpy.cos(direction) + y * numpy.sin(direction)) + phase)
    return numpy.where(x < BORDER, ground, 0.0)


def noise_at(x):
    return 0.03 + 0.3 * (x / LENGTH) ** 2 + 0.03 * (x < BORDER)


def write_yard(path):
    """Returns x, y and the height of the ground there; `path` gets the points."""
    random = numpy.random.default_rng(1)
    x, y = (side.ravel() + random.uniform(-0.4, 0.4, LENGTH * WIDTH) for side in numpy.meshgrid(numpy.arange(LENGTH), numpy.arange(WIDTH)))
    points = numpy.column_stack([x, y, height(x, y) + noise_at(x) * random.normal(size=x.size)]).astype("<f4")
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    path.write_bytes(f"ply\nformat binary_little_endian 1.0\nelement vertex {x.size}\n{properties}end_header\n".encode() + points.tobytes())
    return points


def read(path):
    """Columns by name, of a binary PLY of floats."""
    header, body = path.read_bytes().split(b"end_header\n", 1)
    names = [line.split()[2].decode() for line in header.splitlines() if line.startswith(b"property")]
    return dict(zip(names, numpy.frombuffer(body, "<f4").reshape(-1, len(names)).T.astype(float)))


def plane_variances(points, at, counts):
    """Unbiased, over the plane of each point and its nearest; a row a point."""
    rows = []
    for p in points[at]:
        near = points[numpy.argsort(((points - p) ** 2).sum(axis=1))[:counts[-1] + 1]]
        rows.append([numpy.linalg.eigvalsh(numpy.cov(near[:k + 1].T))[0] * k / (k - 2) for k in counts])
    return numpy.array(rows)


def draw_noise(points, found, path):
    x, y = points[:, 0], points[:, 1]
    figure, axes = pyplot.subplots(1, 2, figsize=(9, 2.6), layout="constrained", sharey=True)
    for axis, values, title in ((axes[0], noise_at(x), "true"), (axes[1], found, "estimated")):
        drawn = axis.scatter(x, y, c=values, s=0.3, vmin=0, vmax=noise_at(LENGTH), cmap="viridis", rasterized=True)
        axis.set(title=f"noise, {title}", aspect="equal", xlabel="spacings")
    figure.colorbar(drawn, ax=axes, label="spacings")
    figure.savefig(path, dpi=100)


def draw_width(points, path):
    figure, axes = pyplot.subplots(1, 3, figsize=(9, 2.8), layout="constrained", sharey=True)
    random = numpy.random.default_rng(2)
    for axis, (name, (first, last)) in zip(axes, PLACES.items()):
        inside = numpy.flatnonzero((points[:, 0] > first) & (points[:, 0] < last) & (abs(points[:, 1] - WIDTH / 2) < 40))
        at = random.choice(inside, 100, replace=False)
        sigma = noise_at(points[at, :1])
        # Eq. 23 of docs/how-it-works.md
        damage = 1.5 * numpy.maximum(0, plane_variances(points, at, COUNTS) / sigma ** 2 - 1.3)
        shape, noise = (damage / (1 + damage)).mean(axis=0), (1 / COUNTS / (1 + damage)).mean(axis=0)
        total = shape + noise
        axis.plot(COUNTS, noise, "--", color="tab:gray", label="noise that is left")
        axis.plot(COUNTS, shape, ":", color="tab:gray", label="noise that must stay to spare the shape")
        axis.plot(COUNTS, total, color="black", label="both")
        axis.plot(COUNTS[total.argmin()], total.min(), "o", color="black")
        axis.set(title=name, xscale="log", ylim=(0, 1), xlabel="points of the neighbourhood")
        axis.set_xticks(COUNTS, [str(k) for k in COUNTS])
        axis.minorticks_off()
        axis.title.set_fontsize("medium")
    axes[0].set_ylabel("of the noise's variance")
    figure.get_layout_engine().set(rect=(0, 0.1, 1, 0.9))  # room for the legend; Debian 12 has Matplotlib 3.6
    figure.legend(*axes[0].get_legend_handles_labels(), loc="lower center", ncols=3, fontsize="small")
    figure.savefig(path, dpi=100)


def draw_left(points, results, path):
    """`results`: denoised points by their setting."""
    figure, axis = pyplot.subplots(figsize=(9, 2.8), layout="constrained")
    for n, ((name, (first, last)), color) in enumerate(zip(AREAS.items(), COLORS)):
        inside = (points[:, 0] > first) & (points[:, 0] < last) & (abs(points[:, 1] - WIDTH / 2) < 60)
        left = [numpy.abs(p[inside, 2] - height(p[inside, 0], p[inside, 1])).mean() for p in results.values()]
        before = numpy.abs(points[inside, 2] - height(points[inside, 0], points[inside, 1])).mean()
        bars = axis.bar(numpy.arange(len(left)) + 0.27 * (n - 1), numpy.array(left) / before, 0.25, color=color, label=name)
        axis.bar_label(bars, fmt="%.2f", fontsize="x-small")
    axis.set_xticks(range(len(results)), list(results))
    axis.set_ylabel("error left, of the input's")
    axis.legend(fontsize="small")
    figure.savefig(path, dpi=100)


def draw(run, folder, pictures):
    """`run(cloud, result, *flags)` denoises a file."""
    cloud = folder / "yard.ply"
    points = write_yard(cloud)
    results = {}
    for label, flags in (("8 neighbours", ["--min-neighbors", 8]), ("16 neighbours", ["--min-neighbors", 16]),
                         ("32 neighbours", ["--min-neighbors", 32]), ("auto", ["--write-noise"])):
        run(cloud, folder / "yard_result.ply", *flags)
        columns = read(folder / "yard_result.ply")
        results[label] = numpy.column_stack([columns[axis] for axis in "xyz"])
    draw_noise(points, columns["noise"], pictures / "principle_noise.png")
    draw_width(points.astype(float), pictures / "principle_width.png")
    draw_left(points, results, pictures / "principle_left.png")
