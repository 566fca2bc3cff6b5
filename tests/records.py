#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Every record of docs/decisions that is cited exists, and the README there lists each once. Reads the tree given as
argument. A citation is a path (docs/decisions/128), a word and a number (record 128, records 128 and 142), the name of a
record's file in a link, or a number of three digits that ends a comment behind a semicolon or a comma, as in
src/estimate/constants.hpp. Links to other files are checked where the site is built."""
import pathlib
import re
import subprocess
import sys

NUMBER = r"(?<![\d.,])\d{3}(?![\d%]|[.,:]\d)"
PATH = re.compile(r"decisions/(\d{3})(?:-[\w-]*)?")
WORD = re.compile(rf"\b(?:[Rr]ecords?|[Dd]ecisions?)\s+\[?({NUMBER}(?:(?:,| and|, and)\s+{NUMBER})*)")
LINK = re.compile(r"\]\((?:decisions/)?(\d{3}-[\w-]+\.md)")
CONSTANT = re.compile(r"//.*?[;,] (\d{3}(?:, \d{3})*)$", re.M)  # only where numbers stand for records
NUMBERED = "src/estimate/constants.hpp"
ROW = re.compile(r"^\| (\d{3}) \| \[(.+)\]\((.+\.md)\) \|", re.M)
TEXT = {".md", ".hpp", ".cpp", ".h", ".cu", ".cuh", ".py", ".ts", ".mjs", ".js", ".html", ".txt", ".cmake", ".yml", ".toml",
        ".sh", ".json", ".in", ""}


def cited(text, numbered=False):
    """(line, number, file name or None) of each record that the text cites."""
    found = [(match, [(match[1], None)]) for match in PATH.finditer(text)]
    found += [(match, [(number, None) for number in re.findall(r"\d{3}", match[1])]) for match in WORD.finditer(text)]
    found += [(match, [(match[1][:3], match[1])]) for match in LINK.finditer(text)]
    if numbered:
        found += [(match, [(number, None) for number in match[1].split(", ")]) for match in CONSTANT.finditer(text)]
    return sorted({(text.count("\n", 0, match.start(1)) + 1, number, name or "") for match, pairs in found
                   for number, name in pairs})


def tree(root):
    """The text files of the tree that git knows, or all of them where git is not there."""
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=root,
                            capture_output=True, text=True)
    paths = [root / name for name in listed.stdout.split("\0") if name] if listed.returncode == 0 else root.rglob("*")
    return [path for path in sorted(paths) if path.suffix in TEXT and path.is_file() and path != pathlib.Path(__file__)]


def faults(root):
    folder = root / "docs/decisions"
    records = {}
    for path in sorted(folder.glob("[0-9]*.md")):
        number, heading = path.name[:3], path.read_text().splitlines()[0]
        if number in records:
            yield f"{path.name} and {records[number].name} have one number"
        if not heading.startswith(f"# {number}. "):
            yield f"{path.name} begins with {heading!r}, not with '# {number}. '"
        records[number] = path
    rows = ROW.findall((folder / "README.md").read_text())
    listed = [name for _, _, name in rows]
    for number, title, name in rows:
        if not (folder / name).is_file() or name[:3] != number:
            yield f"docs/decisions/README.md lists {number} as {name}, which is not there"
        elif title != (folder / name).read_text().splitlines()[0][len("# 000. "):]:
            yield f"docs/decisions/README.md has another title of {number} than {name}"
    for path in records.values():
        if listed.count(path.name) != 1:
            yield f"docs/decisions/README.md lists {path.name} {listed.count(path.name)} times"
    for path in tree(root):
        relative = path.relative_to(root).as_posix()
        try:
            text = path.read_text()
        except UnicodeDecodeError:
            continue
        for line, number, name in cited(text, relative == NUMBERED):
            if number not in records or name and name != records[number].name:
                yield f"{relative}:{line} cites record {name or number}, which docs/decisions does not have"


assert cited("a\nsee docs/decisions/128 and record 142; records 149, 150 and 152.") == [
    (2, "128", ""), (2, "142", ""), (2, "149", ""), (2, "150", ""), (2, "152", "")]
assert cited("[why](decisions/060-laz-layers.md) and [083](083-by-position.md)") == [
    (1, "060", ""), (1, "060", "060-laz-layers.md"), (1, "083", "083-by-position.md")]
assert cited("int a = 1;  // points; (8); estimates, 117\nint b = 2;  // of R; 053, 110", numbered=True) == [
    (1, "117", ""), (2, "053", ""), (2, "110", "")]
assert not cited("record 1.234, records of 12 bytes, a record of 100 points\nint c = 3;  // bytes, 255")
found = list(faults(pathlib.Path(sys.argv[1]).resolve()))
print("\n".join(found) if found else "every record that is cited exists, and the README lists each once")
sys.exit(1 if found else 0)
