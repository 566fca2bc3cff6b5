# SPDX-License-Identifier: Apache-2.0
"""The net in whole numbers and single floats, as plainly as NumPy says it: the oracle of src/point/net.h, bit for bit.

    python reference.py WEIGHTS CLOUD.npz OUT.npy      writes the refined places

CLOUD.npz has a row for each point: measured, classical, normal, noise; and corner, relative to which positions are
hashed. Ties of distances go by position. Points without a normal keep their place.
"""
import struct
import sys

import numpy as np
from scipy.spatial import cKDTree

import spec

F = np.float32
K = spec.NEIGHBORS


class Weights:
    def __init__(self, path):
        data = open(path, "rb").read()
        assert data[:8] == b"pfweight"
        version, size, _, self.trust = struct.unpack("<IIQf", data[8:28])
        assert version == 2 and size == len(data) - 28
        self.data, self.at = data, 28
        c = spec.CHANNELS
        self.input, self.input_bias = self.matrix(c, spec.POINT_FEATURES), self.bias(c)
        self.layers = []
        for i in range(len(spec.PLAN)):
            layer = {"own": self.matrix(c, c), "own_bias": self.bias(c), "other": self.matrix(c, c)}
            layer |= {"edge": self.matrix(c, spec.EDGE_FEATURES), "update": self.matrix(c, 3 * c)}
            layer |= {"update_bias": self.bias(c), "gate": self.matrix(spec.GATES, c) if i >= spec.GATED else None}
            self.layers.append(layer)
        self.output, self.output_bias = self.matrix(spec.OUTPUTS, c), self.bias(spec.OUTPUTS)

    def matrix(self, rows, columns):
        self.at += rows * columns
        flat = np.frombuffer(self.data, "i1", rows * columns, self.at - rows * columns)
        return flat.reshape(rows, columns).astype(int)

    def bias(self, rows):
        self.at += 4 * rows
        return np.frombuffer(self.data, "<i4", rows, self.at - 4 * rows).astype(int)


def share_of_hash(points, corner):
    """MurmurHash3's finaliser over the three exact offsets, as src/point/position.h has it; over [0, 1)."""
    words = (points.astype(float) - corner.astype(float) + 0.0).view(np.uint64)
    value = np.full(len(points), 0x9E3779B97F4A7C15, np.uint64)
    for axis in range(3):
        value = (value ^ words[:, axis]) * np.uint64(0xFF51AFD7ED558CCD)
        value ^= value >> np.uint64(33)
    value *= np.uint64(0xC4CEB9FE1A85EC53)
    return ((value >> np.uint64(32)) >> np.uint64(8)).astype(F) * F(2.0**-24)


def dot(a, b):
    return (a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]) + a[..., 2] * b[..., 2]


def nearest(points, members):
    """The 16 nearest other points of each among the members, nearest first, ties by position."""
    more = min(len(members), K + 9)
    found = members[cKDTree(points[members]).query(points, more)[1]]
    away = points[found] - points[:, None]
    square = dot(away, away)
    square[found == np.arange(len(points))[:, None]] = np.inf
    there = points[found]
    order = np.lexsort((there[..., 2], there[..., 1], there[..., 0], square), axis=1)[:, :K]
    return np.take_along_axis(found, order, 1)


def lists_of(points, corner):
    share, lists = share_of_hash(points, corner), []
    for stride in spec.STRIDES:
        members = np.flatnonzero(share < F(1) / F(stride))
        lists.append(nearest(points, members) if len(members) > K else lists[-1])
    return lists


def whole(value, coding):
    factor, offset = coding
    shifted = (value * F(factor) + F(offset + 0.5)).astype(F)
    return np.fmin(F(127), np.fmax(F(0), shifted)).astype(int)


def summed(values):
    """Over the neighbours, one after the other."""
    total = np.zeros_like(values[:, 0])
    for e in range(values.shape[1]):
        total = total + values[:, e]
    return total


def activations(sums):
    return np.clip((sums + 32) >> 6, 0, 127)


def can_move(normal, noise):
    return ((noise > 0) & np.isfinite(noise) & (dot(normal, normal) > 0))[:, None]


def slid(start, normal, noise, index):
    """Where points lie after they slid apart along the surface."""
    moves, place, own = can_move(normal, noise), start, normal[:, None]
    unit = np.where(moves, noise[:, None], F(1))
    for _ in range(spec.SLIDES):
        offset = place[index] - place[:, None]
        across = offset - dot(offset, own)[..., None] * own
        square = dot(across, across)
        per_mean = F(1) / np.fmax(summed(square) * (F(1) / F(K)), F(1e-30))
        near = np.fmax(F(0), F(1) - square * per_mean[:, None])
        near = near * near
        push = summed((near * near)[..., None] * across)
        way = ((place - start) - F(spec.SLIDE) * push) / unit
        length = np.sqrt(dot(way, way))[:, None]
        way = (F(spec.FARTHEST_SLIDE) / np.fmax(length, F(spec.FARTHEST_SLIDE))) * way
        place = np.where(moves, start + unit * way, start)
    return place


class Edges:
    def __init__(self, classical, normal, measured, noise, index):
        own = normal[:, None]
        self.offset = classical[index] - classical[:, None]
        self.square = dot(self.offset, self.offset)
        turn = dot(own, normal[index])
        self.normal = np.where((turn < 0)[..., None], -normal[index], normal[index])
        self.turn = np.fmin(np.abs(turn), F(1))
        self.sine = np.sqrt(np.fmax(F(0), F(1) - self.turn * self.turn))
        self.height, self.its_height = dot(self.offset, own), dot(self.offset, self.normal)
        self.raw = measured[index] - classical[:, None]
        self.its_back = dot(measured[index] - classical[index], self.normal) / noise[index]
        self.noise, self.its_noise = noise[:, None], noise[index]

    def scale(self):
        part = F(1) / F(K)
        size = np.fmax(np.sqrt(summed(self.square) * part), F(1e-30))
        roughness = np.sqrt(summed(self.height * self.height) * part)
        return part * summed(self.offset), size, summed(self.height) * part, roughness, summed(self.sine) * part

    def features(self, side, size, own):
        per_noise, per_size = F(1) / self.noise, (F(1) / size)[:, None]
        columns = [
            whole(self.square * per_size * per_size, spec.SIZE),
            whole(self.height * per_noise, spec.HEIGHT),
            whole(self.its_height * per_noise, spec.HEIGHT),
            whole(self.height * per_size, spec.SLOPE),
            whole(self.its_height * per_size, spec.SLOPE),
            whole(self.sine, spec.SHARE),
            whole(self.turn, spec.SHARE),
            whole(self.its_noise / (self.its_noise + self.noise), spec.SHARE),
            whole(self.its_back, spec.HEIGHT),
            whole(dot(self.raw, own[:, None]) * per_noise, spec.HEIGHT),
            whole(dot(self.offset, side[:, None]) * per_size, spec.SIDE),
            whole(np.sqrt(self.noise / (self.noise + np.sqrt(self.square))), spec.SHARE),
        ]
        return np.stack(columns, 2)

    def pulls(self):
        per_noise = F(1) / self.noise
        clip = lambda x: np.fmin(F(spec.CLIP), np.fmax(F(-spec.CLIP), x))
        return clip(self.its_height * per_noise), clip(dot(self.raw, self.normal) * per_noise)


def sides_of(normal, offset):
    up = np.where((dot(offset, normal) < 0)[:, None], -normal, normal)
    across = offset - dot(offset, up)[:, None] * up
    length = np.sqrt(dot(across, across))[:, None]
    return up, np.where(length > 0, across / np.where(length > 0, length, F(1)), across)


def point_features(scales, up, turned, back, noise):
    columns = []
    for offset, size, height, roughness, sine in scales:
        height = np.where(turned, -height, height)
        across = offset - height[:, None] * up
        columns += [
            whole(height / noise, spec.HEIGHT),
            whole(roughness / noise, spec.SIZE),
            whole(roughness / size, spec.STEEPNESS),
            whole(np.sqrt(noise / (noise + size)), spec.SHARE),
            whole(sine, spec.SHARE),
            whole(np.sqrt(dot(across, across)) / size, spec.SHARE),
        ]
    columns += [whole(np.sqrt(dot(back, back)) / noise, spec.SIZE), whole(dot(back, up) / noise, spec.HEIGHT)]
    columns += [whole(scales[0][1] / scales[n][1], spec.SHARE) for n in (1, 3)]
    return np.stack(columns, 1)


def first_at_place(measured, start):
    """Of the rows that start where each does, the one that was measured first in the order of positions."""
    order = np.lexsort(measured.T[::-1])
    _, first, place = np.unique(start[order], axis=0, return_index=True, return_inverse=True)
    result = np.empty(len(start), int)
    result[order] = order[first][place.ravel()]
    return result


def refine(weights, measured, start, normal, noise, corner):
    measured, start, normal, noise = (np.ascontiguousarray(a, F) for a in (measured, start, normal, noise))
    first = first_at_place(measured, start)
    measured, normal, noise = measured[first], normal[first], noise[first]
    lists = lists_of(start, corner)
    classical = slid(start, normal, noise, lists[0])
    scales = [Edges(classical, normal, measured, noise, index).scale() for index in lists]
    up, side = sides_of(normal, scales[1][0])
    turned = dot(scales[1][0], normal) < 0
    back = measured - classical
    state = activations(point_features(scales, up, turned, back, noise) @ weights.input.T + weights.input_bias)
    moves = can_move(normal, noise)
    unit = np.where(moves, noise[:, None], F(1))
    step = (classical - start) / unit
    for layer, s in zip(weights.layers, spec.PLAN):
        edges, index, size = Edges(classical, up, measured, noise, lists[s]), lists[s], scales[s][1]
        there = np.clip((state @ layer["other"].T + 4) >> 3, -32768, 32767)
        own = state @ layer["own"].T + layer["own_bias"]
        hidden = activations(own[:, None] + 8 * there[index] + edges.features(side, size, up) @ layer["edge"].T)
        if layer["gate"] is not None:
            gates = (hidden @ layer["gate"].T).astype(F)
            pulls = edges.pulls()
            pull = gates[..., 0] * pulls[0] + gates[..., 1] * pulls[1]
            along = gates[..., 2] * (F(1) / size)[:, None]
            step = step + F(2.0**-15) * summed(pull[..., None] * edges.normal + along[..., None] * edges.offset)
        mean = (hidden.sum(1) + K // 2) // K
        state = activations(np.concatenate([state, mean, hidden.max(1)], 1) @ layer["update"].T + layer["update_bias"])
    out = F(2.0**-11) * (state @ weights.output.T + weights.output_bias).astype(F)
    step = (step + out[:, :1] * up) + (out[:, 1] / noise)[:, None] * back
    square, trust = dot(step, step)[:, None], F(weights.trust) * F(weights.trust)
    step = np.where(square > trust, (trust / np.where(square > 0, square, F(1))) * step, step)
    return np.where(moves, start + unit * step, start)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    cloud = np.load(sys.argv[2])
    columns = [cloud[name] for name in ("measured", "classical", "normal", "noise", "corner")]
    np.save(sys.argv[3], refine(Weights(sys.argv[1]), *columns))
