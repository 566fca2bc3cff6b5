#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The same cloud and parameters give the same bits on every instruction set that this processor has."""
import os
import subprocess
import sys

prints = {}
for isa in ("sse2", "avx2", "avx512"):
    out = subprocess.run(sys.argv[1], env={**os.environ, "POINTFAIR_ISA": isa}, check=True, capture_output=True, text=True)
    prints[isa] = out.stdout
    print(isa, "runs as", out.stderr.strip())
if len(set(prints.values())) != 1:
    for isa, lines in prints.items():
        print(f"--- {isa}\n{lines}")
    sys.exit("the results differ between instruction sets")
