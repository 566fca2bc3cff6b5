#!python
# SPDX-License-Identifier: Apache-2.0
"""Becomes the program pointfair that lies in the package, which is found but not imported: that would take longer.
One verb more than that has the package: `pointfair cluster`, on a Dask cluster."""
import importlib.util
import os
import sys

if sys.argv[1:2] == ["cluster"]:
    os.execv(sys.executable, [sys.executable, "-m", "pointfair.cluster", *sys.argv[2:]])
package = importlib.util.find_spec("pointfair")
if package is None or package.origin is None:
    sys.exit(f"pointfair: the package pointfair is not installed for {sys.executable}; pip install pointfair")
program = os.path.join(os.path.dirname(package.origin), "bin", "pointfair")
try:
    os.execv(program, [program, *sys.argv[1:]])
except OSError as error:
    sys.exit(f"pointfair: {program}: {error.strerror}; this package was built without the program")
