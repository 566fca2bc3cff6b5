// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace pointfair {

// Values with their ranks. It finds the n-th value of a selection by a bit for each, which suits many small selections.
class Ranked {
 public:
  // NaN: not known.
  explicit Ranked(const std::vector<double>& values) : rank_(values.size(), kNone) {
    std::vector<std::pair<double, std::uint32_t>> order;
    order.reserve(values.size());
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!std::isnan(values[i])) order.emplace_back(values[i], static_cast<std::uint32_t>(i));
    std::sort(order.begin(), order.end());
    sorted_.reserve(order.size());
    for (const auto& [value, i] : order) {
      rank_[i] = static_cast<std::uint32_t>(sorted_.size());
      sorted_.push_back(value);
    }
  }

  // Of the known values of `some`, n in number, the one with place(n) values before it; NaN if place(n) is kNoPlace.
  template <class PlaceOf>
  double among(std::span<const std::uint32_t> some, const PlaceOf& place) const {
    std::array<std::uint64_t, 64> few;  // mostly enough
    std::vector<std::uint64_t> many;
    std::uint64_t* bits = few.data();
    const std::size_t words = sorted_.size() / 64 + 1;
    if (words > few.size()) {
      many.resize(words);
      bits = many.data();
    }
    std::fill_n(bits, words, std::uint64_t(0));
    std::size_t known = 0;
    for (const std::uint32_t i : some) {
      const std::uint32_t rank = rank_[i];
      if (rank == kNone) continue;
      bits[rank / 64] |= std::uint64_t(1) << rank % 64;
      ++known;
    }
    std::size_t left = place(known);
    if (left >= known) return std::numeric_limits<double>::quiet_NaN();
    std::size_t word = 0;
    for (; left >= std::size_t(std::popcount(bits[word])); ++word) left -= std::size_t(std::popcount(bits[word]));
    std::uint64_t rest = bits[word];
    for (; left > 0; --left) rest &= rest - 1;
    return sorted_[word * 64 + std::size_t(std::countr_zero(rest))];
  }
  static constexpr std::size_t kNoPlace = ~std::size_t(0);

 private:
  static constexpr std::uint32_t kNone = ~0u;
  std::vector<double> sorted_;
  std::vector<std::uint32_t> rank_;
};

}  // namespace pointfair
