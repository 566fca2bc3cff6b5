# SPDX-License-Identifier: Apache-2.0
"""What sensors share: rays of cameras, jumps in depth, beams of finite width, and the rows that a sensor gives."""
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation

import rays
from scene import Scene
from shapes import unit

BEAM_RAYS = 3                                     # around the middle one


@dataclass
class Rows:
    """Points that sensors gave, one after another."""
    points: np.ndarray                            # (n, 3) as measured
    clean: np.ndarray                             # (n, 3) where the ray truly hit
    normal: np.ndarray                            # (n, 3) true, towards the sensor
    sensor: np.ndarray                            # (n, 3) where it stood
    part: np.ndarray                              # (n,) of the scene
    mixed: np.ndarray                             # (n,) bool: the beam met two surfaces and the point is off both
    jump: np.ndarray                              # (n,) bool: next to a jump in depth

    def take(self, index) -> "Rows":
        return Rows(**{name: value[index] for name, value in vars(self).items()})


def together(views: list[Rows]) -> Rows:
    return Rows(**{name: np.concatenate([getattr(view, name) for view in views]) for name in vars(views[0])})


def kept(scene: Scene, keep: np.ndarray, points, clean, normal, origin, triangle, mixed, jump) -> Rows:
    """The kept pixels of a grid as rows; `mixed` holds kept pixels already."""
    return Rows(points[keep], clean[keep], normal[keep], np.broadcast_to(origin, points.shape)[keep],
                scene.part[triangle[keep]], mixed, jump[keep])


def jumps(points: np.ndarray, normal: np.ndarray, valid: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Pixels within two of one that is off their plane by more than 4 spacings, or of one without a hit."""
    flag = np.zeros(valid.shape, bool)
    for axis in (0, 1):
        ahead = [slice(None)] * 2
        behind = [slice(None)] * 2
        ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
        ahead, behind = tuple(ahead), tuple(behind)
        with np.errstate(invalid="ignore"):
            way = points[ahead] - points[behind]
            off = np.minimum(np.abs((way * normal[behind]).sum(-1)), np.abs((way * normal[ahead]).sum(-1)))
            flag[behind] |= ~valid[ahead] | (off > 4 * spacing[behind])
            flag[ahead] |= ~valid[behind] | (off > 4 * spacing[ahead])
    return binary_dilation(flag, iterations=1) & valid


def beam(caster: rays.Caster, origin, directions, first: np.ndarray, radius: float, spread: float, reach: float):
    """Ranges of beams of finite width (the middle ray and some around) and how widely their returns differ. Returns within
    `reach` of the middle one are averaged, a mixed pixel; farther ones are told apart and left out."""
    hit = np.isfinite(first)
    mean, wide = first.copy(), np.zeros(first.shape)
    d, t0 = directions[hit], first[hit]
    o = np.broadcast_to(origin, directions.shape)[hit]
    across = unit(np.cross(d, np.where(np.abs(d[:, 2:]) > .9, [1.0, 0, 0], [0, 0, 1.0])))
    up = np.cross(d, across)
    ranges = [t0]
    for k in range(BEAM_RAYS):
        angle = 2 * np.pi * k / BEAM_RAYS
        aside = np.cos(angle) * across + np.sin(angle) * up
        ranges.append(caster.cast(o + radius * aside, unit(d + spread * aside))[0])
    ranges = np.stack(ranges)
    weight = np.array([.4] + [.6 / BEAM_RAYS] * BEAM_RAYS)[:, None]
    alike = np.isfinite(ranges) & (np.abs(ranges - t0) < reach)
    ranges = np.where(alike, ranges, t0)
    mean[hit] = (weight * alike * ranges).sum(0) / (weight * alike).sum(0)
    wide[hit] = ranges.max(0) - ranges.min(0)
    return mean, wide


def camera(origin, target, size: tuple[int, int], focal: float) -> np.ndarray:
    """A ray a pixel (rows, columns, 3), of depth 1 along the optical axis; focal length in pixels."""
    forward = unit(np.asarray(target, float) - origin)
    right = unit(np.cross(forward, [0, 0, 1.0] if abs(forward[2]) < .95 else [1.0, 0, 0]))
    up = np.cross(right, forward)
    u, v = np.meshgrid(np.arange(size[0]) - size[0] / 2 + .5, np.arange(size[1]) - size[1] / 2 + .5)
    return forward + (u / focal)[..., None] * right - (v / focal)[..., None] * up


def spherical(azimuths: np.ndarray, elevations: np.ndarray) -> np.ndarray:
    """Directions (elevations, azimuths, 3), angles in degrees."""
    azimuth, elevation = np.meshgrid(np.radians(azimuths), np.radians(elevations))
    return np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)


def around(count: int, radius: float) -> np.ndarray:
    """Places spread evenly over a sphere (a Fibonacci spiral)."""
    k = np.arange(count) + .5
    phi, theta = np.arccos(1 - 2 * k / count), np.pi * (1 + 5 ** .5) * k
    return radius * np.stack([np.cos(theta) * np.sin(phi), np.sin(theta) * np.sin(phi), np.cos(phi)], 1)


def cross_turn(axis_angle: np.ndarray, points: np.ndarray) -> np.ndarray:
    """What a small turn (radians) adds to points."""
    return np.cross(np.broadcast_to(axis_angle, points.shape), points)
