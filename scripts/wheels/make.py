#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes wheels, and archives with the program alone, for several systems on this one: `make wheels`.

    scripts/wheels/make.py linux-x86_64 --dist dist

The compiler is zig, whose version and that of all else is pinned in tools.txt, python.txt and parts.py. What is downloaded
stays in build/downloads and build/wheels, so that a second call needs no network. linux-x86_64-cuda is linux-x86_64 with the
CUDA backend, by nvcc and g++ of this machine, linked by zig."""
import argparse
import dataclasses
import hashlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile

from parts import SOURCES, collect_licenses, unpack
from tools import folder_of, follow_processors, make_environment, run

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent


@dataclasses.dataclass
class Target:
    zig: str  # as zig calls it
    wheel: str  # the tag of its wheels
    python: str  # what CPython calls it
    runs_here: bool = False
    pythons: tuple = ("3.12", "3.11", "3.10")
    cuda: bool = False

    @property
    def is_windows(self):
        return self.python.startswith("win")

    @property
    def is_macos(self):
        return self.python.startswith("macosx")


TARGETS = {
    "linux-x86_64": Target("x86_64-linux-gnu.2.28", "manylinux_2_28_x86_64", "linux-x86_64", runs_here=True),
    "linux-x86_64-cuda": Target("x86_64-linux-gnu.2.28", "manylinux_2_28_x86_64", "linux-x86_64", runs_here=True, cuda=True),
    "linux-aarch64": Target("aarch64-linux-gnu.2.28", "manylinux_2_28_aarch64", "linux-aarch64"),
    "macos-arm64": Target("aarch64-macos.11.0", "macosx_11_0_arm64", "macosx-11.0-arm64", pythons=("3.12",)),
    "windows-x86_64": Target("x86_64-windows-gnu", "win_amd64", "win-amd64", pythons=("3.12",)),
}
# Version of CPython: what scikit-build-core calls the stable interface that its extension is for. nanobind linked in has
# one from 3.12 on, so that the wheel of 3.12 is for all later ones.
PYTHONS = {"3.12": "cp312", "3.11": "", "3.10": ""}
# Machine code runs on all later cards of its major version, so these are all cards from 7.5 to 9.0; PTX is for those to come.
ARCHITECTURES = "75-real;80-real;90"


def find_python(version):
    """The program of that version: on the path, or pyenv's; None."""
    found = [shutil.which(f"python{version}")]
    if shutil.which("pyenv"):
        root = subprocess.run(["pyenv", "root"], capture_output=True, text=True).stdout.strip()
        found += pathlib.Path(root).glob(f"versions/{version}.*/bin/python")
    for python in filter(None, found):
        said = subprocess.run([python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"], capture_output=True, text=True)
        if said.stdout.strip() == version:
            return python
    return None


class Build:
    """The folders and the commands of one target."""

    def __init__(self, name, work, zig, architectures):
        self.name, self.target, self.zig, self.shared, self.architectures = name, TARGETS[name], zig, work, architectures
        self.work = work / name
        self.parts, self.prefix, self.licenses = self.work / "parts", self.work / "prefix", self.work / "licenses"
        file = ROOT / f"cmake/{'gcc_by_zig' if self.target.cuda else 'zig'}.cmake"
        self.toolchain = {"CMAKE_TOOLCHAIN_FILE": file, "POINTFAIR_ZIG": zig, "POINTFAIR_ZIG_TARGET": self.target.zig}

    def configure(self, source, build, **values):
        # a launcher as ccache would take zig, whose first word is a verb, for a compiler
        environment = {name: value for name, value in os.environ.items() if not name.endswith("_COMPILER_LAUNCHER")}
        words = [f"-D{name}={value}" for name, value in {**self.toolchain, "CMAKE_BUILD_TYPE": "Release", **values}.items()]
        run("cmake", "-G", "Ninja", "-S", source, "-B", build, *words, env=environment)

    def make_program(self, sources):
        """Builds and installs into the prefix: the library, the program, and the viewer's page."""
        self.configure(ROOT / "cmake/parts", self.work / "build-parts", CMAKE_INSTALL_PREFIX=self.parts,
                       PARTS_ONETBB=sources["onetbb"], PARTS_PUGIXML=sources["pugixml"])
        run("cmake", "--build", self.work / "build-parts", "--target", "install")
        cuda = {"POINTFAIR_CUDA_ARCHITECTURES": self.architectures, "CMAKE_CUDA_FLAGS": "--compress-mode=size"} if self.target.cuda else {}
        self.configure(ROOT, self.work / "build", CMAKE_PREFIX_PATH=self.parts, POINTFAIR_CUDA="ON" if cuda else "OFF",
                       POINTFAIR_TESTS="OFF", POINTFAIR_VIEWER="ON", **cuda)
        run("cmake", "--build", self.work / "build")
        shutil.rmtree(self.prefix, ignore_errors=True)
        run("cmake", "--install", self.work / "build", "--prefix", self.prefix)
        if not self.target.is_windows:
            program = (self.work if self.target.runs_here else self.shared / "linux-x86_64") / "prefix/bin/pointfair"
            page = self.prefix / "share/man/man1/pointfair.1"
            page.parent.mkdir(parents=True)
            run("cmake", f"-DPROGRAM={program}", f"-DPAGE={page}", "-P", ROOT / "cmake/manual_page.cmake")

    def collect_licenses(self, sources, nanobind):
        collect_licenses(self.licenses, sources, self.work / "build", self.zig, nanobind, self.target.is_windows)

    def make_archive(self, version, dist):
        """pointfair-VERSION-TARGET.tar.gz, or .zip for Windows, with a folder of that name."""
        name = f"pointfair-{version}-{self.name}"
        parts = {"bin": self.prefix / "bin", "share": self.prefix / "share", "LICENSE": ROOT / "LICENSE", "licenses": self.licenses}
        if self.target.is_windows:
            path = dist / f"{name}.zip"
            with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
                for inside, part in parts.items():
                    for file in [part] if part.is_file() else sorted(part.rglob("*")):
                        archive.write(file, pathlib.PurePosixPath(name, inside, file.relative_to(part)))
            return path
        path = dist / f"{name}.tar.gz"
        with tarfile.open(path, "w:gz") as archive:
            for inside, part in parts.items():
                archive.add(part, f"{name}/{inside}", filter=without_owner)
        return path

    def make_wheel(self, version, programs, dist):
        """For one version of CPython; `programs`: the folder of the programs of its environment."""
        work = self.work / f"python{version}"
        raw = work / "raw"
        shutil.rmtree(raw, ignore_errors=True)
        values = {**self.toolchain, "CMAKE_PREFIX_PATH": f"{self.prefix};{self.parts}", "POINTFAIR_PYTHON_SPLIT": "OFF",
                  "POINTFAIR_LICENSES": self.licenses}
        environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}", "_PYTHON_HOST_PLATFORM": self.target.python}
        if not self.target.runs_here:
            values["POINTFAIR_PYTHON_GENERATED"] = self.shared / "linux-x86_64" / f"python{version}/build/generated"
        if self.target.is_windows:
            values |= self.windows_python(programs, work / "windows")
        elif not self.target.runs_here and not self.target.is_macos:
            system, processor = self.target.python.split("-")
            environment["SETUPTOOLS_EXT_SUFFIX"] = f".cpython-{version.replace('.', '')}-{processor}-{system}-gnu.so"
        settings = {"cmake.source-dir": "python", "build-dir": work / "build", "wheel.py-api": PYTHONS[version],
                    **{f"cmake.define.{name}": value for name, value in values.items()}}
        words = [word for name, value in settings.items() for word in ("--config-settings", f"{name}={value}")]
        run(programs / "python", "-m", "pip", "wheel", ROOT, "--no-deps", "--no-build-isolation", "--disable-pip-version-check",
            "--wheel-dir", raw, *words, env=environment, cwd=ROOT)
        wheel, = raw.glob("*.whl")
        return self.finish_wheel(wheel, work / "finished", dist)

    def finish_wheel(self, wheel, work, dist):
        """Without the package that is linked in, with the tag of the oldest system that it runs on, which is checked."""
        shutil.rmtree(work, ignore_errors=True)
        tools = self.shared / "tools/bin"
        run(tools / "python", "-m", "wheel", "unpack", "--dest", work, wheel)
        folder, = work.iterdir()
        metadata, = folder.glob("*.dist-info/METADATA")
        kept = [line for line in metadata.read_text().splitlines() if not line.startswith("Requires-Dist: nanobind-backend")]
        # PyPI takes one file for each system, so the wheel with CUDA has a version of its own, which names the runtime's
        suffix = f"+cuda{cuda_major()}" if self.target.cuda else ""
        kept = [line + suffix if line.startswith("Version: ") else line for line in kept]
        metadata.write_text("\n".join(kept) + "\n")
        renamed = metadata.parent.with_name(metadata.parent.name.replace(".dist-info", f"{suffix}.dist-info"))
        metadata = metadata.parent.rename(renamed) / metadata.name
        if self.target.is_windows:  # pip makes a program of it
            with (folder / f"{metadata.parent.name}/entry_points.txt").open("a") as entries:
                entries.write("\n[console_scripts]\npointfair = pointfair._program:main\n")
        run(tools / "python", "-m", "wheel", "pack", "--dest-dir", work, folder)
        packed, = work.glob("*.whl")
        if self.target.is_windows or self.target.is_macos:
            if self.target.is_windows:
                self.check_libraries_of_windows(packed)
            else:
                self.check_programs_of_macos(folder)
            if not packed.stem.endswith(f"cp312-abi3-{self.target.wheel}"):
                sys.exit(f"{packed.name} is not for {self.target.wheel} and CPython 3.12 and later")
            return shutil.copyfile(packed, dist / packed.name)
        environment = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"}
        # auditwheel takes the name of a tag for this machine's processor only; "auto" is the oldest system that the wheel runs on
        run(tools / "auditwheel", "repair", packed, "--plat", "auto", "--only-plat", "--wheel-dir", work / "tagged", env=environment)
        tagged, = (work / "tagged").glob("*.whl")
        if not tagged.stem.endswith(self.target.wheel):
            sys.exit(f"{tagged.name} is not for {self.target.wheel}: it asks for another C library than it is built for")
        return shutil.copyfile(tagged, dist / tagged.name)

    def windows_python(self, programs, into):
        """What CMake is told of a Python for Windows."""
        headers = subprocess.run([programs / "python", "-c", "import sysconfig; print(sysconfig.get_path('include'))"],
                                 capture_output=True, text=True, check=True).stdout.strip()
        run(self.shared / "tools/bin/python", HERE / "windows_python.py", headers, self.zig, into)
        return {"Python_INCLUDE_DIR": into / "include", "Python_SABI_LIBRARY": into / "python3.lib",
                "Python_LIBRARY": into / "python312.lib"}

    def check_libraries_of_windows(self, wheel):
        """That it needs no DLL but Python's and Windows's."""
        words = [self.shared / "tools/bin/delvewheel", "show", "--analyze-existing-exes", wheel]
        found = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if found.returncode != 0 or "will be copied into the wheel.\n    None" not in found.stdout:
            sys.exit(f"{wheel.name} needs DLLs that neither Windows nor Python has:\n{found.stdout}")

    def check_programs_of_macos(self, folder):
        oldest = self.target.python.split("-")[1]
        run(self.shared / "tools/bin/python", HERE / "macos_programs.py", oldest, folder / "pointfair/bin/pointfair",
            *folder.glob("pointfair/_native*.so"))


def cuda_major():
    said = subprocess.run(["nvcc", "--version"], capture_output=True, text=True, check=True).stdout
    return re.search(r"release (\d+)", said).group(1)


def without_owner(info):
    info.uid = info.gid = 0
    info.uname = info.gname = ""
    return info


def write_checksum(path):
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    path.with_name(path.name + ".sha256").write_text(f"{digest}  {path.name}\n")
    print(f"{path}: {path.stat().st_size / 1e6:.1f} MB", flush=True)


def version_of_pointfair():
    text = (ROOT / "include/pointfair/version.hpp").read_text()
    return text.split('POINTFAIR_VERSION "')[1].split('"')[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="+", choices=TARGETS, help="for which systems, linux-x86_64 first")
    parser.add_argument("--dist", type=pathlib.Path, required=True, help="where wheels and archives go")
    parser.add_argument("--cuda-architectures", default=ARCHITECTURES, metavar="LIST",
                        help="cards that linux-x86_64-cuda has code for, as CMake names them (%(default)s)")
    args = parser.parse_args()
    follow_processors()
    if not all(TARGETS[name].runs_here for name in args.targets) and args.targets[0] != "linux-x86_64":
        parser.error("name linux-x86_64 first: wheels for other systems take the types of its module")
    work, downloads = ROOT / "build/wheels", ROOT / "build/downloads"
    sources = {package: unpack(package, downloads, work) for package in SOURCES}
    zig = folder_of(make_environment(work / "tools", HERE / "tools.txt"), "ziglang") / "zig"
    pythons = {version: make_environment(work / f"environment{version}", HERE / "python.txt", python)
               for version in PYTHONS if (python := find_python(version))}
    for version in PYTHONS.keys() - pythons.keys():
        print(f"no wheel for Python {version}: there is no such Python here")
    dist = args.dist.resolve()
    dist.mkdir(parents=True, exist_ok=True)
    for name in args.targets:
        build = Build(name, work, zig, args.cuda_architectures)
        build.make_program(sources)
        build.collect_licenses(sources, folder_of(next(iter(pythons.values())), "nanobind"))
        write_checksum(build.make_archive(version_of_pointfair(), dist))
        for version in build.target.pythons:
            if version in pythons:
                write_checksum(build.make_wheel(version, pythons[version], dist))


main()
