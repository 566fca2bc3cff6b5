# SPDX-License-Identifier: Apache-2.0
"""Makes a state from a file of weights, so that training can go on from weights whose state is lost.

    python start.py WEIGHTS STATE [--trained SECONDS]

The optimiser starts anew. Exporting the state again gives the same file, bit by bit.
"""
import argparse
import struct

import numpy as np
import torch

import export
import model
import spec

HEAD = struct.calcsize("<8sIIQf")


def payload_of(path):
    """The bytes of the weights, and the trust in the head of the file."""
    with open(path, "rb") as file:
        head, data = file.read(HEAD), file.read()
    magic, version, size, mark, trust = struct.unpack("<8sIIQf", head.ljust(HEAD, b"\0"))
    if (magic, version, size, mark) != (export.MAGIC, export.VERSION, len(data), export.fingerprint(data)):
        raise SystemExit(f"{path}: no whole file of weights of version {export.VERSION}: name another, as src/learned/weights.bin")
    return data, trust


def filled(net, data):
    """The net with the numbers of the file, in the order of export.payload."""
    at = 0

    def take(tensor, kind, steps):
        nonlocal at
        numbers = np.frombuffer(data, kind, tensor.numel(), at)
        at += numbers.nbytes
        with torch.no_grad():
            tensor.copy_(torch.from_numpy(numbers / steps).reshape(tensor.shape))

    def both(linear):
        take(linear.weight, "i1", spec.WEIGHT)
        if linear.bias is not None:
            take(linear.bias, "<i4", spec.SUM)

    both(net.input)
    for layer in net.layers:
        for linear in (layer.own, layer.other, layer.edge, layer.update, layer.gate):
            if linear is not None:
                both(linear)
    both(net.output)
    assert at == len(data)
    return net


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights")
    parser.add_argument("state")
    parser.add_argument("--trained", type=float, default=0.0, help="seconds, from which the rate of learning goes on")
    a = parser.parse_args()
    data, trust = payload_of(a.weights)
    net = filled(model.Net(), data)
    optimiser = torch.optim.AdamW(net.parameters(), lr=1e-3, betas=(0.9, 0.98), weight_decay=1e-3)
    held = {"net": net.state_dict(), "smooth": net.state_dict(), "optimiser": optimiser.state_dict()}
    torch.save({"step": 0, "trained": a.trained} | held, a.state)
    print(f"{a.state}: {len(data)} bytes of weights, trust {trust:g}")


if __name__ == "__main__":
    main()
