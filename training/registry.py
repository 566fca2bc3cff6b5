# SPDX-License-Identifier: Apache-2.0
"""What a family of clouds is: a function that draws a scene and what a sensor gave of it, registered under its name."""
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from errors import Random
from scene import Scene
from views import Rows


class Useless(Exception):
    """A scene or place that gives no cloud; another is drawn."""


@dataclass
class Drawn:
    """What a family gives."""
    scene: Scene
    rows: Rows
    settings: dict = field(default_factory=dict)
    same: np.ndarray | None = None                # (n,) which rows are copies of one measurement
    rounding: float = 0.0                         # coordinates in whole multiples of it
    has_sensor: bool = True
    keep_axes: bool = False                       # a cloud that must stay aligned is not turned


@dataclass
class Family:
    name: str
    draw: Callable[[Random], Drawn]
    group: str                                    # scans, objects, special, clean
    correlated: bool                              # errors of neighbours are alike


FAMILIES: dict[str, Family] = {}


def family(group: str, correlated: bool = False):
    """Registers a function as the family of its name."""
    def register(function: Callable[[Random], Drawn]):
        FAMILIES[function.__name__] = Family(function.__name__, function, group, correlated)
        return function
    return register
