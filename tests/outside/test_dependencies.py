#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Configures the project as machines do that lack what it is built with (cmake/dependencies.cmake): one message names all that
is missing; nothing is fetched where all is found, or where it is not asked for; and what is asked for is taken from the
folder that is named for it. Debian's packages of the same names are in every recipe that installs them, and licences in what is given away."""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile

parser = argparse.ArgumentParser()
for name in ("source", "generator", "compiler"):
    parser.add_argument("--" + name, required=True)
args = parser.parse_args()
TEXT = pathlib.Path(args.source, "cmake/dependencies.cmake").read_text()
NEEDS = re.findall(r"^ *pointfair_need\((\w+) DEBIAN ([\w-]+)(.*?)\n *(URL|GIT) (\S+)\s+(?:SHA256|COMMIT) (\w+)", TEXT, re.M | re.S)


def configure(folder, *words):
    """The exit code and the output, with all white space as single blanks. Proxies that are not there take the network away."""
    nowhere = {name: "http://127.0.0.1:9" for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY")}
    done = subprocess.run(["cmake", "-S", args.source, "-B", folder, "-G", args.generator, f"-DCMAKE_CXX_COMPILER={args.compiler}",
                           "-DPOINTFAIR_CUDA=OFF", *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          env={**os.environ, **nowhere, "no_proxy": ""})
    return done.returncode, " ".join(done.stdout.split())


def check(claim, holds, output):
    if not holds:
        raise SystemExit(f"not so: {claim}\n{output}")


check("every dependency is pinned by an address and a hash", len(NEEDS) == len(re.findall(r"^ *pointfair_need\(", TEXT, re.M)), NEEDS)
for name, _, _, kind, place, digest in NEEDS:
    check(f"{name} comes by https and has a whole hash", place.startswith("https://") and len(digest) == (64 if kind == "URL" else 40), digest)

FOR_TESTS = {"Eigen3", "GTest", "rapidcheck"}
for file in ("scripts/install_packages.sh", "packaging/debian/control", "packaging/docker/Dockerfile", "packaging/docker/pointfair.def"):
    named = set(re.findall(r"[\w-]+", pathlib.Path(args.source, file).read_text()))
    for name, debian, *_ in NEEDS:
        if name not in FOR_TESTS or file.startswith("scripts"):
            check(f"{file} installs {debian}", debian in named, file)

sys.path.insert(0, str(pathlib.Path(args.source, "scripts/wheels")))
import parts
check("wheels and archives have the licence of each", set(parts.HEADERS) == {need[0] for need in NEEDS} - FOR_TESTS, parts.HEADERS)

with tempfile.TemporaryDirectory() as folder:
    work = pathlib.Path(folder)
    code, output = configure(work / "none", *(f"-DCMAKE_DISABLE_FIND_PACKAGE_{need[0]}=ON" for need in NEEDS), "-DPOINTFAIR_VIEWER=ON")
    check("without its dependencies the project does not configure", code != 0, output)
    for name, debian, words, *_ in NEEDS:
        check(f"{name} is named as missing, unless it is optional", (f"{name} (Debian: {debian})" in output) != ("OPTIONAL" in words.split()), output)

    code, output = configure(work / "all", "-DPOINTFAIR_FETCH=ON", "-DPOINTFAIR_TESTS=ON")
    check("what is found is not fetched", code == 0 and "are fetched" not in output, output)

    given = work / "sources/include/fast_float"
    given.mkdir(parents=True)
    code, output = configure(work / "given", "-DCMAKE_DISABLE_FIND_PACKAGE_FastFloat=ON", "-DPOINTFAIR_TESTS=OFF", "-DPOINTFAIR_FETCH=ON",
                             f"-DFETCHCONTENT_SOURCE_DIR_FASTFLOAT={work / 'sources'}")
    check("sources that are there need no network", code == 0 and output.count("are fetched") == 1, output)
