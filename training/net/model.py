# SPDX-License-Identifier: Apache-2.0
"""The net in PyTorch, with weights and activations rounded as the program rounds them while gradients pass."""
import torch
from torch import nn

import spec


class Rounded(torch.autograd.Function):
    """floor(x + 0.5), within bounds; the gradient passes inside them."""

    @staticmethod
    def forward(ctx, x, low, high):
        ctx.save_for_backward((x >= low) & (x <= high))
        return torch.floor(x + 0.5).clamp(low, high)

    @staticmethod
    def backward(ctx, gradient):
        (inside,) = ctx.saved_tensors
        return gradient * inside, None, None


def activation(x):
    return Rounded.apply(x * spec.ACTIVATION, 0.0, 127.0) / spec.ACTIVATION


def whole(value, coding):
    """A feature as the net reads it: no gradient."""
    factor, offset = coding
    return torch.floor(value * factor + (offset + 0.5)).clamp(0, 127) / spec.ACTIVATION


class Linear(nn.Module):
    """Rounded weights, and a rounded bias unless told otherwise."""

    def __init__(self, inputs, outputs, bias=True, gain=1.0, offset=False):
        super().__init__()
        self.weight = nn.Parameter(torch.randn(outputs, inputs) * gain / inputs**0.5)
        # inputs that are coded around 64 have a mean of 2
        self.bias = nn.Parameter(-2 * self.weight.detach().sum(1) if offset else torch.zeros(outputs)) if bias else None

    def rounded(self):
        weight = Rounded.apply(self.weight * spec.WEIGHT, -127.0, 127.0) / spec.WEIGHT
        bias = Rounded.apply(self.bias * spec.SUM, -(2.0**30), 2.0**30) / spec.SUM if self.bias is not None else None
        return weight, bias

    def forward(self, x):
        return nn.functional.linear(x, *self.rounded())


class Layer(nn.Module):
    def __init__(self, gated):
        super().__init__()
        c = spec.CHANNELS
        self.own = Linear(c, c, offset=True)
        self.other = Linear(c, c, bias=False)
        self.edge = Linear(spec.EDGE_FEATURES, c, bias=False)
        with torch.no_grad():
            self.own.bias -= 2 * self.edge.weight.sum(1)
        self.update = Linear(3 * c, c, gain=0.6)
        with torch.no_grad():
            self.update.weight[:, :c] += torch.eye(c)
        self.gate = Linear(c, spec.GATES, bias=False, gain=0.1) if gated else None

    def forward(self, state, index, features):
        there = Rounded.apply(self.other(state) * spec.STORED, -32768.0, 32767.0) / spec.STORED
        there = there.index_select(0, index.flatten()).view(*index.shape, -1)  # its gradient needs no sorting
        hidden = activation(self.own(state)[:, None] + there + self.edge(features))
        mean = activation(hidden.mean(1))
        state = activation(self.update(torch.cat([state, mean, hidden.amax(1)], 1)))
        return state, self.gate(hidden) if self.gate is not None else None


def dot(a, b):
    return (a * b).sum(-1)


def of_scale(measured, y, n, noise, index, side):
    """Of one scale: features of edges, their vectors, features of points, and the size of neighbourhoods."""
    d = y[index] - y[:, None]
    square = dot(d, d)
    size = square.mean(1).sqrt().clamp_min(1e-30)
    own = n[:, None]
    there = n[index]
    turn = dot(own, there)
    there = there * torch.where(turn < 0, -1.0, 1.0)[..., None]
    turn = turn.abs().clamp_max(1.0)
    sine = (1 - turn * turn).clamp_min(0).sqrt()
    height, its_height = dot(d, own), dot(d, there)
    per_noise, per_size = 1 / noise[:, None], 1 / size[:, None]
    raw = measured[index] - y[:, None]
    its_back = dot(raw - d, there) / noise[index]
    features = torch.stack(
        [
            whole(square * per_size * per_size, spec.SIZE),
            whole(height * per_noise, spec.HEIGHT),
            whole(its_height * per_noise, spec.HEIGHT),
            whole(height * per_size, spec.SLOPE),
            whole(its_height * per_size, spec.SLOPE),
            whole(sine, spec.SHARE),
            whole(turn, spec.SHARE),
            whole(noise[index] / (noise[index] + noise[:, None]), spec.SHARE),
            whole(its_back, spec.HEIGHT),
            whole(dot(raw, own) * per_noise, spec.HEIGHT),
            whole(dot(d, side[:, None]) * per_size, spec.SIDE),
            whole((noise[:, None] / (noise[:, None] + square.sqrt())).sqrt(), spec.SHARE),
        ],
        2,
    )
    clip = lambda x: x.clamp(-spec.CLIP, spec.CLIP)[..., None]
    vectors = torch.stack(
        [clip(its_height * per_noise) * there, clip(dot(raw, there) * per_noise) * there, d * per_size[..., None]], 2
    )
    mean, mean_square = height.mean(1), (height * height).mean(1).sqrt()
    across = d.mean(1) - mean[:, None] * n
    of_point = [
        whole(mean / noise, spec.HEIGHT),
        whole(mean_square / noise, spec.SIZE),
        whole(mean_square / size, spec.STEEPNESS),
        whole((noise / (noise + size)).sqrt(), spec.SHARE),
        whole(sine.mean(1), spec.SHARE),
        whole(dot(across, across).sqrt() / size, spec.SHARE),
    ]
    return features, vectors, of_point, size


def slid(start, normal, noise, index):
    """Where points lie after they slid apart along the surface, at most one noise each; `noise` is positive."""
    place, own, unit = start, normal[:, None], noise[:, None]
    moves = (dot(normal, normal) > 0)[:, None]
    for _ in range(spec.SLIDES):
        offset = place[index] - place[:, None]
        across = offset - dot(offset, own)[..., None] * own
        square = dot(across, across)
        near = (1 - square / square.mean(1, keepdim=True).clamp_min(1e-30)).clamp_min(0) ** 4
        way = ((place - start) - spec.SLIDE * (near[..., None] * across).sum(1)) / unit
        way = way * (spec.FARTHEST_SLIDE / dot(way, way).sqrt().clamp_min(spec.FARTHEST_SLIDE))[:, None]
        place = torch.where(moves, start + unit * way, start)
    return place


class Geometry:
    """All that the net reads of a cloud, without gradients: features of points and edges, and the vectors that gates
    weigh. `lists` holds the neighbours of each point, scale by scale, among the places where it starts."""

    def __init__(self, measured, start, normal, noise, lists):
        self.lists = lists
        classical = slid(start, normal, noise, lists[0])
        self.start, self.noise = start, noise
        self.slide = (classical - start) / noise[:, None]
        self.back = (measured - classical) / noise[:, None]
        offset = classical[lists[1]].sub(classical[:, None]).mean(1)
        up = torch.where(dot(offset, normal) < 0, -1.0, 1.0)
        self.normal = normal * up[:, None]
        side = offset - dot(offset, self.normal)[:, None] * self.normal
        length = dot(side, side).sqrt()
        side = side / torch.where(length > 0, length, torch.ones_like(length))[:, None]
        self.edges, self.vectors, points, sizes = [], [], [], []
        for index in lists:
            features, vectors, of_point, size = of_scale(measured, classical, self.normal, noise, index, side)
            self.edges.append(features)
            self.vectors.append(vectors)
            points += of_point
            sizes.append(size)
        points += [whole(dot(self.back, self.back).sqrt(), spec.SIZE), whole(dot(self.back, self.normal), spec.HEIGHT)]
        points += [whole(sizes[0] / sizes[1], spec.SHARE), whole(sizes[0] / sizes[3], spec.SHARE)]
        self.points = torch.stack(points, 1)


class Net(nn.Module):
    def __init__(self):
        super().__init__()
        self.input = Linear(spec.POINT_FEATURES, spec.CHANNELS, offset=True)
        self.layers = nn.ModuleList(Layer(i >= spec.GATED) for i in range(len(spec.PLAN)))
        self.output = Linear(spec.CHANNELS, spec.OUTPUTS, gain=0.1)

    def core(self, points, edges, vectors, lists, normal, back, slide):
        """The way of each point, in noises."""
        state = activation(self.input(points))
        step = slide
        for layer, scale in zip(self.layers, spec.PLAN):
            state, gate = layer(state, lists[scale], edges[scale])
            if gate is not None:
                step = step + (gate[..., None] * vectors[scale]).sum((1, 2)) / spec.NEIGHBORS
        out = self.output(state)
        step = step + out[:, :1] * normal + out[:, 1:] * back
        square = dot(step, step)[:, None]
        trust = spec.TRUST**2
        return step * torch.where(square > trust, trust / square.clamp_min(trust), torch.ones_like(square))

    def forward(self, g):
        way = self.core(g.points, g.edges, g.vectors, g.lists, g.normal, g.back, g.slide)
        return g.start + g.noise[:, None] * way
