#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compiles pointfair to WebAssembly: the program for Node, build/wasm/build/bin/pointfair.wasm, and the page that needs no
server, build/wasm/page.

    scripts/wheels/wasm.py program page      both; or one of them

The compiler is zig, pinned as for `make wheels`. What is downloaded stays in build/downloads and build/wheels, so that a
second call needs no network."""
import argparse
import gzip
import os
import pathlib
import shutil
import subprocess

from parts import licenses_of_module, unpack
from tools import folder_of, follow_processors, make_environment, run

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
WORK = ROOT / "build/wasm"
TARGETS = {"program": "pointfair_cli", "page": "pointfair_module"}


def configure(zig, source, build, **values):
    # a launcher as ccache would take zig, whose first word is a verb, for a compiler
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_COMPILER_LAUNCHER")}
    values = {"CMAKE_TOOLCHAIN_FILE": ROOT / "cmake/zig.cmake", "POINTFAIR_ZIG": zig, "POINTFAIR_ZIG_TARGET": "wasm32-wasi",
              "CMAKE_BUILD_TYPE": "Release", **values}
    run("cmake", "-G", "Ninja", "-S", source, "-B", build, *[f"-D{name}={value}" for name, value in values.items()],
        env=environment)


def compile_targets(zig, pugixml, targets):
    configure(zig, ROOT / "cmake/wasm", WORK / "build-parts", CMAKE_INSTALL_PREFIX=WORK / "parts", PARTS_PUGIXML=pugixml)
    run("cmake", "--build", WORK / "build-parts", "--target", "install", stdout=subprocess.DEVNULL)
    configure(zig, ROOT, WORK / "build", CMAKE_PREFIX_PATH=WORK / "parts", POINTFAIR_CUDA="OFF", POINTFAIR_TESTS="OFF",
              POINTFAIR_VIEWER="OFF", POINTFAIR_INSTALL="OFF")
    run("cmake", "--build", WORK / "build", "--target", *targets)


def make_page(zig, pugixml):
    """The page's files beside the module, and how large they are."""
    page = WORK / "page"
    run("cmake", f"-DSOURCE={ROOT / 'viewer/web'}", f"-DWORK={WORK / 'web'}", f"-DPAGE={page}", "-DMODE=serverless", "-P",
        ROOT / "cmake/build_page.cmake")
    shutil.copyfile(WORK / "build/bin/pointfair_module.wasm", page / "pointfair.wasm")
    licenses = {"pointfair": (ROOT / "LICENSE").read_text(), **licenses_of_module(pugixml, WORK / "web", zig)}
    (page / "licenses.txt").write_text("\n\n".join(f"==== {name}\n\n{text}" for name, text in licenses.items()))
    files = [path for path in page.rglob("*") if path.is_file()]
    packed = sum(len(gzip.compress(path.read_bytes(), 9)) for path in files)
    print(f"{page}: {sum(path.stat().st_size for path in files) / 1e6:.1f} MB, {packed / 1e6:.2f} MB compressed by gzip")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wanted", nargs="+", choices=TARGETS)
    wanted = parser.parse_args().wanted
    follow_processors()
    WORK.mkdir(parents=True, exist_ok=True)
    zig = folder_of(make_environment(ROOT / "build/wheels/tools", HERE / "tools.txt"), "ziglang") / "zig"
    pugixml = unpack("pugixml", ROOT / "build/downloads", ROOT / "build/wheels")
    compile_targets(zig, pugixml, [TARGETS[name] for name in wanted])
    if "page" in wanted:
        make_page(zig, pugixml)


main()
