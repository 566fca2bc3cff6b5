# SPDX-License-Identifier: Apache-2.0
"""draw(family, seed) makes one cloud; FAMILIES names all kinds. The same family and seed give the same cloud."""
import zlib

import numpy as np
from scipy.spatial import cKDTree

import object_families  # noqa: F401  each adds its families
import scan_families  # noqa: F401
import special_families  # noqa: F401
from cloud import Cloud
from errors import Random
from registry import FAMILIES, Drawn, Useless
from scene import Scene
from shapes import turned

TRIES = 20                                        # a scene in which a sensor sees too little is drawn again
FEWEST_POINTS = 250


def spacing_of(clean: np.ndarray, same: np.ndarray | None) -> np.ndarray:
    """Mean distance to the six nearest clean points of other measurements."""
    if same is None:
        return cKDTree(clean).query(clean, 7)[0][:, 1:].mean(1)
    _, first, back = np.unique(same, return_index=True, return_inverse=True)
    once = clean[first]
    return cKDTree(once).query(once, 7)[0][:, 1:].mean(1)[back.ravel()]


def near_edges(scene: Scene, clean: np.ndarray, spacing: np.ndarray, jump: np.ndarray) -> np.ndarray:
    """Within two spacings of a sharp edge or next to a jump in depth."""
    typical = float(np.median(spacing))
    samples = scene.edge_samples(max(typical, 1e-9))
    inside = np.all((samples > clean.min(0) - typical) & (samples < clean.max(0) + typical), axis=1)
    if not inside.any():
        return jump.copy()
    return jump | (cKDTree(samples[inside]).query(clean, distance_upper_bound=2 * spacing.max())[0] < 2 * spacing)


def finish(drawn: Drawn, name: str, seed: int, rng: Random) -> Cloud:
    """Turns it, brings it to a local origin, rounds, measures spacing and edges."""
    rows = drawn.rows
    finite = np.isfinite(rows.points).all(1) & np.isfinite(rows.clean).all(1)
    rows, same = rows.take(finite), drawn.same[finite] if drawn.same is not None else None
    if len(rows.points) < FEWEST_POINTS:
        raise Useless
    spacing = spacing_of(rows.clean, same)
    edge = near_edges(drawn.scene, rows.clean, spacing, rows.jump)
    degrees = 0.0 if drawn.keep_axes else rng.uniform(0, 360)
    origin = np.median(turned((rows.clean, None), degrees)[0], axis=0)
    points, clean, sensor, vertices = (turned((array, None), degrees)[0] - origin
                                       for array in (rows.points, rows.clean, rows.sensor, drawn.scene.vertices))
    normal = turned((rows.normal, None), degrees)[0]
    if drawn.rounding:
        points = np.round(points / drawn.rounding) * drawn.rounding
    single = np.float32
    return Cloud(name, seed, points.astype(single), clean.astype(single), normal.astype(single),
                 ~rows.mixed & ~drawn.scene.is_leaf(rows.part), edge, rows.part.astype(np.int16), spacing.astype(single),
                 vertices.astype(single), drawn.scene.triangles.astype(np.int32), list(drawn.scene.names),
                 sensor.astype(single) if drawn.has_sensor else None, drawn.settings)


def draw(name: str, seed: int) -> Cloud:
    """One cloud of a family."""
    for attempt in range(TRIES):
        rng = np.random.default_rng([zlib.crc32(name.encode()), seed, attempt])
        try:
            return finish(FAMILIES[name].draw(rng), name, seed, rng)
        except Useless:
            continue
    raise RuntimeError(f"{name}: {TRIES} scenes in a row gave no cloud: check the family's settings")
