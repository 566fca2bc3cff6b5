#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Which wheels of a folder wheel.py tries."""
import pathlib
import tempfile
import unittest

import wheel

PLAIN = ["pointfair-0.1.0-cp312-abi3-manylinux_2_28_x86_64.whl", "pointfair-0.1.0-cp312-abi3-win_amd64.whl"]
CUDA = "pointfair-0.1.0+cuda13-cp312-abi3-manylinux_2_28_x86_64.whl"


class Wheels(unittest.TestCase):
    def tried(self, *names):
        with tempfile.TemporaryDirectory() as dist:
            for name in names:
                (pathlib.Path(dist) / name).touch()
            return [path.name for path in wheel.wheels_to_try(dist)]

    def test_a_wheel_with_cuda_is_tried_where_it_is_alone(self):
        self.assertEqual(self.tried(CUDA, *PLAIN), PLAIN)
        self.assertEqual(self.tried(CUDA), [CUDA])


if __name__ == "__main__":
    unittest.main()
