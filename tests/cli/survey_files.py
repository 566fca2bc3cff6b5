# SPDX-License-Identifier: Apache-2.0
"""Small LAS and E57 files, made from their specifications."""
import math
import random
import struct

METRES = b'PROJCS["Somewhere",GEOGCS["g",UNIT["degree",0.0174]],UNIT["metre",1],AUTHORITY["EPSG","25832"]]'
DEGREES = b'GEOGCS["Somewhere",DATUM["d"],UNIT["degree",0.0174],AUTHORITY["EPSG","4326"]]'
FEET = b'PROJCS["Elsewhere",GEOGCS["g",UNIT["degree",0.0174]],UNIT["foot",0.3048]]'


def ground(count, noise=0.02, seed=1):
    """Points of a gently waving ground, with heights that are noisy."""
    rng, side = random.Random(seed), int(math.sqrt(count))
    for i in range(side * side):
        x, y = i % side * 0.25 + rng.uniform(-.1, .1), i // side * 0.25 + rng.uniform(-.1, .1)
        yield x, y, 0.3 * math.sin(x / 3) + rng.gauss(0, noise)


def write_las(path, points, classes, scale=0.001, crs=METRES):
    """LAS 1.4, point format 6. Returns the path."""
    points, grid = list(points), []
    offset = (500000.0, 5400000.0, 100.0)
    for p in points:
        grid.append([round(v / scale) for v in p])
    records = b""
    if crs:
        records = struct.pack("<H16sHH32s", 0, b"LASF_Projection", 2112, len(crs) + 1, b"") + crs + b"\0"
    begin = 375 + len(records)
    head = bytearray(375)
    struct.pack_into("<4sHH", head, 0, b"LASF", 0, 0x11)
    head[24:26] = b"\1\4"
    struct.pack_into("<32s32sHHHIIBH", head, 26, b"a scanner", b"made by a test", 1, 2026, 375, begin, len(records) > 0, 6, 30)
    struct.pack_into("<6d", head, 131, scale, scale, scale, *offset)
    for axis in range(3):
        values = [g[axis] * scale + offset[axis] for g in grid] or [0]
        struct.pack_into("<2d", head, 179 + 16 * axis, max(values), min(values))
    struct.pack_into("<QQ", head, 247, len(grid), len(grid))
    body = b"".join(struct.pack("<3iHBBBBhHd", *g, 100 + i % 7, 0x11, 0, kind, 5, 10, 1, i * 1e-5)
                    for i, (g, kind) in enumerate(zip(grid, classes)))
    path.write_bytes(bytes(head) + records + body)
    return path


def write_old_las(path, points, described=b"", extra=b""):
    """LAS 1.2, point format 0, in class 2, with the same extra bytes at each point. Returns the path."""
    grid = [[round(v / 0.001) for v in p] for p in points]
    records = struct.pack("<H16sHH32s", 0, b"LASF_Spec", 4, len(described), b"") + described if described else b""
    head = bytearray(227)
    struct.pack_into("<4s", head, 0, b"LASF")
    head[24:26] = b"\1\2"
    struct.pack_into("<32s32sHHHIIBHI", head, 26, b"a scanner", b"made by a test", 1, 2026, 227, 227 + len(records),
                     bool(records), 0, 20 + len(extra), len(grid))
    struct.pack_into("<I", head, 111, len(grid))
    struct.pack_into("<3d", head, 131, 0.001, 0.001, 0.001)
    for axis in range(3):
        values = [g[axis] * 0.001 for g in grid]
        struct.pack_into("<2d", head, 179 + 16 * axis, max(values), min(values))
    path.write_bytes(bytes(head) + records + b"".join(struct.pack("<3iHBBbBH", *g, 7, 9, 2, 0, 0, 1) + extra for g in grid))
    return path


def las_grid(path):
    """The integers of the coordinates of an uncompressed file."""
    data = path.read_bytes()
    begin, length = struct.unpack_from("<I", data, 96)[0], struct.unpack_from("<H", data, 105)[0]
    return [struct.unpack_from("<3i", data, at) for at in range(begin, begin + length * struct.unpack_from("<Q", data, 247)[0], length)]


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def write_e57(path, points):
    """One scan of doubles. Returns the path."""
    points = list(points)
    physical = lambda at: at // 1020 * 1024 + at % 1020
    packets, step = b"", 500
    for first in range(0, len(points), step):
        part = points[first:first + step]
        data = b"".join(struct.pack(f"<{len(part)}d", *(p[axis] for p in part)) for axis in range(3))
        packet = struct.pack("<BBHH3H", 1, 0, 0, 3, *[8 * len(part)] * 3) + data
        packet += bytes(-len(packet) % 4)
        packets += packet[:2] + struct.pack("<H", len(packet) - 1) + packet[4:]
    section = struct.pack("<QQQQ", 1, 32 + len(packets), physical(48 + 32), 0) + packets
    fields = "".join(f'<cartesian{axis} type="Float"/>' for axis in "XYZ")
    xml = ('<?xml version="1.0" encoding="UTF-8"?>\n<e57Root type="Structure" xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0">'
           f'<data3D type="Vector"><vectorChild type="Structure"><points type="CompressedVector" fileOffset="{physical(48)}" '
           f'recordCount="{len(points)}"><prototype type="Structure">{fields}</prototype><codecs type="Vector"/></points></vectorChild>'
           '</data3D></e57Root>').encode()
    begin = 48 + len(section)
    pages = (begin + len(xml) + 1019) // 1020
    logical = struct.pack("<8sIIQQQQ", b"ASTM-E57", 1, 0, pages * 1024, physical(begin), len(xml), 1024) + section + xml
    logical += bytes(pages * 1020 - len(logical))
    path.write_bytes(b"".join(logical[at:at + 1020] + struct.pack(">I", crc32c(logical[at:at + 1020]))
                              for at in range(0, len(logical), 1020)))
    return path
