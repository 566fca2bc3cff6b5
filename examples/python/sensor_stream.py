# SPDX-License-Identifier: Apache-2.0
"""Frames of a depth camera: each frame is one load and one run.

    python sensor_stream.py FOLDER_OF_PLY_FILES OUTPUT_FOLDER"""
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
    source, target = map(pathlib.Path, sys.argv[1:3])
    paths = sorted(source.glob("*.ply"))
    if not paths:
        sys.exit(f"{source}: there is no file *.ply")
    target.mkdir(parents=True, exist_ok=True)
    clouds = (pf.read(path).xyz.astype(np.float32) for path in paths)
    for path, smooth in zip(paths, denoise_frames(clouds)):
        pf.write(target / path.name, smooth)
