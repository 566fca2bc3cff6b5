# SPDX-License-Identifier: Apache-2.0
"""What each part of the net and of its data is worth: short trainings that differ in one thing, on the same pieces.

    python ablate.py DATA SECONDS [VARIANT...]

Every variant begins from the same random weights and trains for SECONDS at the same rates; DATA is a folder of pieces
(data.py). A row has, for held-out clouds of all families, geometric means of mean distance and its root mean square
over those of the default run; the same for the families that the variant did not see; and the kind left worst.
"""
import argparse
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


class AlongNormal(model.Net):
    """What the step has across the normal is left out."""

    def core(self, points, edges, vectors, lists, normal, back):
        normals = [normal[:, None, None] * (v * normal[:, None, None]).sum(3, keepdim=True) for v in vectors]
        return super().core(points, edges, normals, lists, normal, model.dot(back, normal)[:, None] * normal)


class ThreeScales(model.Net):
    """The list of every 16th point stands in for that of every 64th."""

    def core(self, points, edges, vectors, lists, normal, back):
        finer = lambda scales: [*scales[:3], scales[2]]
        points = torch.cat([points[:, :18], points[:, 12:18], points[:, 24:27], points[:, 26:27]], 1)
        return super().core(points, finer(edges), finer(vectors), finer(lists), normal, back)


NETS = {"along the normal": AlongNormal, "three scales": ThreeScales}


def options(folder, seconds, device):
    """As train.py's command line gives them."""
    sys.argv = ["train.py", folder, "none.pt", "--total", str(seconds), "--pieces", "6", "--device", device]
    return train.arguments()


def trained(variant, pieces, seconds, a):
    """The averaged net after so many seconds."""
    spec.TRUST = {"trust 1": 1.0, "trust 4": 4.0}.get(variant, 2.0)
    training = train.Training(a, NETS.get(variant, model.Net))
    seen = [piece for piece in pieces.training if not piece[0].startswith(UNSEEN.get(variant, ("nothing",)))]
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
    unseen = [r for r in rows if r[0].startswith(UNSEEN.get(variant, ("nothing",)))]
    groups = [(g, [r for r in rows if r[0].startswith(g)]) for g in ("scans", "objects", "special")]
    parts = [variant, f"{steps} steps", show(rows), *(f"{g} {show(found)}" for g, found in groups if found)]
    worst = max(train.average(rows).items(), key=lambda item: max(item[1][:2]))
    parts += [f"not seen {show(unseen)}" if unseen else "", f"worst {worst[0]} {show([worst])}"]
    return "| " + " | ".join(parts) + " |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data")
    parser.add_argument("seconds", type=float)
    parser.add_argument("variants", nargs="*", help=", ".join(VARIANTS))
    parser.add_argument("--until", type=float, default=math.inf, help="begin no variant later than so many seconds")
    given, start = parser.parse_args(), time.time()
    torch.backends.cuda.matmul.allow_tf32 = True
    device = "cuda" if torch.cuda.is_available() else "cpu"
    pieces = data.Pieces(device)
    pieces.load(given.data)
    a = options(given.data, given.seconds, device)
    print(f"{len(pieces.training)} pieces, {len(pieces.held_out)} held out", flush=True)
    for variant in given.variants or VARIANTS:
        if time.time() - start < given.until:
            net, steps = trained(variant, pieces, given.seconds, a)
            print(row(variant, net, steps, train.ratios_of(net, pieces.held_out, a.pieces)), flush=True)


if __name__ == "__main__":
    main()
