// SPDX-License-Identifier: Apache-2.0
// What a tile asks of the backend that computes it: which results would be the same with the whole cloud loaded.
#pragma once

#include <span>

#include "point/region.h"

namespace pointfair {

class Exactness {
 public:
  virtual ~Exactness() = default;
  // After the first iteration's fairing, where what was uploaded are all points of a larger cloud in `loaded`: a
  // point::Outcome a point, in upload order; 0 for invalid points.
  virtual void outcomes(const point::Region& loaded, std::span<unsigned char> out) = 0;
};

}  // namespace pointfair
