#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that programs and extensions of Python run on macOS on arm64 as they are, which no tool of another system tells: that
they are for that processor and a system that old, need no library but libSystem and, of Python, only names of its stable
interface, and that the hashes of their ad-hoc signature are right, without which the kernel ends them.

    macos_programs.py OLDEST FILE...       by the Python of tools.txt; OLDEST: the system's version, as 11.0"""
import hashlib
import pathlib
import struct
import sys

import abi3info
from abi3info.models import PyVersion

PYTHON = PyVersion(3, 12)  # the oldest that an extension is for
OF_PYTHON = {f"_{symbol.name}" for entries in (abi3info.FUNCTIONS, abi3info.DATAS) for symbol, entry in entries.items()
             if entry.added <= PYTHON and entry.ifdef is None}
MAGIC, ARM64, MACOS = 0xFEEDFACF, 0x0100000C, 1
# load commands
SYMBOLS, SIGNATURE, BUILD_VERSION, RUN_PATH = 0x02, 0x1D, 0x32, 0x8000001C
LIBRARIES = {0x0C, 0x80000018, 0x8000001F}  # needed, weakly, and passed on
AD_HOC = 2


def load_commands(data):
    """Pairs of a command's number and its bytes."""
    count, at = struct.unpack_from("<I", data, 16)[0], 32
    for _ in range(count):
        command, size = struct.unpack_from("<II", data, at)
        yield command, data[at:at + size]
        at += size


def text_at(data, at):
    return data[at:data.index(b"\0", at)].decode()


def names_of_any_library(data, command):
    """Undefined names that the system looks for in all that is loaded."""
    at, count, texts = struct.unpack_from("<III", command, 8)
    for name, kind, _, description, _ in struct.iter_unpack("<IBBHQ", data[at:at + 16 * count]):
        if kind & 0xEF == 1 and description >> 8 in (0, 0xFE):  # undefined and of no library: zig writes 0, others 0xFE
            yield text_at(data, texts + name)


def wrong_signature(data, command):
    """Why the kernel would not run it, or None. The signature has a hash for each page of the file before it."""
    start, = struct.unpack_from("<I", command, 8)
    magic, _, count = struct.unpack_from(">III", data, start)
    parts = dict(struct.unpack_from(">II", data, start + 12 + 8 * i) for i in range(count))
    if magic != 0xFADE0CC0 or 0 not in parts:
        return "its signature has no list of hashes"
    directory = start + parts[0]
    flags, hashes, _, _, pages, end = struct.unpack_from(">6I", data, directory + 12)
    size, kind, _, page = struct.unpack_from("4B", data, directory + 36)
    if not flags & AD_HOC or (size, kind) != (32, 2) or end != start or pages != -(-end >> page):
        return "its signature is not one of SHA-256 over the whole file"
    for i in range(pages):
        content = data[i << page:min((i + 1) << page, end)]
        if hashlib.sha256(content).digest() != data[directory + hashes + 32 * i:directory + hashes + 32 * (i + 1)]:
            return f"the hash of page {i} in its signature is of other bytes"
    return None


def what_is_wrong(data, oldest):
    """Why macOS `oldest`, as (11, 0), would not run it, or None."""
    if struct.unpack_from("<II", data) != (MAGIC, ARM64):
        return "it is not for arm64"
    commands = list(load_commands(data))
    for command, words in commands:
        if command in LIBRARIES:
            name = text_at(words, struct.unpack_from("<I", words, 8)[0])
            if name != "/usr/lib/libSystem.B.dylib":
                return f"it needs {name}"
        elif command == RUN_PATH:
            return "it looks for libraries along a path of its own"
        elif command == SYMBOLS:
            if others := sorted(set(names_of_any_library(data, words)) - OF_PYTHON):
                return f"it needs {others[0]}, which is neither the system's nor of Python's stable interface"
    kept = dict(commands)
    platform, version = struct.unpack_from("<II", kept.get(BUILD_VERSION, bytes(16)), 8)
    if platform != MACOS or (version >> 16, version >> 8 & 255) > oldest:
        return f"it is not for macOS {oldest[0]}.{oldest[1]}"
    return wrong_signature(data, kept[SIGNATURE]) if SIGNATURE in kept else "it is not signed"


def main(oldest, *files):
    oldest = tuple(map(int, oldest.split(".")))
    for file in files:
        if wrong := what_is_wrong(pathlib.Path(file).read_bytes(), oldest):
            sys.exit(f"{file} would not run on macOS: {wrong}")


main(*sys.argv[1:])
