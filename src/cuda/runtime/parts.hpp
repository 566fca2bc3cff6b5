// SPDX-License-Identifier: Apache-2.0
// How a cloud is divided on its way to a card. In a cloud in spatial order, as scanners and tilings write them,
// consecutive parts lie apart from each other: each gets a tree of its own, and while one is copied others are
// computed.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair {

struct Parts {
  std::vector<std::size_t> ends;  // of consecutive parts; the last is the number of points

  std::size_t count() const { return ends.size(); }
  std::size_t begin(std::size_t part) const { return part == 0 ? 0 : ends[part - 1]; }
  std::size_t size(std::size_t part) const { return ends[part] - begin(part); }
  // Of so many points each, 1,024 or a multiple of that, the last the rest.
  static Parts of(std::size_t points, std::size_t each);
};

// Parts that lie apart, if `may_lie_apart` and a sample says so; else a single one.
Parts plan_parts(std::span<const Point> points, bool may_lie_apart);

}  // namespace pointfair
