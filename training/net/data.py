# SPDX-License-Identifier: Apache-2.0
"""Pieces of clouds as training reads them, and the batches and errors that are made of them.

A file NAME.npz holds some pieces of one cloud, each of as many points as every other: arr_0 measured places, arr_1 what
the default run made of them, arr_2 its normals, arr_3 the noise at each point, arr_4 the true places, arr_5 true
normals, arr_6 which points are sound, arr_7 which lie well within the piece, arr_8 the number of the cloud of each point
where small ones share a piece, -1 for points that fill it, arr_9 the 16 nearest points of each; and kind, the group and
the name of the family, as in training/families.py.
"""
import threading
import time
from pathlib import Path

import numpy as np
import torch

import coarse
import model

COLUMNS = 10
FLOOR = 0.01  # spacings, below which errors do not count


class Pieces:
    def __init__(self, device, without=(), every=25):
        """`without` names beginnings of kinds that are left out; every so-manieth cloud is held out."""
        self.device, self.without, self.every = device, tuple(without), every
        self.seen, self.training, self.held_out = set(), [], []

    def load(self, folder, most=10**9):
        for path in sorted(Path(folder).glob("*.npz")):
            if path.name in self.seen or path.name.endswith(".tmp.npz") or len(self.seen) >= most:
                continue
            self.seen.add(path.name)
            with np.load(path) as file:
                kind, columns = str(file["kind"]), [file[f"arr_{i}"] for i in range(COLUMNS)]
            if kind.startswith(self.without):
                continue
            columns[-1] = columns[-1].astype(np.int16)  # below 32,768 points
            columns = [torch.as_tensor(column).to(self.device) for column in columns]
            number = int("".join(c for c in path.stem if c.isdigit()))
            for piece in zip(*columns):
                (self.held_out if number % self.every == 0 else self.training).append((kind, piece))

    def keep_loading(self, folder, most=10**9, pause=5.0):
        """Loads in a thread of its own what comes into the folder."""

        def work():
            while True:
                self.load(folder, most)
                time.sleep(pause)

        threading.Thread(target=work, daemon=True).start()


def nearest(places, there, own, its):
    """Which of `there` is nearest to each of `places`, among those of the same number: (pieces, points, 3), and numbers
    of (pieces, points)."""
    apart = sum((places[:, :, None, axis] - there[:, None, :, axis]).square() for axis in range(3))
    return torch.where(own[:, :, None] == its[:, None], apart, torch.inf).argmin(2)


class Batch:
    """Pieces side by side, and how far the points of each lie from the truth. With a generator, what is said of the noise
    is off, and coarse scales hold other points each time."""

    def __init__(self, pieces, generator=None):
        self.kinds = [kind for kind, _ in pieces]
        self.count, self.points = len(pieces), len(pieces[0][1][0])
        columns = [torch.cat([tensors[i] for _, tensors in pieces]) for i in range(COLUMNS)]
        measured, self.classical, normal, noise, self.true, self.true_normal, sound, within, cloud, finest = columns
        salt = torch.arange(self.count, device=noise.device)
        if generator is not None:  # what is said of the noise is never quite right
            factor = torch.exp(0.15 * torch.randn(self.count, generator=generator, device=noise.device))
            noise = noise * factor.repeat_interleave(self.points)
            salt = torch.randint(2**62, (self.count,), generator=generator, device=noise.device)
        self.judged = (sound & within & (noise > 0)).float().view(self.count, -1)
        noise = noise.clamp_min(1e-9)
        of_piece = lambda column: column.view(self.count, self.points, *column.shape[1:])
        lists = coarse.lists_of(of_piece(self.classical), of_piece(cloud), of_piece(finest).long(), salt)
        start = torch.arange(self.count, device=noise.device)[:, None, None] * self.points
        lists = [(scale + start).flatten(0, 1).contiguous() for scale in lists.unbind(1)]
        self.noise = noise
        self.geometry = model.Geometry(measured, self.classical, normal, noise, lists)
        self.first, self.cloud = start[..., 0], of_piece(cloud)
        self.target = torch.where(of_piece(sound), self.cloud, -2)
        gap = self.true[lists[0]] - self.true[:, None]
        self.spacing = (gap * gap).sum(2).mean(1).sqrt().view(self.count, -1).median(1).values * 0.6

    def errors(self, points):
        """Of each piece: mean distance to the surface, its root mean square, and the Chamfer distance."""
        at = self.nearest(points, self.true)
        apart, back = points - self.true[at], self.true - points[self.nearest(self.true, points)]
        off = (apart * self.true_normal[at]).sum(1).view(self.count, -1)
        chamfer = (apart * apart + back * back).sum(1)
        total = self.judged.sum(1).clamp_min(1)
        mean = lambda x: (x.view(self.count, -1) * self.judged).sum(1) / total
        floor = FLOOR * self.spacing
        return mean(off.abs()) + floor, (mean(off * off) + floor * floor).sqrt(), mean(chamfer) + floor * floor

    def nearest(self, places, there):
        """The row of the nearest sound point of the same cloud, for each place. Among its neighbours in the default run alone
        it need not be: where noise is wider than their lists, their true places lie all about."""
        of_piece = lambda column: column.detach().view(self.count, -1, 3)
        return (nearest(of_piece(places), of_piece(there), self.cloud, self.target) + self.first).flatten()

    def ratios(self, points):
        """Logarithms of the errors over those of the default run."""
        with torch.no_grad():
            before = self.errors(self.classical)
        return [torch.log(after / its) for after, its in zip(self.errors(points), before)]
