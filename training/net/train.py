# SPDX-License-Identifier: Apache-2.0
"""Trains the net in calls of a few minutes: each goes on from the state that the one before saved, optimiser included.

    python train.py DATA STATE --seconds 540 --total 3600

DATA is a folder of pieces (data.py), to which files may be added meanwhile. STATE is the file to go on from and to
save to. The rate of learning falls over --total seconds.
"""
import argparse
import math
import time
from collections import defaultdict
from pathlib import Path

import torch

import data
import model


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data")
    parser.add_argument("state", type=Path)
    parser.add_argument("--seconds", type=float, default=540)
    parser.add_argument("--total", type=float, default=1000, help="seconds of all calls, over which the rate falls")
    parser.add_argument("--pieces", type=int, default=4, help="pieces a step")
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--most", type=int, default=10**9, help="files to load at most")
    parser.add_argument("--compile", action="store_true")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    return parser.parse_args()


def loss_of(batch, points):
    """Logarithms of ratios to the default run; what is worse than it counts three times, and clean clouds twice."""
    mean, rms, chamfer = batch.ratios(points)
    worse = torch.relu(mean + 0.005) + torch.relu(rms + 0.005)
    of_object = torch.tensor([kind == "obj" for kind in batch.kinds], device=mean.device).float()
    is_clean = torch.tensor([kind.startswith("clean") for kind in batch.kinds], device=mean.device).float()
    return ((1 + is_clean) * (mean + rms + 2 * worse + of_object * chamfer)).mean()


def average(states):
    table = defaultdict(list)
    for kind, values in states:
        table[kind].append(values)
    return {kind: [sum(v) / len(v) for v in zip(*rows)] for kind, rows in sorted(table.items())}


def validate(net, pieces):
    """Per kind of cloud: geometric means of the ratios of mean, rms and Chamfer distance to the default run."""
    rows = []
    with torch.no_grad():
        for piece in pieces:
            batch = data.Batch([piece])
            rows.append((piece[0], [float(r) for r in batch.ratios(net(batch.geometry))]))
    overall = [sum(v) / len(v) for v in zip(*(values for _, values in rows))]
    show = lambda values: " ".join(f"{math.exp(v):.3f}" for v in values)
    parts = [f"{kind} {show(values)}" for kind, values in average(rows).items()]
    return f"all {show(overall)} | " + " | ".join(parts)


class Training:
    def __init__(self, a):
        self.a, self.step, self.trained = a, 0, 0.0
        torch.manual_seed(a.seed)
        self.net, self.smooth = model.Net().to(a.device), model.Net().to(a.device)
        self.smooth.load_state_dict(self.net.state_dict())
        weights = self.net.parameters()
        self.optimiser = torch.optim.AdamW(weights, lr=a.rate, betas=(0.9, 0.98), weight_decay=1e-3)
        if a.state.exists():
            saved = torch.load(a.state, map_location=a.device)
            self.step, self.trained = saved["step"], saved["trained"]
            self.net.load_state_dict(saved["net"])
            self.smooth.load_state_dict(saved["smooth"])
            self.optimiser.load_state_dict(saved["optimiser"])
        self.generator = torch.Generator(device=a.device).manual_seed(a.seed + self.step)
        if a.compile:
            torch._dynamo.config.suppress_errors = True
            self.net.core = torch.compile(self.net.core, dynamic=False)
            model.of_scale = torch.compile(model.of_scale, dynamic=False)

    def save(self):
        held = {"step": self.step, "trained": self.trained}
        parts = {"net": self.net, "smooth": self.smooth, "optimiser": self.optimiser}
        held |= {name: part.state_dict() for name, part in parts.items()}
        torch.save(held, self.a.state.with_suffix(".new"))
        self.a.state.with_suffix(".new").replace(self.a.state)

    def choose(self, pieces):
        """Half of the pieces from objects, the rest from sensors; kinds alike among these."""
        by_kind = defaultdict(list)
        for i, (kind, _, _) in enumerate(pieces):
            by_kind[kind].append(i)
        sensors = [kind for kind in by_kind if kind != "obj"]
        draw = lambda n: int(torch.randint(n, (1,), generator=self.generator, device=self.a.device))
        chosen = []
        for place in range(self.a.pieces):
            is_object = "obj" in by_kind and (place % 2 == 0 or not sensors)
            kind = "obj" if is_object else sensors[draw(len(sensors))]
            chosen.append(pieces[by_kind[kind][draw(len(by_kind[kind]))]])
        return chosen

    def rate(self):
        warm = min(1.0, (self.step + 1) / 200)
        done = min(1.0, self.trained / self.a.total)
        return self.a.rate * warm * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * done)))

    def train_once(self, pieces):
        batch = data.Batch(self.choose(pieces), self.generator)
        loss = loss_of(batch, self.net(batch.geometry))
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate()
        if torch.isfinite(norm):
            self.optimiser.step()
        self.step += 1
        keep = min(0.998, self.step / (self.step + 20))
        with torch.no_grad():
            for kept, now in zip(self.smooth.parameters(), self.net.parameters()):
                kept.lerp_(now, 1 - keep)
        return float(loss.detach()) if self.step % 50 == 0 else None


def main():
    a = arguments()
    end = time.time() + a.seconds
    torch.backends.cuda.matmul.allow_tf32 = True
    pieces = data.Pieces(a.device)
    pieces.load(a.data, a.most)
    training = Training(a)
    print(f"{len(pieces.training)} pieces, {len(pieces.held_out)} held out, from step {training.step}", flush=True)
    looked = now = time.time()
    while now < end:
        loss = training.train_once(pieces.training)
        training.trained += time.time() - now
        now = time.time()
        if loss is not None and training.step % 200 == 0:
            print(f"step {training.step} loss {loss:.4f}, {end - time.time():.0f} s left", flush=True)
        if now > looked + 60:
            pieces.load(a.data, a.most)
            training.save()
            if pieces.held_out:
                print(f"step {training.step}: {validate(training.smooth, pieces.held_out[:100])}", flush=True)
            looked = now = time.time()
    training.save()
    if pieces.held_out:
        print(f"end, step {training.step}: {validate(training.smooth, pieces.held_out)}", flush=True)


if __name__ == "__main__":
    main()
