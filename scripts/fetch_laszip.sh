#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fetches LASzip's sources, with which the tests compare LAZ files, from the Python package index into build/downloads,
# by version and hash. Without network the tests do without it.
# Usage: scripts/fetch_laszip.sh
set -euo pipefail
cd "$(dirname "$0")/.."
if [ -e build/downloads/laszip-0.3.0.tar.gz ]; then exit 0; fi
python3 -m pip download --quiet --disable-pip-version-check --no-deps --no-binary laszip --require-hashes \
  --requirement tests/laszip.requirements.txt --dest build/downloads.new ||
  { echo "LASzip was not fetched, so the tests that compare LAZ files with it are left out" >&2; exit 0; }
mkdir -p build/downloads
mv build/downloads.new/* build/downloads/
rmdir build/downloads.new
