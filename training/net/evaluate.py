# SPDX-License-Identifier: Apache-2.0
"""One table for all candidates: what each leaves of held-out pieces, over what the default run leaves.

    python evaluate.py DATA STATE...

A row is a state of train.py; a cell has geometric means of mean distance, its root mean square, and Chamfer distance.
"""
import sys

import torch

import data
import model
import train


def main(folder, states):
    device = "cuda" if torch.cuda.is_available() else "cpu"
    pieces = data.Pieces(device)
    pieces.load(folder)
    chosen = pieces.held_out or pieces.training
    for state in states:
        net = model.Net().to(device)
        net.load_state_dict(torch.load(state, map_location=device)["smooth"])
        print(f"{state}: {len(chosen)} pieces: {train.validate(net, chosen, 1)}", flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2:])
