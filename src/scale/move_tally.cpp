// SPDX-License-Identifier: Apache-2.0
#include "scale/move_tally.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace pointfair::scale {

void MoveTally::add(std::span<const float> lengths) {
  const std::lock_guard lock(mutex_);
  for (const float length : lengths) {
    const auto bits = std::bit_cast<std::uint32_t>(length);
    Bin& bin = bins_[bits >> 16];
    ++bin.count;
    bin.lower_halves += bits & 0xFFFF;
    max_ = std::max(max_, length);
  }
}

void MoveTally::add_numbers(std::span<const double> numbers) {
  const std::lock_guard lock(mutex_);
  if (numbers.empty()) return;
  max_ = std::max(max_, static_cast<float>(numbers.front()));
  for (std::size_t at = 1; at + 2 < numbers.size(); at += 3) {
    Bin& bin = bins_.at(static_cast<std::size_t>(numbers[at]));
    bin.count += static_cast<std::uint64_t>(numbers[at + 1]);
    bin.lower_halves += static_cast<std::uint64_t>(numbers[at + 2]);
  }
}

std::vector<double> MoveTally::numbers() const {
  const std::lock_guard lock(mutex_);
  std::vector<double> numbers{max_};
  for (std::size_t b = 0; b < bins_.size(); ++b)
    if (bins_[b].count > 0)
      numbers.insert(numbers.end(), {double(b), double(bins_[b].count), double(bins_[b].lower_halves)});
  return numbers;
}

// Within a bin, floats are evenly spaced.
double MoveTally::mean_of(std::size_t bin, const Bin& its) {
  const auto begin = static_cast<std::uint32_t>(bin << 16);
  const double least = std::bit_cast<float>(begin), step = double{std::bit_cast<float>(begin + 1)} - least;
  return least + step * (double(its.lower_halves) / double(its.count));
}

// The squares in a bin are taken as equal, which costs 3 millionths of the rms.
Displacement MoveTally::displacement() const {
  const std::lock_guard lock(mutex_);
  Displacement result;
  std::uint64_t count = 0, seen = 0;
  for (const Bin& bin : bins_) count += bin.count;
  if (count == 0) return result;
  double sum = 0, sum_of_squares = 0;
  const auto rank = static_cast<std::uint64_t>(std::ceil(0.95 * double(count)));
  for (std::size_t b = 0; b < bins_.size(); ++b) {
    if (bins_[b].count == 0) continue;
    const double mean = mean_of(b, bins_[b]);
    sum += mean * double(bins_[b].count);
    sum_of_squares += mean * mean * double(bins_[b].count);
    if (seen < rank) result.p95 = mean;
    seen += bins_[b].count;
  }
  result.mean = sum / double(count);
  result.rms = std::sqrt(sum_of_squares / double(count));
  result.max = max_;
  return result;
}

}  // namespace pointfair::scale
