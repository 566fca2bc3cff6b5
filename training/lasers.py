# SPDX-License-Identifier: Apache-2.0
"""Sensors that measure ranges along rays: on a tripod, spinning, airborne. Lengths in metres, angles in degrees."""
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from errors import Random
from scene import Scene
from shapes import unit
from views import Rows, beam, cross_turn, jumps, kept, spherical, together


@dataclass
class Station:
    """Where a tripod stands and the field that it sees."""
    place: tuple[float, float, float]
    azimuths: tuple[float, float]
    elevations: tuple[float, float]


def angle_step(scene: Scene, station: Station, count: int, reach: float) -> float:
    """The step in azimuth and elevation that gives about `count` points."""
    directions = spherical(np.linspace(*station.azimuths, 48), np.linspace(*station.elevations, 32))
    share = max(float((scene.caster.cast(np.asarray(station.place), directions)[0] < reach).mean()), .02)
    return float(np.sqrt(np.ptp(station.azimuths) * np.ptp(station.elevations) * share / count))


def terrestrial(scene: Scene, rng: Random, stations: list[Station], count: int, sigma: float, per_metre: float,
                jitter: float = .002, radius: float = .002, divergence: float = .0003, reach: float = 80.0,
                register: float = 0.0, clean: bool = False, grazing: float = .05) -> Rows:
    """Noise along the ray of sigma + per_metre * range, more at grazing angles; an angle jitter; footprints (radius in metres,
    divergence in radians) that mix surfaces within 1.5 m; later stations off by `register`. Rays that meet a surface at a
    sine below `grazing` are lost."""
    views = []
    for number, station in enumerate(stations):
        origin = np.asarray(station.place, float)
        step = angle_step(scene, station, count // len(stations), reach)
        told = spherical(np.arange(*station.azimuths, step), np.arange(*station.elevations, step))
        true = unit(told + np.radians(jitter) * rng.normal(size=told.shape)) if not clean else told
        ranges, normal, triangle = scene.caster.cast(origin, true)
        valid = ranges < reach
        ranges = np.where(valid, ranges, np.nan)
        exact = origin + ranges[..., None] * true
        sine = np.abs((normal * true).sum(-1))
        keep = valid & (sine > grazing)
        near = jumps(exact, normal, valid, np.nan_to_num(ranges * np.radians(step), nan=1))
        if clean:
            views.append(kept(scene, keep, exact, exact, normal, origin, triangle, np.zeros(keep.sum(), bool), near))
            continue
        mean, wide = beam(scene.caster, origin, true, ranges, radius, divergence, 1.5)
        spread = (sigma + per_metre * ranges) / np.sqrt(np.maximum(sine, .1))
        points = origin + (mean + spread * rng.normal(size=mean.shape))[..., None] * told
        points = points + (register * rng.normal(size=3) if number else 0)
        mixed = (wide > 8 * spread)[keep]
        mixed[mixed] = scene.caster.distance(points[keep][mixed]) > 5 * spread[keep][mixed]
        views.append(kept(scene, keep, points, exact, normal, origin, triangle, mixed, near))
    return together(views)


def spinning(scene: Scene, rng: Random, start, move, sweeps: int, elevations: np.ndarray, count: int, sigma: float,
             quantum: float, pose: float = 0.0, pose_degrees: float = 0.0, ring: float = 0.0, reach: float = 60.0,
             azimuths: tuple[float, float] = (-180.0, 180.0)) -> Rows:
    """A lidar that turns: beams at `elevations`, noise sigma, ranges in whole quanta; each of its rings off in range by a
    constant of spread `ring`; several sweeps from places `move` apart, each with an error of pose (metres, degrees)."""
    views = []
    rings = ring * rng.normal(size=len(elevations))[:, None]
    sample = spherical(np.linspace(*azimuths, 90), elevations)
    share = max(float((scene.caster.cast(np.asarray(start, float), sample)[0] < reach).mean()), .02)
    step = np.ptp(azimuths) * len(elevations) * sweeps * share / count
    for number in range(sweeps):
        origin = np.asarray(start, float) + number * np.asarray(move, float)
        directions = spherical(np.arange(*azimuths, step) + step * rng.uniform(), elevations)
        ranges, normal, triangle = scene.caster.cast(origin, directions)
        valid = ranges < reach
        ranges = np.where(valid, ranges, np.nan)
        exact = origin + ranges[..., None] * directions
        mean, wide = beam(scene.caster, origin, directions, ranges, .003, .0012, .5)
        measured = mean + sigma * rng.normal(size=mean.shape) + rings
        if quantum:
            measured = np.round(measured / quantum) * quantum
        points = measured[..., None] * directions
        points = origin + points + cross_turn(np.radians(pose_degrees) * rng.normal(size=3), points) + pose * rng.normal(size=3)
        near = jumps(exact, normal, valid, np.nan_to_num(ranges * np.radians(.4), nan=1))
        keep = valid & (np.abs((normal * directions).sum(-1)) > .02)
        mixed = (wide > 8 * sigma)[keep]
        mixed[mixed] = scene.caster.distance(points[keep][mixed]) > 5 * sigma
        views.append(kept(scene, keep, points, exact, normal, origin, triangle, mixed, near))
    return together(views)


def airborne(scene: Scene, rng: Random, lines, half: float, height: float, count: int, sigma: float, pointing: float,
             strip: float, clean: bool = False) -> Rows:
    """Strips along x at the given y over a square of 2 `half`: saw-tooth lines, noise sigma along the ray, an error of
    pointing in degrees, strips that differ by `strip` in height."""
    views, step = [], 2 * half / np.sqrt(count / len(lines))
    for number, y in enumerate(lines):
        ax, ay = np.meshgrid(np.arange(-half, half, step), np.arange(-half, half, step))
        shape = ax.shape
        aim = np.stack([ax + ay % (2 * step) * .3 + .25 * step * rng.normal(size=shape),
                        ay + .15 * step * rng.normal(size=shape), np.zeros(shape)], -1)
        origin = np.stack([ax, np.full(shape, float(y)), np.full(shape, height)], -1)
        directions = unit(aim - origin)
        ranges, normal, triangle = scene.caster.cast(origin, directions)
        valid = np.isfinite(ranges)
        ranges = np.where(valid, ranges, np.nan)
        exact = origin + ranges[..., None] * directions
        near = jumps(exact, normal, valid, np.full(shape, step))
        if clean:
            views.append(kept(scene, valid, exact, exact, normal, origin, triangle, np.zeros(valid.sum(), bool), near))
            continue
        mean, wide = beam(scene.caster, origin, directions, ranges, 0.0, .0003, 1.0)
        told = unit(directions + np.radians(pointing) * rng.normal(size=directions.shape))
        points = origin + (mean + sigma * rng.normal(size=shape))[..., None] * told
        points = points + [0, 0, strip * (number - (len(lines) - 1) / 2)]
        mixed = (wide > 8 * sigma)[valid]
        mixed[mixed] = scene.caster.distance(points[valid][mixed]) > 5 * sigma
        views.append(kept(scene, valid, points, exact, normal, origin, triangle, mixed, near))
    return together(views)


def fans(scene: Scene, rng: Random, half: float, height: float, angle: float, lines: int, beams: int, sigma: float,
         jitter: float, heave: float = 0.0, roll: float = 0.0, memory: float = 10.0, swing: bool = False) -> Rows:
    """Lines at even steps along y, each a fan of beams at even steps within `angle` degrees of straight down, to and fro with
    `swing`: noise sigma along the ray, more with distance, and jitter of beams in degrees. What is not known of heave (metres) and
    roll (degrees) is one number a line, correlated over `memory` lines."""
    y = np.linspace(-half, half, lines)[:, None] + np.zeros(beams)
    tilt = np.radians(np.linspace(-angle, angle, beams)) + np.zeros((lines, 1))
    if swing:
        tilt[1::2] = tilt[1::2, ::-1]
        y = y + np.linspace(0, 2 * half / lines, beams)
    slow = gaussian_filter1d(rng.normal(size=(2, lines + 1)), memory, mode="wrap")[:, :lines]
    up, lean = slow / slow.std(1, keepdims=True) * [[heave], [np.radians(roll)]]
    beam_of = lambda t: np.stack([np.sin(t), np.zeros_like(t), -np.cos(t)], -1)
    origin = np.stack([np.zeros_like(y), y, np.full_like(y, height)], -1)
    true = beam_of(tilt + np.radians(jitter) * rng.normal(size=tilt.shape))
    ranges, normal, triangle = scene.caster.cast(origin, true)
    keep = np.isfinite(ranges)
    ranges = np.where(keep, ranges, np.nan)
    exact = origin + ranges[..., None] * true
    measured = ranges + sigma * np.sqrt(np.nan_to_num(ranges, nan=height) / height) * rng.normal(size=ranges.shape)
    points = origin + measured[..., None] * beam_of(tilt + lean[:, None]) + up[:, None, None] * [0, 0, 1]
    near = jumps(exact, normal, keep, np.full(keep.shape, 2 * half / lines))
    return kept(scene, keep, points, exact, normal, origin, triangle, np.zeros(keep.sum(), bool), near)


def rosette(scene: Scene, rng: Random, origin, heading: float, half: float, petals: float, strokes: int, count: int, sigma: float,
            drift: float, ripple: float, jitter: float, reach: float = 60.0) -> Rows:
    """A beam that two turning prisms lead along a rosette of `half` radians: noise of sigma along the ray, more with distance and
    at grazing angles; `drift`, in sigmas, of the range along a stroke, and `ripple` with the turn of the prisms; jitter in degrees."""
    shots = 2 * count                                # some meet nothing
    turn = 2 * np.pi * strokes * np.arange(shots) / shots
    away = half * np.abs(np.sin(petals * turn + rng.uniform(0, 6)))
    azimuth, elevation = heading + away * np.cos(turn), rng.uniform(-.25, .1) + away * np.sin(turn)
    told = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)[None]
    true = unit(told + np.radians(jitter) * rng.normal(size=told.shape))
    ranges, normal, triangle = scene.caster.cast(np.asarray(origin), true)
    sine = np.abs((normal * true).sum(-1))
    keep = (ranges < reach) & (sine > .06)
    ranges = np.where(keep, ranges, np.nan)
    memory = np.exp(-1 / rng.uniform(8, 60))         # from shot to shot
    slow = lfilter([np.sqrt(1 - memory * memory)], [1, -memory], rng.normal(size=shots))
    late = (rng.random(shots) < .04) * rng.exponential(3, shots)
    error = (1 + ranges / 20) / np.sqrt(np.maximum(sine, .15)) * rng.normal(size=ranges.shape)
    error = error + drift * slow + ripple * np.sin(rng.integers(3, 40) * turn) + late
    exact, points = origin + ranges[..., None] * true, origin + (ranges + sigma * error)[..., None] * told
    none = np.zeros(keep.shape, bool)
    return kept(scene, keep, points, exact, normal, np.asarray(origin, float), triangle, none[keep], none)


def profiles(scene: Scene, rng: Random, start, length: float, lines: int, count: int, sigma: float, wobble: float,
             reach: float = 40.0) -> Rows:
    """A scanner that is driven `length` along x and whose beam turns in the plane across it: noise sigma along the ray, which
    stays in the plane but for `wobble` of the beam in degrees."""
    step = 2 * np.pi * lines / (2 * count)           # half of the shots meet nothing
    angles = np.arange(0, 2 * np.pi, step)
    x, angle = np.meshgrid(np.linspace(0, length, lines), angles, indexing="ij")
    origin = np.asarray(start) + x[..., None] * [1, 0, 0]
    told = np.stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)], -1)
    true = unit(told + np.radians(wobble) * rng.normal(size=told.shape))
    ranges, normal, triangle = scene.caster.cast(origin, true)
    sine = np.abs((normal * true).sum(-1))
    keep = (ranges < reach) & (sine > .06)
    ranges = np.where(keep, ranges, np.nan)
    exact = origin + ranges[..., None] * true
    points = origin + (ranges + sigma / np.sqrt(np.maximum(sine, .15)) * rng.normal(size=ranges.shape))[..., None] * told
    near = jumps(exact, normal, keep, np.nan_to_num(ranges * step, nan=1))
    return kept(scene, keep, points, exact, normal, origin, triangle, np.zeros(keep.sum(), bool), near)
