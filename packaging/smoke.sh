#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Checks an installed program: a noisy cube of 20,000 points must become the bytes that it becomes on every machine.
#
#   packaging/smoke.sh [PROGRAM]        default: the pointfair of PATH
set -eu
program=${1:-pointfair}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat > "$work/cube.off" <<MESH
OFF
8 12 0
0 0 0
1 0 0
1 1 0
0 1 0
0 0 1
1 0 1
1 1 1
0 1 1
3 0 2 1
3 0 3 2
3 4 5 6
3 4 6 7
3 0 1 5
3 0 5 4
3 1 2 6
3 1 6 5
3 2 3 7
3 2 7 6
3 3 0 4
3 3 4 7
MESH
"$program" --version
"$program" noise -q "$work/cube.off" "$work/noisy.ply" --points 20000 --sigma 0.5% --seed 7
"$program" run -q "$work/noisy.ply" "$work/out.xyz" --device cpu
if command -v sha256sum >/dev/null; then found=$(sha256sum < "$work/out.xyz"); else found=$(shasum -a 256 < "$work/out.xyz"); fi
found=${found%% *}
expected=5c8c0aa101e10b559afe8fea1f7ad562cce7b8c20b62c01016bd1d8638a39912
if [ "$found" != "$expected" ]; then
  echo "$program: the result has the SHA-256 $found, and not $expected: this build computes other bits than it should" >&2
  exit 1
fi
echo "$program: the bytes of the result are right"
