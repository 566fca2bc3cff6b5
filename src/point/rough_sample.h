// SPDX-License-Identifier: Apache-2.0
// A rough sample of a cloud by places in its array, for what a result does not depend on: one point of each stretch of
// equal length.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// Of the i-th stretch, any place, by a hash (the finaliser of the 32-bit MurmurHash3, A. Appleby): at the beginning of
// each, what repeats along the array, as rows of pixels and rings of a lidar do, could be all that a sample sees.
// `length`: below 2^32.
POINTFAIR_INLINE unsigned long long place_in_stretch(unsigned i, unsigned long long length) {
  unsigned hash = (i + 1) * 0x9e3779b9u;
  hash = (hash ^ (hash >> 16)) * 0x85ebca6bu;
  hash = (hash ^ (hash >> 13)) * 0xc2b2ae35u;
  hash ^= hash >> 16;
  return i * length + ((hash * length) >> 32);
}

}  // namespace pointfair::point
