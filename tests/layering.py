#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks who includes whom (CONTRIBUTING.md) by reading the #include and import lines of the tree given as argument, that
no file but the table lists parameters, and that no two files define different types of one name: linkers would mix up
their constructors and containers without a word."""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.M)
MODULE = re.compile(r"^\s*from \.(\w+) import", re.M)
CUDA = re.compile(r"__CUDA|__global__|__device__|__host__|__launch_bounds__|\bcuda[A-Z]\w*|cuda_runtime|cub/")
# what compilers say of the system and its C library; only folders called platform may ask
SYSTEM = re.compile(r"^\s*#.*\b(_WIN32|_WIN64|__linux__|__APPLE__|__unix__|__wasi__|__GLIBC__|__MINGW\w*|_MSC_VER|MADV_\w+)\b", re.M)
SOURCE = {".cpp", ".hpp", ".h", ".cu", ".cuh"}

# folder: (folders or files of ours that it may include, third-party headers that it may include)
PUBLIC = "include/pointfair/"
DATA = [PUBLIC + name + ".hpp" for name in ("cloud", "params", "device", "device_points", "report")]  # all of src may use them but src/point
PLATFORM = "src/platform/"
PORTABLE = "src/portable.hpp"  # all of src but src/point and src/cuda may use it
FILES = [PUBLIC + name + ".hpp" for name in ("cloud", "empty_files", "io", "file_info", "normals", "positions", "texture", "version", "viewpoint")]  # what src/io implements
ON_CARD = ("cuda", "cub/", "thrust/", "nv")
CUDA_ROOMS = {  # each with those that it may include
    "runtime": ["runtime"],
    "index": ["runtime", "index"],
    "search": ["runtime", "index", "search"],
    "sampling": ["runtime", "index", "search", "sampling"],
    "stages": ["runtime", "index", "search", "stages"],
    "overlap": ["runtime", "index", "search", "overlap"],
    "tiles": ["runtime", "tiles"],
}
RULES = {
    "include/pointfair/pipeline.hpp": (["include/pointfair/"], ()),
    "include/pointfair/": (["include/pointfair/"], ()),
    "src/point/": (["src/point/"], ()),
    "src/seam/": (["src/seam/", "src/point/", *DATA, PLATFORM, PORTABLE], ("tbb/",)),
    "src/platform/": (["src/platform/"], None),
    "src/cpu/": (["src/cpu/", PLATFORM, "src/point/", "src/seam/", *DATA, PORTABLE], ("tbb/", "immintrin.h", "arm_neon.h", "cpuid.h")),
    **{f"src/cuda/{room}/": ([f"src/cuda/{below}/" for below in rooms] + ["src/point/", "src/seam/", *DATA], ON_CARD)
       for room, rooms in CUDA_ROOMS.items()},
    "src/cuda/": (["src/cuda/", "src/point/", "src/seam/", *DATA], ON_CARD),
    "src/estimate/": (["src/estimate/", "src/point/", "src/seam/", *DATA, PORTABLE], ()),
    "src/mesh/": (["src/mesh/", "src/point/", "src/seam/", *DATA, PLATFORM, PORTABLE], ()),
    "src/tiles/": (["src/tiles/", "src/point/", "src/seam/", *DATA, PLATFORM, PORTABLE], ()),
    "src/pipeline/": (["src/pipeline/", "src/mesh/", "src/estimate/", "src/tiles/", "src/seam/", PUBLIC], ()),
    "src/scale/": (["src/scale/", "src/pipeline/", "src/mesh/", "src/estimate/", "src/tiles/", "src/seam/", "src/point/", "src/io/", "src/options/", PUBLIC, PLATFORM, PORTABLE], ()),
    "src/facade/": (["src/facade/", "src/scale/", "src/pipeline/", "src/tiles/choice.hpp", "src/estimate/", "src/seam/", "src/io/", PUBLIC, PLATFORM], ()),
    "src/depth/": ([PUBLIC, PLATFORM], ("tbb/",)),
    "src/orient/": (["src/orient/", PUBLIC, PORTABLE], ("tbb/",)),
    "src/io/": (["src/io/", *FILES, PLATFORM, PORTABLE], ("tbb/", "fast_float/", "las", "pugixml", "nlohmann/", "emmintrin.h")),
    "src/options/": (["src/options/", PUBLIC], ()),
    "src/": (["src/point/", PORTABLE], ()),
    "cli/": (["cli/", "viewer/server.hpp", PUBLIC], None),
    "bench/paper/": (["bench/paper/", "src/point/", PUBLIC], None),
    "bench/": (["bench/", PUBLIC], None),
    "examples/": ([PUBLIC], ()),
    "python/": (["python/", PUBLIC], None),
    "viewer/": (["viewer/", PUBLIC], None),
}
SEARCH = ("", "include/", "src/", "cli/", "bench/", "viewer/", "python/")  # as the -I flags of the targets


def ours(path, name):
    """The file of this tree that the include means, or None."""
    for folder in (path.parent.relative_to(root).as_posix() + "/",) + SEARCH:
        if (root / folder / name).is_file():
            return (root / folder / name).resolve().relative_to(root.resolve()).as_posix()
    return None


def is_standard(name):
    return "/" not in name and "." not in name or name in ("assert.h", "math.h", "stdint.h", "stddef.h")


def violations(path):
    relative = path.relative_to(root).as_posix()
    rule = next((RULES[folder] for folder in RULES if relative.startswith(folder)), None)
    text = path.read_text()
    if rule is None:
        return
    allowed, third_party = rule
    for bracket, name in INCLUDE.findall(text):
        target = ours(path, name)
        if target:
            if not target.startswith(tuple(allowed)):
                yield f"{relative} includes {target}"
            if relative.startswith(PUBLIC) and bracket == '"' and not name.startswith("pointfair/"):
                yield f'{relative}: write "pointfair/..." so that it is found when installed'
        elif bracket == '"':
            yield f'{relative} includes "{name}", which is not in the tree'
        elif relative.startswith("src/point/") or not is_standard(name):
            if third_party is not None and not name.startswith(tuple(third_party)):
                yield f"{relative} includes <{name}>"
    if "platform" not in path.parent.name and "platform" not in path.parent.parent.name and SYSTEM.search(text):
        yield f"{relative} asks for the system, which only src/platform and cli/platform do: {SYSTEM.search(text).group().strip()}"
    on_card = relative.startswith("src/cuda/") or relative.startswith("bench/paper/") and path.suffix in (".cu", ".cuh")
    if not on_card and relative != "src/point/vec.h" and CUDA.search(text):
        yield f"{relative} mentions CUDA's own names: {CUDA.search(text).group()}"


def lists_parameters(path):
    """Names of parameters that the code quotes. A word such as noise means other things too, so names of several words."""
    code = re.sub(r"//.*", "", path.read_text())
    return [name for name in PARAMETERS if f'"{name}"' in code or f'"{name.replace("_", "-")}"' in code]


OPENED, CLOSED = re.compile(r"(?:inline )?namespace ?([\w:]*) ?\{$"), re.compile(r"\}  // namespace")
DEFINED = re.compile(r"(?:struct|class|union|enum|enum class) (?:alignas\(.*?\) )?(?:[A-Z_]+ )?(\w+)(?: final)?(?: ?:(?!:).*)?(?: ?\{.*)?$")


def types_of(text):
    """The full names of the types that a text defines in namespaces that have names."""
    spaces = []
    for line in text.splitlines():
        if opened := OPENED.match(line):
            spaces.append(opened[1])
        elif CLOSED.match(line) and spaces:
            spaces.pop()
        elif (defined := DEFINED.match(line)) and ("{" in line or line[-1] != ";") and all(spaces):
            yield "::".join([*spaces, defined[1]])


def twice_defined(files):
    """What stands in several files, with these."""
    where = {}
    for path in files:
        for name in types_of(path.read_text()):
            where.setdefault(name, set()).add(path.relative_to(root).as_posix())
    return [f"{name} is defined in {' and '.join(sorted(places))}" for name, places in where.items() if len(places) > 1]


def circle(imports):
    """Names that import each other in a circle, of {name: those that it imports}; empty if there is none."""
    left = dict(imports)
    while free := [name for name, needed in left.items() if not needed & left.keys()]:
        for name in free:
            del left[name]
    return sorted(left)


def package_circle():
    """Of the modules of python/pointfair; an import inside a function counts."""
    modules = {path.stem: path for path in (root / "python/pointfair").glob("_*.py") if path.stem != "__init__"}
    return circle({name: {other for other in MODULE.findall(path.read_text()) if other in modules}
                   for name, path in modules.items()})


TABLE = root / PUBLIC / "params.hpp"
PARAMETERS = [name for name in re.findall(r'ParamInfo\{\s*"(\w+)"', TABLE.read_text()) if "_" in name]
PRODUCT = [f for folder in ("include", "src", "cli", "python", "viewer") for f in sorted((root / folder).rglob("*"))
           if f.suffix in {*SOURCE, ".py", ".pyi", ".ts"} and "node_modules" not in f.parts]
assert lists_parameters(TABLE) == PARAMETERS and len(PARAMETERS) > 10
assert circle({"a": {"b"}, "b": {"a"}, "c": {"a"}}) == ["a", "b", "c"] and circle({"a": {"b"}, "b": set()}) == []
assert list(types_of("namespace a::b {\nnamespace {\nstruct C {\n}  // namespace\nclass D;\nclass E::F {\nstruct G : H {\n  struct I {\nenum J { k };\n}  // namespace a::b\nunion K {\n")) == ["a::b::G", "a::b::J", "K"]
files = [f for folder in {r.split("/")[0] for r in RULES} for f in sorted((root / folder).rglob("*"))
         if f.suffix in SOURCE and "node_modules" not in f.parts]
found = [line for f in files for line in violations(f)]
found += [f"{f.relative_to(root)} names the parameter {name}, which its row of kParams should say"
          for f in PRODUCT if f != TABLE for name in lists_parameters(f)]
found += twice_defined(f for f in PRODUCT if f.suffix in SOURCE)
if modules := package_circle():
    found.append(f"python/pointfair: imports run in a circle through {', '.join(modules)}")
print("\n".join(found) if found else f"{len(files)} files keep the include rules")
sys.exit(1 if found else 0)
