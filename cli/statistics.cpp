// SPDX-License-Identifier: Apache-2.0
#include "statistics.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace pointfair::cli {
namespace {

// The value that has `rank` values before it when they are sorted; `most` is the greatest. Of many, all threads look at
// which of 4,096 parts of the range it lies in, and the values of that part are sorted out.
double value_at(std::span<double> values, std::size_t rank, double most) {
  constexpr std::size_t kFew = 1 << 16, kParts = 4096, kShares = 64;
  const auto nth = [](std::span<double> of, std::size_t place) {
    std::nth_element(of.begin(), of.begin() + static_cast<std::ptrdiff_t>(place), of.end());
    return of[place];
  };
  if (values.size() < kFew || !std::isnormal(most)) return nth(values, rank);
  const auto part_of = [&](double value) {
    return std::min(static_cast<std::size_t>(value / most * kParts), kParts - 1);
  };
  const auto share = [&](std::size_t number) {
    const std::size_t begin = number * values.size() / kShares, end = (number + 1) * values.size() / kShares;
    return values.subspan(begin, end - begin);
  };
  std::vector<std::array<std::size_t, kParts>> counts(kShares);
  tbb::parallel_for(std::size_t(0), kShares, [&](std::size_t number) {
    for (const double value : share(number)) ++counts[number][part_of(value)];
  });
  const auto count_of = [&](std::size_t part) {
    std::size_t count = 0;
    for (const auto& its : counts) count += its[part];
    return count;
  };
  std::size_t part = 0;
  for (std::size_t count = count_of(part); rank >= count; count = count_of(++part)) rank -= count;
  std::vector<double> of_part(count_of(part));
  std::array<std::size_t, kShares> begins{};
  for (std::size_t number = 1; number < kShares; ++number)
    begins[number] = begins[number - 1] + counts[number - 1][part];
  tbb::parallel_for(std::size_t(0), kShares, [&](std::size_t number) {
    std::size_t place = begins[number];
    for (const double value : share(number))
      if (part_of(value) == part) of_part[place++] = value;
  });
  return nth(of_part, rank);
}

}  // namespace

Statistics summarize(std::span<double> values) {
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
  result.p95 = value_at(values, static_cast<std::size_t>(std::ceil(0.95 * count)) - 1, result.max);
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
