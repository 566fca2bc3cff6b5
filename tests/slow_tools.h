// SPDX-License-Identifier: Apache-2.0
// compute-sanitizer makes each launch of a kernel take a thousand times as long. With POINTFAIR_TEST_POINTS=N tests
// that use a card take clouds of at most N points, and every third of long lists of settings.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <vector>

namespace pointfair::slow_tools {

// `count` itself without the limit.
inline std::size_t most_points(std::size_t count) {
  const char* const limit = std::getenv("POINTFAIR_TEST_POINTS");
  return limit == nullptr ? count : std::min<std::size_t>(count, std::strtoull(limit, nullptr, 10));
}

// All without the limit.
template <class T>
std::vector<T> some_of(const std::vector<T>& all) {
  if (std::getenv("POINTFAIR_TEST_POINTS") == nullptr) return all;
  std::vector<T> result;
  for (std::size_t i = 0; i < all.size(); i += 3) result.push_back(all[i]);
  return result;
}

}  // namespace pointfair::slow_tools
