# SPDX-License-Identifier: Apache-2.0
"""Which points the coarse scales of pieces hold, and the lists of neighbours among them, drawn anew at each call.

The program chooses by a hash of positions. A net that sees the same coarse points each time that a piece comes up learns
what suits these; here the hash has a salt, as if the cloud were turned.
"""
import torch

import spec

K = spec.NEIGHBORS


def shares(places, salt):
    """Over [0, 1), the same for points with the same position: (..., 3) single floats, and a whole number for each piece."""
    words = (places + 0.0).view(torch.int32).long()
    value = salt
    for axis in range(3):
        value = (value ^ words[..., axis]) * -0xAE502812AA7333  # the odd constant of src/point/position.h, as 64 bits
        value = value ^ ((value >> 33) & 0x7FFFFFFF)
    value = value * -0x3B314601E57A13AD
    return ((value >> 40) & 0xFFFFFF).float() * 2.0**-24


def lists_of(places, cloud, finest, salt):
    """(pieces, scales, points, 16), from places (pieces, points, 3) and the lists of all points (pieces, points, 16).

    `cloud` numbers the clouds that share a piece, -1 for points that fill it; `salt` has a whole number for each piece.
    Where a point's own cloud has fewer than 16 others in a scale, the list of the finer scale stands again, as in the program.
    """
    count, points = places.shape[:2]
    share = torch.where(cloud < 0, 2.0, shares(places, salt[:, None]))
    lists, piece = [finest], torch.arange(count, device=places.device)[:, None]
    for stride in spec.STRIDES[1:]:
        most = min(points, points // stride * 11 // 10 + 64)  # more are rare, and those with the largest hashes are left out
        least, members = share.topk(most, dim=1, largest=False)
        there = places[piece, members]
        apart = sum((places[..., axis, None] - there[:, None, :, axis]).square() for axis in range(3))  # cdist is far slower
        foreign = (cloud[:, :, None] != cloud[piece, members][:, None]) | (least >= 1 / stride)[:, None]
        apart.masked_fill_(foreign, torch.inf)
        apart[piece, members, torch.arange(most, device=places.device)] = torch.inf  # a point itself
        away, which = apart.topk(K, largest=False)
        found = members[:, None].expand(-1, points, -1).gather(2, which)
        lists.append(torch.where(away[..., -1:] < torch.inf, found, lists[-1]))
    return torch.stack(lists, 1)
