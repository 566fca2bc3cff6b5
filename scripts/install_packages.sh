#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian or Ubuntu packages that the named jobs need and this machine lacks, and says which.
# A machine that has them all is left alone: no network, no root.
# Usage: scripts/install_packages.sh build|test|python|demo|bench|plots|fuzz|format|docs|integrations|deb...
set -euo pipefail

packages_for() {
  case "$1" in
    build) echo g++ cmake ninja-build libtbb-dev libcli11-dev libfmt-dev libfast-float-dev libnanoflann-dev nlohmann-json3-dev libpugixml-dev libboost-dev nodejs npm ;;
    test) echo libgtest-dev librapidcheck-dev libnanoflann-dev libeigen3-dev python3 python3-pip chromium ;;
    python) echo python3-dev python3-venv ;;
    demo) echo libcgal-demo libpng-dev python3 ;;
    bench) echo libnanoflann-dev libeigen3-dev libcgal-dev libcgal-demo libpcl-dev python3 ;;
    plots) echo python3 python3-matplotlib ;;
    fuzz) echo clang-16 libclang-rt-16-dev ;;
    format) echo clang-format-16 ;;
    docs) echo doxygen ;;
    integrations) echo qgis qgis-providers libgl1 libice6 libsm6 libxfixes3 libxi6 libxkbcommon0 libxrender1 ;;
    deb) echo build-essential dpkg-dev debhelper ;;
    *) echo "$0: unknown job '$1': use build, test, python, demo, bench, plots, fuzz, format, docs, integrations or deb" >&2; exit 2 ;;
  esac
}

is_installed() {
  # a node of its maker's own package, or of none, brings its npm along
  if [ "$1" = npm ] || [ "$1" = nodejs ]; then command -v npm >/dev/null && command -v node >/dev/null && return; fi
  # and so does a Python with pip
  if [ "$1" = python3-pip ]; then python3 -m pip --version >/dev/null 2>&1 && return; fi
  # and so does a Python that Debian did not install
  if [ "$1" = python3-venv ]; then python3 -c "import ensurepip, venv" 2>/dev/null && return; fi
  if [ "$1" = python3-dev ]; then python3 -c "import os, sysconfig as s; open(os.path.join(s.get_path('include'), 'Python.h'))" 2>/dev/null && return; fi
  [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

wanted=""
for job in "$@"; do wanted+=" $(packages_for "$job")"; done

if ! command -v dpkg-query >/dev/null; then
  echo "No dpkg-query here, so nothing was checked. This step needs what Debian calls:$wanted"
  exit 0
fi

missing=()
for package in $(tr ' ' '\n' <<<"$wanted" | sort -u); do is_installed "$package" || missing+=("$package"); done
if [ ${#missing[@]} -eq 0 ]; then exit 0; fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "Missing packages: ${missing[*]}" >&2
    echo "Neither root nor sudo here: ask an administrator to run: apt-get install ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "Installing with apt-get: ${missing[*]}"
"${as_root[@]}" apt-get update -q
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
