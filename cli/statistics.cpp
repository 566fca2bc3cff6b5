// SPDX-License-Identifier: Apache-2.0
#include "statistics.hpp"

#include <algorithm>
#include <cmath>

namespace pointfair::cli {

Statistics summarize(std::vector<double>& values) {
  if (values.empty()) return {};
  Statistics result;
  const double count = static_cast<double>(values.size());
  double sum = 0, sum_of_squares = 0;
  for (const double value : values) {
    sum += value;
    sum_of_squares += value * value;
    result.max = std::max(result.max, value);
  }
  result.mean = sum / count;
  result.rms = std::sqrt(sum_of_squares / count);
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(0.95 * count)) - 1;
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  result.p95 = values[static_cast<std::size_t>(rank)];
  return result;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

}  // namespace pointfair::cli
