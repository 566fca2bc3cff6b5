# SPDX-License-Identifier: Apache-2.0
"""What each part of the net and of its data is worth: short trainings that differ in one thing, on the same pieces.

    python ablate.py DATA SECONDS [VARIANT...]

Every variant begins from the same random weights and trains for SECONDS at the same rates; DATA is a folder of pieces
(data.py), of whose clouds every eighth is held out. A row has, for held-out clouds of all families, geometric means of
mean distance and its root mean square over those of the default run; the same for the families that the variant did not
see; and the kind left worst. --json writes all kinds of each variant. With --draw, files are read as they come, and
training begins after so many seconds, in which the net is compiled.
"""
import argparse
import json
import math
import sys
import time

import torch

import data
import model
import spec
import train

UNSEEN = {  # beginnings of kinds that a variant leaves out
    "no sensors": ("scans", "special", "clean"),
    "no objects": ("objects",),
    "no cameras": ("scans_structured", "scans_stereo", "scans_time"),
    "no airborne": ("scans_airborne", "special_sparse_forest", "clean_airborne"),
    "no lidar": ("scans_spinning", "scans_terrestrial", "scans_grazing", "scans_thinned", "clean_terrestrial"),
    "no photogrammetry": ("scans_photogrammetry",),
}
VARIANTS = ("whole", *UNSEEN, "along the normal", "three scales", "trust 1", "trust 4")
EVERY = 8  # clouds, of which one is held out


class AlongNormal(model.Net):
    """What the step has across the normal is left out."""

    def core(self, points, edges, vectors, lists, normal, back, slide):
        normals = [normal[:, None, None] * (v * normal[:, None, None]).sum(3, keepdim=True) for v in vectors]
        back = model.dot(back, normal)[:, None] * normal
        return super().core(points, edges, normals, lists, normal, back, torch.zeros_like(slide))


class ThreeScales(model.Net):
    """The list of every 16th point stands in for that of every 64th."""

    def core(self, points, edges, vectors, lists, normal, back, slide):
        finer = lambda scales: [*scales[:3], scales[2]]
        points = torch.cat([points[:, :18], points[:, 12:18], points[:, 24:27], points[:, 26:27]], 1)
        return super().core(points, finer(edges), finer(vectors), finer(lists), normal, back, slide)


NETS = {"along the normal": AlongNormal, "three scales": ThreeScales}


def options(folder, seconds, device):
    """As train.py's command line gives them."""
    sys.argv = ["train.py", folder, "none.pt", "--total", str(seconds), "--pieces", "6", "--device", device]
    return train.arguments()


def seen_by(variant, kind):
    return not kind.startswith(UNSEEN.get(variant, ("nothing",)))


def trained(variant, pieces, seconds, a):
    """The averaged net after so many seconds."""
    spec.TRUST = {"trust 1": 1.0, "trust 4": 4.0}.get(variant, 2.0)
    training = train.Training(a, NETS.get(variant, model.Net))
    seen = [piece for piece in pieces.training if seen_by(variant, piece[0])]
    end = time.time() + seconds
    now = time.time()
    while now < end:
        training.train_once(seen)
        training.trained, now = training.trained + time.time() - now, time.time()
    return training.smooth, training.step


def row(variant, net, steps, rows):
    """rows: kind and logarithms of the ratios of each held-out piece."""
    mean = lambda found, which: math.exp(sum(values[which] for _, values in found) / len(found))
    show = lambda found: f"{mean(found, 0):.3f} {mean(found, 1):.3f}"
    unseen = [r for r in rows if not seen_by(variant, r[0])]
    groups = [(g, [r for r in rows if r[0].startswith(g)]) for g in ("scans", "objects", "special")]
    parts = [variant, f"{steps} steps", show(rows), *(f"{g} {show(found)}" for g, found in groups if found)]
    worst = max(train.average(rows).items(), key=lambda item: max(item[1][:2]))
    parts += [f"not seen {show(unseen)}" if unseen else "", f"worst {worst[0]} {show([worst])}"]
    return "| " + " | ".join(parts) + " |"


def of_kinds(rows):
    """Of each kind: number of pieces, and the ratios of mean, root mean square and Chamfer distance."""
    count = lambda kind: sum(r[0] == kind for r in rows)
    return {kind: [count(kind), *map(math.exp, values)] for kind, values in train.average(rows).items()}


def compile_parts(pieces, a):
    """Compiles what all variants share, for training and for judging; the net stays as it is if that fails."""
    plain = model.of_scale, model.Layer.forward
    begin = time.time()
    try:
        model.of_scale, model.Layer.forward = (torch.compile(part, dynamic=False) for part in plain)
        training = train.Training(a)
        training.train_once(pieces.training)
        train.ratios_of(training.smooth, pieces.training[: a.pieces], a.pieces)
        print(f"compiled in {time.time() - begin:.0f} s", flush=True)
    except Exception as error:  # whatever a compiler may meet
        model.of_scale, model.Layer.forward = plain
        print(f"not compiled: {str(error)[:300]}", flush=True)


def load(folder, a, seconds):
    """The pieces that are there after so many seconds; the net is compiled as soon as there are some."""
    pieces, begin, compiled = data.Pieces(a.device, every=EVERY), time.time(), False
    while True:
        pieces.load(folder)
        if seconds and not compiled and len(pieces.training) >= 20:
            compile_parts(pieces, a)
            compiled = True
        elif time.time() - begin >= seconds:
            return pieces
        time.sleep(min(1.0, seconds))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data")
    parser.add_argument("seconds", type=float)
    parser.add_argument("variants", nargs="*", help=", ".join(VARIANTS))
    parser.add_argument("--until", type=float, default=math.inf, help="begin no variant later than so many seconds")
    parser.add_argument("--draw", type=float, default=0, help="read files for so many seconds before the first variant")
    parser.add_argument("--json", help="file for all kinds of each variant")
    given, start = parser.parse_args(), time.time()
    torch.backends.cuda.matmul.allow_tf32 = True
    a = options(given.data, given.seconds, "cuda" if torch.cuda.is_available() else "cpu")
    pieces, found = load(given.data, a, given.draw), {}
    print(f"{len(pieces.training)} pieces, {len(pieces.held_out)} held out", flush=True)
    for variant in given.variants or VARIANTS:
        if time.time() - start < given.until:
            net, steps = trained(variant, pieces, given.seconds, a)
            rows = train.ratios_of(net, pieces.held_out, a.pieces)
            print(row(variant, net, steps, rows), flush=True)
            found[variant] = {"steps": steps, "kinds": of_kinds(rows)}
            if given.json:
                with open(given.json, "w") as file:
                    json.dump(found, file, indent=1)


if __name__ == "__main__":
    main()
