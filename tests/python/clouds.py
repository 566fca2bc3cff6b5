# SPDX-License-Identifier: Apache-2.0
"""Clouds that the tests denoise, and files written without the library."""
import numpy as np


def waves(count=3000, noise=0.01, seed=1, dtype=np.float64, centre=(0, 0, 0)):
    """A noisy sheet z = sin(6 x) / 10."""
    rng = np.random.default_rng(seed)
    xy = rng.random((count, 2))
    z = 0.1 * np.sin(6 * xy[:, 0]) + rng.normal(0, noise, count)
    return (np.c_[xy, z] + np.asarray(centre, float)).astype(dtype)


def write_ply(path, xyz):
    """A binary PLY of the array's own type."""
    kind = "float" if xyz.dtype.itemsize == 4 else "double"
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(xyz)}\n"
    header += "".join(f"property {kind} {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(header.encode() + np.ascontiguousarray(xyz).tobytes())


def read_ply(path, dtype):
    """The positions of a file that write_ply wrote."""
    data = path.read_bytes()
    return np.frombuffer(data[data.index(b"end_header\n") + 11:], dtype).reshape(-1, 3)


def same_bits(a, b):
    """Whether two arrays have the same type, shape and bits."""
    return a.dtype == b.dtype and a.shape == b.shape and np.ascontiguousarray(a).tobytes() == np.ascontiguousarray(b).tobytes()
