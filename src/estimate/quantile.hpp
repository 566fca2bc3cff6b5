// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace pointfair {

// The value that has `before` values before it when they are sorted; `before` is below their number.
inline double nth(std::vector<double> values, std::size_t before) {
  const auto place = values.begin() + std::ptrdiff_t(before);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}
// Of at least one value.
inline double quantile(std::vector<double> values, double share) {
  const auto before = std::size_t(share * double(values.size() - 1));
  return nth(std::move(values), before);
}
// Of an even number, the greater one.
inline double median(std::vector<double> values) {
  const std::size_t before = values.size() / 2;
  return nth(std::move(values), before);
}

}  // namespace pointfair
