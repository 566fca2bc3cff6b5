// SPDX-License-Identifier: Apache-2.0
// Position along a Hilbert curve of 2^bits steps an axis, after J. Skilling, "Programming the Hilbert curve" (2004):
// consecutive positions are adjacent cells, so consecutive points make compact leaves, without the jumps of Morton
// order.
#pragma once

namespace pointfair::cuda {

template <class Key, int kBits>
__device__ inline Key hilbert_key(unsigned x, unsigned y, unsigned z) {
  // From the highest bit down: undo what the coarser steps rotated and mirrored.
#pragma unroll
  for (int bit = kBits - 1; bit > 0; --bit) {
    const unsigned below = (1u << bit) - 1u;
    if ((x >> bit & 1u) != 0) x ^= below;
    const unsigned swap_y = (x ^ y) & below;
    const bool y_set = (y >> bit & 1u) != 0;
    x ^= y_set ? below : swap_y;
    y ^= y_set ? 0u : swap_y;
    const unsigned swap_z = (x ^ z) & below;
    const bool z_set = (z >> bit & 1u) != 0;
    x ^= z_set ? below : swap_z;
    z ^= z_set ? 0u : swap_z;
  }
  y ^= x;
  z ^= y;
  unsigned gray = 0;
#pragma unroll
  for (int bit = kBits - 1; bit > 0; --bit)
    if ((z >> bit & 1u) != 0) gray ^= (1u << bit) - 1u;
  x ^= gray, y ^= gray, z ^= gray;
  Key key = 0;
#pragma unroll
  for (int bit = kBits - 1; bit >= 0; --bit)
    key = (key << 3) | ((x >> bit & 1u) << 2) | ((y >> bit & 1u) << 1) | (z >> bit & 1u);
  return key;
}

}  // namespace pointfair::cuda
