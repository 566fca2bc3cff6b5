# SPDX-License-Identifier: Apache-2.0
"""Writes a trained net as the file of whole numbers that the program reads (src/seam/net_weights.hpp).

    python export.py STATE... WEIGHTS [--trust 2]

Of several states, each trained on from the one before, the file has the mean: it keeps more of what the first knew.
"""
import argparse
import struct

import numpy as np
import torch

import spec

MAGIC, VERSION = b"pfweight", 2


def fingerprint(data):
    value = 0xCBF29CE484222325
    for byte in data:
        value = ((value ^ byte) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    return value


def rounded(tensor, steps, low, high):
    return np.clip(np.floor(tensor.double().numpy() * steps + 0.5), low, high)


def payload(state):
    weights = lambda name: rounded(state[f"{name}.weight"], spec.WEIGHT, -127, 127).astype("i1").tobytes()
    bias = lambda name: rounded(state[f"{name}.bias"], spec.SUM, -(2**30), 2**30).astype("<i4").tobytes()
    parts = [weights("input"), bias("input")]
    for i in range(len(spec.PLAN)):
        layer = f"layers.{i}."
        parts += [weights(layer + "own"), bias(layer + "own"), weights(layer + "other"), weights(layer + "edge")]
        parts += [weights(layer + "update"), bias(layer + "update")]
        parts += [weights(layer + "gate")] if i >= spec.GATED else []
    return b"".join(parts + [weights("output"), bias("output")])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("states", nargs="+", metavar="state")
    parser.add_argument("weights")
    parser.add_argument("--trust", type=float, default=spec.TRUST)
    a = parser.parse_args()
    states = [torch.load(state, map_location="cpu")["smooth"] for state in a.states]
    data = payload({name: sum(state[name].double() for state in states) / len(states) for name in states[0]})
    mark = fingerprint(data)
    with open(a.weights, "wb") as file:
        file.write(MAGIC + struct.pack("<IIQf", VERSION, len(data), mark, a.trust) + data)
    print(f"{a.weights}: {len(data) + 28} bytes, fingerprint {mark:016x}, trust {a.trust:g}")


if __name__ == "__main__":
    main()
