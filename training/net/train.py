# SPDX-License-Identifier: Apache-2.0
"""Trains the net in calls of a few minutes: each goes on from the state that the one before saved, optimiser included.

    python train.py DATA STATE --seconds 540 --total 3600

DATA is a folder of pieces (data.py), to which files may be added meanwhile. STATE is the file to go on from and to
save to. The rate of learning falls over --total seconds, counted from --restart on if the state was trained before.
"""
import argparse
import copy
import math
import random
import sys
import time
from collections import defaultdict
from pathlib import Path

import torch

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import data
import families
import model
import spec


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
    parser.add_argument("--without", default="", help="beginnings of kinds to leave out: scans_stereo,clean")
    parser.add_argument("--restart", action="store_true", help="count --total anew, with a fresh optimiser")
    parser.add_argument("--compile", action="store_true", help="compile the net if that is faster")
    parser.add_argument("--look", type=float, default=60, help="seconds between two validations")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    return parser.parse_args()


HARM = 4  # times that what is left worse than by the default run counts


def loss_of(batch, points):
    """The loss, and by how much each piece is worse than the default run. The loss is of logarithms of ratios to it; what
    is worse counts HARM times, and clean clouds twice."""
    mean, rms, chamfer = batch.ratios(points)
    worse = torch.relu(mean + 0.005) + torch.relu(rms + 0.005)
    of_object = torch.tensor([kind.startswith("objects") for kind in batch.kinds], device=mean.device).float()
    is_clean = torch.tensor([kind.startswith("clean") for kind in batch.kinds], device=mean.device).float()
    loss = ((1 + is_clean) * (mean + rms + (HARM - 1) * worse + 3 * of_object * chamfer)).mean()
    return loss, (torch.relu(mean) + torch.relu(rms)).detach()


def average(states):
    table = defaultdict(list)
    for kind, values in states:
        table[kind].append(values)
    return {kind: [sum(v) / len(v) for v in zip(*rows)] for kind, rows in sorted(table.items())}


def ratios_of(net, pieces, together):
    """The kind of each piece, and the logarithms of its ratios of mean, rms and Chamfer distance to the default run."""
    rows = []
    with torch.no_grad():
        for start in range(0, len(pieces), together):
            some = pieces[start : start + together]
            batch = data.Batch(some + some[:1] * (together - len(some)))  # one shape, for which it was compiled
            ratios = torch.stack(batch.ratios(net(batch.geometry)), 1).tolist()
            rows += [(piece[0], its) for piece, its in zip(some, ratios)]
    return rows


def validate(net, pieces, together):
    """Geometric means of the ratios, of all pieces and of each kind."""
    rows = ratios_of(net, pieces, together)
    overall = [sum(v) / len(v) for v in zip(*(values for _, values in rows))]
    show = lambda values: " ".join(f"{math.exp(v):.3f}" for v in values)
    parts = [f"{kind} {show(values)}" for kind, values in average(rows).items()]
    return f"all {show(overall)} | " + " | ".join(parts)


EVEN = "objects_object_even"
GROUPS = (EVEN, "scans", "hard", "objects", "correlated", EVEN, "hard", "clean", "scans", EVEN, "correlated", "special")
GROUPS += ("scans", "hard", EVEN, "correlated", "objects", "hard", "scans", "correlated", EVEN, "special", "hard", "scans")
REPORT = 50  # steps, after which the card is asked what they left


class Training:
    def __init__(self, a, kind_of_net=model.Net):
        self.a, self.step, self.trained = a, 0, 0.0
        torch.manual_seed(a.seed)
        self.net, self.smooth = kind_of_net().to(a.device), kind_of_net().to(a.device)
        self.smooth.load_state_dict(self.net.state_dict())
        weights = self.net.parameters()
        self.optimiser = torch.optim.AdamW(weights, lr=a.rate, betas=(0.9, 0.98), weight_decay=1e-3)
        if a.state.exists():
            saved = torch.load(a.state, map_location=a.device)
            self.step, self.trained = saved["step"], saved["trained"]
            self.net.load_state_dict(saved["net"])
            self.smooth.load_state_dict(saved["smooth"])
            self.optimiser.load_state_dict(saved["optimiser"])
            if a.restart:
                self.trained, self.optimiser.state = 0.0, defaultdict(dict)
        self.warm = self.step + 200
        self.start = copy.deepcopy(self.smooth)
        self.generator = torch.Generator(device=a.device).manual_seed(a.seed + self.step)
        self.by_group, self.sorted = defaultdict(lambda: defaultdict(list)), 0
        self.turn = 0  # in GROUPS
        self.harm, self.unread = [], []  # of each piece when it was last chosen; (pieces, harm) of the last steps
        self.dice = random.Random(a.seed + self.step)

    def compile(self, pieces):
        """Keeps the compiled net if a step with it takes less time; the steps taken meanwhile count."""

        def seconds_of_step():
            for warm in range(3):
                self.train_once(pieces)
            start = time.time()
            for step in range(10):
                self.train_once(pieces)
            self.net.input.weight.detach()[0, 0].item()
            return (time.time() - start) / 10

        plain, functions = seconds_of_step(), (self.net.core, model.of_scale, model.slid, data.nearest)
        compiled = math.inf

        def use(some):
            self.net.core, model.of_scale, model.slid, data.nearest = some

        try:
            use(torch.compile(f, dynamic=False) for f in functions)
            compiled = seconds_of_step()
        except Exception as error:  # whatever a compiler may meet: training goes on without
            print(f"not compiled: {str(error)[:300]}", flush=True)
        if not compiled < plain:
            use(functions)
        print(f"a step takes {plain:.4f} s, compiled {compiled:.4f} s", flush=True)

    def save(self):
        held = {"step": self.step, "trained": self.trained}
        parts = {"net": self.net, "smooth": self.smooth, "optimiser": self.optimiser}
        held |= {name: part.state_dict() for name, part in parts.items()}
        torch.save(held, self.a.state.with_suffix(".new"))
        self.a.state.with_suffix(".new").replace(self.a.state)

    def choose(self, pieces):
        """Their numbers. Groups and kinds take turns (GROUPS), kinds in a group are alike; the first place of each step goes
        to a piece that was left worse than by the default run when it was last chosen, the more likely the worse."""
        by_group, chosen = self.by_group, []
        while self.sorted < len(pieces):
            kind = pieces[self.sorted][0]
            first, family = kind.split("_", 1)
            is_correlated = families.FAMILIES[family].correlated
            for group in (first, kind) + ("hard",) * (family in spec.HARD) + ("correlated",) * is_correlated:
                by_group[group][kind].append(self.sorted)
            self.sorted += 1
            self.harm.append(0.0)
        for place in range(self.a.pieces):
            if place == 0 and sum(self.harm) > 0:
                chosen += self.dice.choices(range(self.sorted), self.harm)
                continue
            group, self.turn = GROUPS[self.turn % len(GROUPS)], self.turn + 1
            kinds = by_group[group if group in by_group else sorted(by_group)[place % len(by_group)]]
            chosen.append(self.dice.choice(kinds[self.dice.choice(sorted(kinds))]))
        return chosen

    def rate(self):
        warm = min(1.0, 1 - (self.warm - self.step) / 200)
        done = min(1.0, self.trained / self.a.total)
        return self.a.rate * warm * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * done)))

    def train_once(self, pieces):
        chosen = self.choose(pieces)
        batch = data.Batch([pieces[number] for number in chosen], self.generator)
        loss, harm = loss_of(batch, self.net(batch.geometry))
        self.unread.append((chosen, harm))
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
        for weight in self.net.parameters():  # all are NaN if one is; asking would wait for the card
            weight.grad.nan_to_num_(0.0, 0.0, 0.0)
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate()
        self.optimiser.step()
        self.step += 1
        recent = self.step - self.warm + 200
        keep = min(0.999, recent / (recent + 20))
        with torch.no_grad():
            for kept, now in zip(self.smooth.parameters(), self.net.parameters()):
                kept.lerp_(now, 1 - keep)
        if self.step % REPORT:
            return None
        for numbers, row in zip((numbers for numbers, _ in self.unread), torch.stack([h for _, h in self.unread]).tolist()):
            for number, its in zip(numbers, row):
                self.harm[number] = its if math.isfinite(its) else 0.0
        self.unread.clear()
        return float(loss.detach())


def main():
    a = arguments()
    end = time.time() + a.seconds
    torch.backends.cuda.matmul.allow_tf32 = True
    pieces = data.Pieces(a.device, filter(None, a.without.split(",")))
    pieces.load(a.data, a.most)
    training = Training(a)
    pieces.keep_loading(a.data, a.most)
    print(f"{len(pieces.training)} pieces, {len(pieces.held_out)} held out, from step {training.step}", flush=True)
    if a.compile:
        training.compile(pieces.training)
    looked = now = time.time()
    while now < end:
        loss = training.train_once(pieces.training)
        training.trained += time.time() - now
        now = time.time()
        if loss is not None and training.step % 200 == 0:
            count = len(pieces.training)
            print(f"step {training.step} loss {loss:.4f}, {count} pieces, {end - now:.0f} s left", flush=True)
        if now > looked + a.look:
            training.save()
            if pieces.held_out:
                print(f"step {training.step}: {validate(training.smooth, pieces.held_out[:96], a.pieces)}", flush=True)
            looked = now = time.time()
    training.save()
    if pieces.held_out:
        some = list(pieces.held_out)
        print(f"start: {validate(training.start, some, a.pieces)}", flush=True)
        print(f"end, step {training.step}: {validate(training.smooth, some, a.pieces)}", flush=True)


if __name__ == "__main__":
    main()
