# SPDX-License-Identifier: Apache-2.0
"""Denoised batches for training: a collate function of a DataLoader. Use it with worker processes that are spawned:

    torch.utils.data.DataLoader(clouds, 32, collate_fn=denoised, num_workers=4, multiprocessing_context="spawn")"""
from __future__ import annotations

from typing import Any

import torch

import pointfair as pf

# The noise is known: 1 % of the clouds' unit size.
PARAMS = pf.Params(k=16, noise=0.01)


def denoised(clouds: list[Any]) -> Any:
    """Takes B tensors (N, 3) and returns them denoised, as one tensor (B, N, 3)."""
    return pf.denoise_batch(torch.stack(clouds), PARAMS, threads=1)
