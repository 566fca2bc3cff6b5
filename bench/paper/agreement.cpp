// SPDX-License-Identifier: Apache-2.0
#include "paper/agreement.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>
#include <vector>

namespace paper {

using pointfair::Point;

namespace {

constexpr std::size_t kSamples = 200;

// Rounded like pointfair's distances (docs/how-it-works.md, Neighbours), since equal ones are ordered by position.
float squared_distance(Point a, Point b) {
  const float x = b.x - a.x, y = b.y - a.y, z = b.z - a.z;
  return (x * x + y * y) + z * z;
}

}  // namespace

std::string compare_points(std::span<const Point> found, std::span<const Point> expected) {
  std::size_t differ = found.size() == expected.size() ? 0 : 1;
  for (std::size_t i = 0; i < std::min(found.size(), expected.size()); ++i)
    differ += std::memcmp(&found[i], &expected[i], sizeof(Point)) != 0;
  return differ == 0 ? "" : std::to_string(differ) + " faired points differ";
}

std::string compare_samples(std::span<const Point> points, int k, std::span<const std::uint32_t> rows) {
  const std::size_t step = std::max<std::size_t>(1, points.size() / kSamples);
  const auto length = static_cast<std::ptrdiff_t>(k);
  std::vector<std::tuple<float, float, float, float, std::uint32_t>> order;  // distance, position, index
  for (std::size_t i = 0; i < points.size(); i += step) {
    order.clear();
    for (std::size_t j = 0; j < points.size(); ++j)
      if (j != i)
        order.emplace_back(squared_distance(points[i], points[j]), points[j].x, points[j].y, points[j].z,
                           static_cast<std::uint32_t>(j));
    std::partial_sort(order.begin(), order.begin() + length, order.end());
    const auto row = rows.subspan(i * static_cast<std::size_t>(k), static_cast<std::size_t>(k));
    if (!std::equal(row.begin(), row.end(), order.begin(),
                    [](std::uint32_t a, const auto& b) { return a == std::get<4>(b); }))
      return "wrong neighbours of point " + std::to_string(i);
  }
  return "";
}

double sum_of_last_distances(std::span<const Point> points, int k, std::span<const std::uint32_t> rows) {
  double sum = 0;
  const auto width = static_cast<std::size_t>(k);
  for (std::size_t i = 0; i < points.size(); ++i)
    sum += std::sqrt(static_cast<double>(squared_distance(points[i], points[rows[(i + 1) * width - 1]])));
  return sum;
}

}  // namespace paper
