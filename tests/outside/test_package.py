#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Installs the build, then builds a project outside that finds the package: it must give the bits of this build, the
README's C++ example (the first ```cpp block) must compile and run, examples/ must build, and the programs that the viewer copies must write what
the commands that it copies write."""
import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

parser = argparse.ArgumentParser()
for name in ("build", "fingerprint", "generator", "compiler", "flags", "readme"):
    parser.add_argument("--" + name, required=True)
parser.add_argument("--copied-code", help="the program that writes what the viewer copies, in a build with the viewer")
args = parser.parse_args()


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise SystemExit(f"failed: {' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def check_pkg_config(prefix, version):
    """pkg-config, where there is one, finds what was installed."""
    if not shutil.which("pkg-config"):
        return
    folder, = (file.parent for file in prefix.rglob("pointfair.pc"))
    environment = {**os.environ, "PKG_CONFIG_PATH": str(folder)}
    found = run("pkg-config", "--modversion", "pointfair", env=environment).strip()
    include = pathlib.Path(run("pkg-config", "--variable=includedir", "pointfair", env=environment).strip())
    if found != version or not (include / "pointfair/pointfair.hpp").exists():
        raise SystemExit(f"pkg-config finds version {found} with headers in {include}; installed was {version}")


def check_compiled_by_pkg_config(prefix, source, program):
    """A program compiles with nothing but what pkg-config says of this library."""
    if not shutil.which("pkg-config"):
        return None
    folder, = (file.parent for file in prefix.rglob("pointfair.pc"))
    words = run("pkg-config", "--cflags", "--libs", "pointfair", env={**os.environ, "PKG_CONFIG_PATH": str(folder)})
    run(args.compiler, "-std=c++20", *args.flags.split(), source, *words.split(), "-o", program)
    return run(program)


def check_shared(source, build):
    """A program that is installed with a shared library finds it there, and pkg-config leaves to that library what it links."""
    run("cmake", "-S", source, "-B", build, "-G", args.generator, f"-DCMAKE_CXX_COMPILER={args.compiler}", "-DBUILD_SHARED_LIBS=ON",
        "-DPOINTFAIR_CUDA=OFF", "-DPOINTFAIR_TESTS=OFF", "-DPOINTFAIR_VIEWER=OFF")
    if sys.platform == "linux" and "$ORIGIN/../lib" not in (build / "cli/cmake_install.cmake").read_text():
        raise SystemExit("the program does not find a shared library that is installed with it")
    if "Requires.private: tbb" not in (build / "pointfair.pc").read_text():
        raise SystemExit("who links the shared library needs oneTBB by its name")


def program_of(readme):
    """The block's #include lines, and the rest as the body of main."""
    block = re.search(r"^```cpp\n(.*?)^```", pathlib.Path(readme).read_text(), re.M | re.S)
    if not block:
        raise SystemExit(f"{readme} holds no ```cpp block")
    lines = block.group(1).splitlines()
    includes = [line for line in lines if line.startswith("#include")]
    body = [line for line in lines if not line.startswith("#include")]
    return "\n".join(includes + ["int main() {"] + body + ["}", ""])


def bumpy_cloud():
    points = [(x / 20, y / 20, 0.002 * ((7 * x + 3 * y) % 5)) for x in range(20) for y in range(20)]
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    header += [f"property float {axis}" for axis in "xyz"] + ["end_header"]
    return "\n".join(header + ["%g %g %g" % p for p in points]) + "\n"


def write_copied_code(work):
    """Fills work/project with N.sh and copied_N.cpp; their N."""
    if not args.copied_code:
        return []
    run(args.copied_code, work / "project", work / "scan.ply")
    return sorted(path.stem for path in (work / "project").glob("*.sh"))


def check_copied_code(work, names):
    environment = {**os.environ, "PATH": f"{work / 'prefix/bin'}:{os.environ['PATH']}"}
    written = []
    for name in names:
        for way, command in (("command", ["sh", work / f"project/{name}.sh"]), ("program", [work / f"build/copied_{name}"])):
            (work / way).mkdir(exist_ok=True)
            run(*command, cwd=work / way, env=environment)
        written.append((work / f"command/{name}.ply").read_bytes())
        if written[-1] != (work / f"program/{name}.ply").read_bytes():
            raise SystemExit("the copied program does not write what the copied command writes\n" +
                             (work / f"project/{name}.sh").read_text() + (work / f"project/copied_{name}.cpp").read_text())
    if len(set(written)) < len(written):
        raise SystemExit("two recipes of copied code give the same file")


with tempfile.TemporaryDirectory() as folder:
    work = pathlib.Path(folder)
    run("cmake", "--install", args.build, "--prefix", work / "prefix")
    here = pathlib.Path(__file__).parent
    header = (work / "prefix/include/pointfair/version.hpp").read_text()
    check_pkg_config(work / "prefix", re.search(r'POINTFAIR_VERSION "([0-9.]+)"', header).group(1))
    for name in ("CMakeLists.txt", "fingerprint.cpp"):
        (work / "project").mkdir(exist_ok=True)
        shutil.copy(here / name, work / "project" / name)
    (work / "project/example.cpp").write_text(program_of(args.readme))
    (work / "scan.ply").write_text(bumpy_cloud())
    copied = write_copied_code(work)
    programs = ["example.cpp"] + [f"copied_{name}.cpp" for name in copied]
    run("cmake", "-S", work / "project", "-B", work / "build", "-G", args.generator, "-DCMAKE_BUILD_TYPE=Release",
        f"-DCMAKE_CXX_COMPILER={args.compiler}", f"-DCMAKE_CXX_FLAGS={args.flags}", f"-DPROGRAMS={';'.join(programs)}",
        f"-DCMAKE_PREFIX_PATH={work / 'prefix'}")
    run("cmake", "--build", work / "build")
    inside, outside = run(args.fingerprint), run(work / "build/fingerprint")
    if inside != outside:
        raise SystemExit(f"the installed library gives other bits\n--- here\n{inside}--- installed\n{outside}")
    by_pkg_config = check_compiled_by_pkg_config(work / "prefix", here / "fingerprint.cpp", work / "by_pkg_config")
    if by_pkg_config not in (None, inside):
        raise SystemExit(f"compiled with pkg-config, the library gives other bits\n{by_pkg_config}")
    run("cmake", "-S", here.parent.parent / "examples", "-B", work / "examples", "-G", args.generator,
        f"-DCMAKE_CXX_COMPILER={args.compiler}", f"-DCMAKE_CXX_FLAGS={args.flags}",
        f"-DCMAKE_PREFIX_PATH={work / 'prefix'}")
    run("cmake", "--build", work / "examples")
    run(work / "build/example", cwd=work)
    if not (work / "smooth.ply").read_text(errors="replace").startswith("ply"):
        raise SystemExit("the README's example wrote no smooth.ply")
    check_copied_code(work, copied)
    check_shared(here.parent.parent, work / "shared")
