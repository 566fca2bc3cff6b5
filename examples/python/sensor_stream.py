# SPDX-License-Identifier: Apache-2.0
"""Frames of a depth camera: each frame is one load and one run.

    python sensor_stream.py FOLDER_OF_FRAMES OUTPUT_FOLDER"""
from __future__ import annotations

import pathlib
import sys
from typing import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

import pointfair as pf


def denoise_frames(frames: Iterable[NDArray[np.float32]], device: str = "auto") -> Iterator[NDArray[np.float32]]:
    """Each frame (N, 3), moved; the number of points may change from frame to frame.

    The noise of a depth camera grows with the depth, and only automatic lengths follow it from place to place. If the
    noise is the same everywhere, resolve the parameters once, which saves the estimates: params = pipeline.resolve(),
    then pipeline.run(params)."""
    pipeline = pf.Pipeline(device)
    for frame in frames:
        pipeline.load(frame)
        yield pipeline.run(outliers="keep")


if __name__ == "__main__":
    paths = sorted(pathlib.Path(sys.argv[1]).glob("*.ply"))
    clouds = (pf.read(path).xyz.astype(np.float32) for path in paths)
    for path, smooth in zip(paths, denoise_frames(clouds)):
        pf.write(pathlib.Path(sys.argv[2]) / path.name, smooth)
