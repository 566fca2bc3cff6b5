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

class NearestAlongX {
 public:
  explicit NearestAlongX(const std::vector<Point>& places) : places_(places), along_x_(places.size()) {
    std::iota(along_x_.begin(), along_x_.end(), std::uint32_t(0));
    std::sort(along_x_.begin(), along_x_.end(), [&](std::uint32_t a, std::uint32_t b) {
      return places[a].x != places[b].x ? places[a].x < places[b].x : a < b;
    });
  }

  // Of the n-th place along x, into a row of kPool.
  void find(std::size_t n, std::uint32_t* row) const {
    std::array<std::pair<double, std::uint32_t>, kPool> nearest;
    nearest.fill({std::numeric_limits<double>::infinity(), 0});
    const Point& from = places_[along_x_[n]];
    // false: from here on all are too far
    const auto takes = [&](std::uint32_t j) {
      const Point& to = places_[j];
      const double x = double(from.x) - to.x, y = double(from.y) - to.y, z = double(from.z) - to.z;
      if (x * x > nearest.back().first) return false;
      const std::pair<double, std::uint32_t> found{x * x + y * y + z * z, j};
      if (!(found < nearest.back())) return true;
      std::size_t place = kPool - 1;
      for (; place > 0 && found < nearest[place - 1]; --place) nearest[place] = nearest[place - 1];
      nearest[place] = found;
      return true;
    };
    bool goes_up = true, goes_down = true;
    takes(along_x_[n]);
    for (std::size_t step = 1; goes_up || goes_down; ++step) {
      goes_up = goes_up && n + step < along_x_.size() && takes(along_x_[n + step]);
      goes_down = goes_down && step <= n && takes(along_x_[n - step]);
    }
    for (std::size_t i = 0; i < kPool; ++i) row[i] = nearest[i].second;
  }
  std::size_t place(std::size_t n) const { return along_x_[n]; }

 private:
  const std::vector<Point>& places_;
  std::vector<std::uint32_t> along_x_;
};

}  // namespace

Pools::Pools(const std::vector<Point>& places, const ForEach& for_each) : rows_(places.size() * kPool) {
  const NearestAlongX nearest(places);
  for_each(places.size(), [&](std::size_t n) { nearest.find(n, &rows_[nearest.place(n) * kPool]); });
}

std::optional<double> median_known(std::span<const std::uint32_t> pool, const std::vector<double>& values) {
  std::vector<double> known;
  for (const std::uint32_t i : pool)
    if (!std::isnan(values[i])) known.push_back(values[i]);
  if (known.empty()) return std::nullopt;
  const auto middle = known.begin() + std::ptrdiff_t(known.size() / 2);
  std::nth_element(known.begin(), middle, known.end());
  return *middle;
}

}  // namespace pointfair
