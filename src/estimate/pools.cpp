// SPDX-License-Identifier: Apache-2.0
#include "estimate/pools.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace pointfair {
namespace {

using constants::kPool;

constexpr std::size_t kAtOnce = 32;  // places that one core takes

// The nearest of some places to each of them, found along x.
class NearestAlongX {
 public:
  explicit NearestAlongX(const std::vector<Point>& places) : places_(places), along_x_(places.size()) {
    std::iota(along_x_.begin(), along_x_.end(), std::uint32_t(0));
    std::sort(along_x_.begin(), along_x_.end(), [&](std::uint32_t a, std::uint32_t b) {
      return places[a].x != places[b].x ? places[a].x < places[b].x : a < b;
    });
    for (const std::uint32_t i : along_x_) {
      x_.push_back(places[i].x);
      y_.push_back(places[i].y);
      z_.push_back(places[i].z);
    }
  }

  // Finds the rows of the n-th places along x from `begin` to before `end`, and writes each to its place in `rows`,
  // nearest first. Equal distances go in the order of the places, which is one of positions.
  void find(std::size_t begin, std::size_t end, std::uint32_t* rows) const {
    std::vector<Found> found(places_.size());
    double guess = std::numeric_limits<double>::infinity();  // most rows reach about as far as the one before
    for (std::size_t n = begin; n < end; ++n) {
      std::size_t count = collect(n, guess, found);
      while (count < kPool) count = collect(n, guess *= 4, found);
      const auto first = found.begin();
      std::nth_element(first, first + kPool - 1, first + std::ptrdiff_t(count));
      guess = 1.5 * first[kPool - 1].first;
      if (!(guess > 0)) guess = std::numeric_limits<double>::infinity();
      std::sort(first, first + kPool);
      for (std::size_t i = 0; i < kPool; ++i) rows[along_x_[n] * kPool + i] = first[i].second;
    }
  }

 private:
  using Found = std::pair<double, std::uint32_t>;  // squared distance, and whose

  // Collects the places within a squared radius, and returns their number.
  std::size_t collect(std::size_t n, double within, std::vector<Found>& found) const {
    const double x = x_[n], y = y_[n], z = z_[n];
    std::size_t count = 0;
    // false: from here on all are too far
    const auto offer = [&](std::size_t i) {
      const double to_x = x - x_[i], to_y = y - y_[i], to_z = z - z_[i], squared_x = to_x * to_x;
      const double squared = squared_x + to_y * to_y + to_z * to_z;
      found[count] = {squared, along_x_[i]};
      count += squared <= within;
      return squared_x <= within;
    };
    std::size_t i = n;
    while (i < x_.size() && offer(i)) ++i;
    for (i = n; i > 0 && offer(i - 1);) --i;
    return count;
  }

  const std::vector<Point>& places_;
  std::vector<std::uint32_t> along_x_;
  std::vector<double> x_, y_, z_;  // of places along x
};

}  // namespace

Pools::Pools(const std::vector<Point>& places, const ForEach& for_each) : rows_(places.size() * kPool) {
  const NearestAlongX nearest(places);
  for_each((places.size() + kAtOnce - 1) / kAtOnce, [&](std::size_t block) {
    const std::size_t begin = block * kAtOnce;
    nearest.find(begin, std::min(places.size(), begin + kAtOnce), rows_.data());
  });
}

std::optional<double> median_known(std::span<const std::uint32_t> pool, const Ranked& values) {
  const double median = values.among(pool, [](std::size_t known) { return known / 2; });
  if (std::isnan(median)) return std::nullopt;
  return median;
}

}  // namespace pointfair
