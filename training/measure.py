# SPDX-License-Identifier: Apache-2.0
"""What a program leaves of a cloud's error, as a dictionary of numbers. README.md says what each is."""
import pathlib
import time

import numpy as np
from scipy.spatial import cKDTree

import store
from cloud import Cloud
from rays import Caster

MOST_POINTS = 20_000                              # of a cloud are measured
MOST_PLACES = 3_000                               # of a cloud have their true noise compared
CLEAN_SHARE = 1e-4                                # less noise than this share of the spacing is none
WIDTHS = (.6, .8, 1.25, 1.6, 2.2, 3.2, 4.5, 6.5)      # of the bound: factors on the radius of a run that is told the noise


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=float)))) if len(values) else 0.0


def is_clean(cloud: Cloud) -> bool:
    return cloud.sigma < CLEAN_SHARE * cloud.typical_spacing


class Truth:
    """What is measured of a cloud, whatever the program."""

    def __init__(self, cloud: Cloud):
        self.cloud = cloud
        rng = np.random.default_rng(1)
        surface = np.flatnonzero(cloud.surface)
        self.picked = np.sort(rng.permutation(surface)[:MOST_POINTS])
        self.places = np.sort(rng.permutation(surface)[:MOST_PLACES])
        self.loose = np.flatnonzero(~cloud.surface)
        self.caster = Caster(cloud.vertices, cloud.triangles)
        self.before = self.caster.distance(cloud.points[self.picked])
        self.noise = cloud.local_noise(self.places)
        nearest = cKDTree(cloud.clean[self.places]).query(cloud.clean[self.picked])[1]
        self.allowed = np.maximum(self.noise[nearest], .01 * cloud.typical_spacing)

    def facts(self) -> dict:
        """Of the cloud itself."""
        cloud = self.cloud
        edge = cloud.edge[self.picked]
        return {"points": len(cloud.points), "spacing": cloud.typical_spacing, "sigma": cloud.sigma, "clean": bool(is_clean(cloud)),
                "surface": float(cloud.surface.mean()), "mean": float(self.before.mean()), "rms": rms(self.before),
                "edge_rms": rms(self.before[edge]), "noise_rms": rms(self.noise), "settings": cloud.settings}

    def of(self, points: np.ndarray, said: np.ndarray | None) -> dict:
        """Of these points and, per point, the noise that the program says."""
        cloud = self.cloud
        after = self.caster.distance(points[self.picked])
        moved = np.linalg.norm(points.astype(float) - cloud.points, axis=1)
        worse = after > self.before + self.allowed
        edge, spacing = cloud.edge[self.picked], cloud.typical_spacing
        result = {"mean": float(after.mean()), "rms": rms(after), "edge_rms": rms(after[edge]), "worse": float(worse.mean()),
                  "moved": rms(moved[self.picked]) / spacing, "moved_most": float(moved[self.picked].max()) / spacing}
        if len(self.loose) > .05 * len(moved):
            result["loose"] = float((moved[self.loose] > .1 * cloud.spacing[self.loose]).mean())
        if said is not None:
            result |= agreement(said[self.places], self.noise, spacing)
        return result


def agreement(said: np.ndarray, true: np.ndarray, spacing: float) -> dict:
    """Shares of the places where the program's noise is within 25 and 50 % of the true one (below a thousandth of the spacing
    both count as none), and the mean and spread of the logarithm of said over true."""
    floor = 1e-3 * spacing
    ratio = np.log(np.maximum(said, floor) / np.maximum(true, floor))
    return {"within_25": float((np.abs(ratio) < np.log(1.25)).mean()), "within_50": float((np.abs(ratio) < np.log(1.5)).mean()),
            "log_bias": float(ratio.mean()), "log_rms": rms(ratio)}


class Subject:
    """One cloud whose results are looked up or made; the cloud is read only if it is needed."""

    def __init__(self, family: str, seed: int):
        self.family, self.seed = family, seed
        self.name = f"{family}-{seed}"
        self._truth: Truth | None = None
        measured = store.digest(*(pathlib.Path(__file__).with_name(name).read_bytes() for name in ("measure.py", "rays.cpp")))
        self._key = f"{store.generator_version()}-{measured}/{self.name}"

    @property
    def truth(self) -> Truth:
        if self._truth is None:
            self._truth = Truth(store.stored_cloud(self.family, self.seed))
        return self._truth

    @property
    def ply(self) -> pathlib.Path:
        path = store.cloud_path(self.family, self.seed).with_suffix(".ply")
        if not path.exists():
            store.stored_cloud(self.family, self.seed)
        return path

    def facts(self) -> dict:
        return store.stored(f"{self._key}/facts", lambda: self.truth.facts())

    def result(self, program: pathlib.Path, options: list[str]) -> dict:
        """What the program leaves with these options; {"failed": why} if it fails."""
        def make() -> dict:
            begin = time.perf_counter()
            try:
                points, attributes, report, _ = store.run_program(program, self.ply, options)
            except store.ProgramFailed as why:
                return {"failed": str(why)}
            seconds = time.perf_counter() - begin
            told = {key: report["params"][key] for key in ("radius", "min_neighbors", "flat_scale")}
            return self.truth.of(points, attributes.get("noise")) | {"seconds": seconds, "params": told, "said": report["noise"]["before"]}

        key = store.digest(*(option.encode() for option in options)) if options else "default"
        return store.stored(f"{self._key}/{store.program_version(program)}-{key}", make)

    def bounds(self, program: pathlib.Path) -> dict:
        """The results when told the noise, and with the best of some widths besides; what is not given stays as it was."""
        noise = ["--noise", f"{self.facts()['noise_rms']:.6g}"]
        told = self.result(program, noise)
        if "failed" in told:
            return {"told": told, "width": told, "factor": 1.0}
        params = told["params"]
        best, factor = told, 1.0
        for width in WIDTHS:
            options = [*noise, "--radius", f"{width * params['radius']:.6g}", "--min-neighbors", str(params["min_neighbors"]),
                       "--flat-scale", str(params["flat_scale"])]
            tried = self.result(program, options)
            if "failed" not in tried and tried["mean"] < best["mean"]:
                best, factor = tried, width
        return {"told": told, "width": best, "factor": factor}


