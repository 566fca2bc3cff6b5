# SPDX-License-Identifier: Apache-2.0
"""The program pointfair, which comes with the package."""
from __future__ import annotations

import os

from ._errors import Error


def program_path() -> str:
    """Where the program is. Raises Error in a package that was built without it."""
    path = os.path.join(os.path.dirname(__file__), "bin", "pointfair")
    if not os.access(path, os.X_OK):
        raise Error("this package was built without the program pointfair: build it with POINTFAIR_TOOLS=ON")
    return path
