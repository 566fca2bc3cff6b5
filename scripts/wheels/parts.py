#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is linked into a wheel: sources with their hashes, and the licences of all of it."""
import hashlib
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile

# Debian 12's source packages: file and its SHA-256
SOURCES = {
    "onetbb": ("onetbb_2021.8.0.orig.tar.xz", "7e9111b8bb59c8800bf6d0b06afe7b0891937443d2dae1ee1101c8e2ede6a7ef"),
    "pugixml": ("pugixml_1.13.orig.tar.gz", "5c5ad5d7caeb791420408042a7d88c2c6180781bf218feca259fd9d840a888e1"),
}
# Headers of this machine, by the names of cmake/dependencies.cmake; `make wheels` has the libraries among them from SOURCES.
HEADERS = {"Boost": "boost/version.hpp", "CLI11": "CLI/CLI.hpp", "FastFloat": "fast_float/fast_float.h", "fmt": "fmt/core.h",
           "nanoflann": "nanoflann.hpp", "nlohmann_json": "nlohmann/json.hpp", "pugixml": "pugixml.hpp", "TBB": "tbb/tbb.h"}


def source_entries():
    """The machine's own package sources, as lines of a file .sources that ask for source packages."""
    etc = pathlib.Path("/etc/apt")
    texts = [path.read_text() for path in sorted(etc.glob("sources.list.d/*.sources"))]
    blocks = [re.sub(r"(?m)^Types:.*$", "Types: deb-src", text) for text in texts]
    lines = [line for path in [etc / "sources.list", *sorted(etc.glob("sources.list.d/*.list"))] if path.exists()
             for line in path.read_text().splitlines()]
    return "\n".join(blocks), "".join(re.sub(r"^deb ", "deb-src ", line) + "\n" for line in lines if line.startswith("deb "))


def fetch(package, into):
    """Downloads the files of a source package with apt-get, without changing how the machine is set up."""
    with tempfile.TemporaryDirectory() as work:
        work = pathlib.Path(work)
        (work / "lists/partial").mkdir(parents=True)
        (work / "parts").mkdir()
        blocks, lines = source_entries()
        (work / "parts/machine.sources").write_text(blocks)
        (work / "parts/machine.list").write_text(lines)
        options = ["-qq", "-o", "Dir::Etc::SourceList=/dev/null", "-o", f"Dir::Etc::SourceParts={work / 'parts'}",
                   "-o", f"Dir::State::Lists={work / 'lists'}", "-o", "APT::Sandbox::User=root"]
        subprocess.run(["apt-get", *options, "update"], cwd=work)
        subprocess.run(["apt-get", *options, "source", "--download-only", package], cwd=work)
        for path in work.glob(f"{package}_*.orig.tar.*"):
            shutil.move(path, into / path.name)


def archive_of(package, downloads):
    """The package's sources in `downloads`, with the known hash; they are fetched if they are not there yet."""
    name, expected = SOURCES[package]
    archive = downloads / name
    downloads.mkdir(parents=True, exist_ok=True)
    if not archive.exists() and shutil.which("apt-get"):
        print(f"fetching the sources of {package}")
        fetch(package, downloads)
    if not archive.exists():
        sys.exit(f"{archive} is not here and apt-get did not bring it: put Debian 12's file of that name there")
    if hashlib.sha256(archive.read_bytes()).hexdigest() != expected:
        sys.exit(f"{archive} is not the file it should be: remove it and try again")
    return archive


def unpack(package, downloads, into):
    """The folder of the package's sources."""
    archive = archive_of(package, downloads)
    folder = into / package
    if not folder.exists():
        part = into / f"{package}.part"
        shutil.rmtree(part, ignore_errors=True)
        with tarfile.open(archive) as files:
            files.extractall(part)
        next(part.iterdir()).rename(folder)
        part.rmdir()
    return folder


def license_of_header(header):
    """Of the package that this machine has the header from."""
    return license_of_file(f"/usr/include/{header}")


def license_of_file(file):
    said = subprocess.run(["dpkg", "-S", file], capture_output=True, text=True, check=True).stdout
    text = pathlib.Path("/usr/share/doc", said.split(":")[0], "copyright").read_text()
    if len(text) < 100_000:
        return text
    # Boost's names each of its files before the texts of the licences
    return "\n\n".join(part for part in text.split("\n\n") if part.startswith("License:"))


def licenses_of_zig(zig, for_windows=False):
    """Of the parts that zig links in, by their names."""
    return {"zig": (zig.parent / "LICENSE").read_text(),
            **{name: (zig.parent / f"lib/{name.replace('+', 'x')}/LICENSE.TXT").read_text()
               for name in ("libc++", "libc++abi", "libunwind")},
            **({"mingw-w64": (zig.parent / "lib/libc/mingw/COPYING").read_text()} if for_windows else {})}


def licenses_of_module(source, page, zig):
    """Of what is in the page that needs no server, by the names of its parts. `source`: pugixml's; `page`: the folder that the
    page is built in."""
    return {
        "pugixml": (source / "LICENSE.md").read_text(),
        "three.js": (page / "node_modules/three/LICENSE").read_text(),
        "wasi-libc": (zig.parent / "lib/libc/wasi/LICENSE").read_text() + (zig.parent / "lib/libc/wasi/LICENSE-MIT").read_text(),
        **licenses_of_zig(zig),
        **{name: license_of_header(HEADERS[name]) for name in ("FastFloat", "fmt", "nlohmann_json")},
    }


def licenses_of_cuda(toolkit):
    """Of what a build with CUDA holds beside: the toolkit's runtime and headers, and g++'s library."""
    # NVIDIA's installers put it on top; in the packages of PyPI it lies with the runtime
    texts = [path for path in (toolkit / "EULA.txt", *toolkit.rglob("nvidia_cuda_runtime*/licenses/License.txt")) if path.exists()]
    if not texts:
        sys.exit(f"the licence of the CUDA runtime is not in {toolkit}: put NVIDIA's EULA.txt there")
    library = subprocess.run(["g++", "-print-file-name=libstdc++.a"], capture_output=True, text=True, check=True).stdout.strip()
    return {"CUDA": texts[0].read_text(), "libstdc++": license_of_file(str(pathlib.Path(library).resolve()))}


def cuda_toolkit(build):
    """The folder of the toolkit whose runtime CMake found for a build with CUDA, or None."""
    cache = (build / "CMakeCache.txt").read_text()
    if not re.search(r"^POINTFAIR_CUDA:BOOL=(ON|1|TRUE)$", cache, re.M):
        return None
    runtime, = re.findall(r"^CUDA_cudart_static_LIBRARY:FILEPATH=(.*)$", cache, re.M)
    return next(folder for folder in pathlib.Path(runtime).resolve().parents if (folder / "bin/nvcc").exists())


def licenses_of_build(build):
    """Of what a build is linked with or serves, by the names of its parts. nanobind's goes into a wheel by python/CMakeLists.txt."""
    three = build / "viewer/web/node_modules/three/LICENSE"  # the page of a source archive names its parts by itself
    toolkit = cuda_toolkit(build)
    return {**{name: license_of_header(header) for name, header in HEADERS.items()},
            **({"three.js": three.read_text()} if three.exists() else {}),
            **(licenses_of_cuda(toolkit) if toolkit else {})}


def collect_licenses(into, sources, build, zig, nanobind, for_windows):
    """Writes the licence of everything that is linked in or served into a folder, one file each. `build`: the folder of the
    build with the viewer's page. Stops where one is missing: a file without it must not be given away."""
    robin_map = (nanobind / "ext/robin_map/include/tsl/robin_map.h").read_text()
    write_licenses(into, {
        **licenses_of_build(build),
        "TBB": (sources["onetbb"] / "LICENSE.txt").read_text(),
        "pugixml": (sources["pugixml"] / "LICENSE.md").read_text(),
        "robin_map": robin_map[:robin_map.index("*/") + 3],
        **licenses_of_zig(zig, for_windows),
    })


def write_licenses(into, found):
    shutil.rmtree(into, ignore_errors=True)
    into.mkdir(parents=True)
    for name, text in found.items():
        (into / f"{name}.txt").write_text(text)


if __name__ == "__main__":  # fetches the sources alone: parts.py FOLDER
    for wanted in SOURCES:
        print(archive_of(wanted, pathlib.Path(sys.argv[1])))
