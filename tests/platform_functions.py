#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""No result depends on how a platform's mathematical library rounds: src/ calls src/portable.hpp instead. Finds calls
in the tree given as argument. sqrt, floor, ldexp and the like are exact everywhere; the command line's words may print
what they measure by any function."""
import pathlib
import re
import sys

NAMES = ("exp exp2 expm1 log log2 log10 log1p pow hypot cbrt sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh "
         "atanh erf erfc tgamma lgamma fma").split()
CALL = re.compile(rf"(?<![\w.>])(?:(?P<scope>\w+)::|__builtin_|__)?(?P<name>{'|'.join(NAMES)})[fl]?\s*\(")
RANDOM = re.compile(r"std::(?:shuffle|sample|\w+_distribution)\b")  # each library draws in its own way
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)


def calls(text):
    """(line, what is called) of each use of a platform's function."""
    code = COMMENT.sub(lambda comment: "\n" * comment.group().count("\n"), text)
    found = [match for match in CALL.finditer(code) if match["scope"] != "portable"] + list(RANDOM.finditer(code))
    return [(code.count("\n", 0, match.start()) + 1, match.group().rstrip("( ")) for match in found]


assert calls("x = std::exp(y);\n// std::exp(y)\nz = powf(x, 2) + hypot (x, y);") == [(1, "std::exp"), (3, "powf"), (3, "hypot")]
assert calls("__expf(x)") and calls("std::normal_distribution<> d;") and calls("::log(x)")
assert not calls("portable::exp(x); a.log(x); log_pair(x); std::sqrt(x); explain(x)")

root = pathlib.Path(sys.argv[1])
files = [path for path in sorted((root / "src").rglob("*"))
         if path.suffix in {".cpp", ".hpp", ".h", ".cu", ".cuh"} and path.name not in ("portable.cpp", "portable.hpp")]
files += sorted((root / "viewer").glob("*.cpp")) + sorted((root / "include").rglob("*.hpp"))
found = [f"{path.relative_to(root)}:{line} calls {what}; use src/portable.hpp" for path in files
         for line, what in calls(path.read_text())]
print("\n".join(found) if found else f"{len(files)} files call no function that platforms round differently")
sys.exit(1 if found else 0)
