// SPDX-License-Identifier: Apache-2.0
#include "tiles/halo.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "portable.hpp"

namespace pointfair {

point::Region region_around(const Bounds& whole, const Bounds& wanted, double halo) {
  const auto below = [&](float v, float end) { return v - halo <= end ? -kUnbounded : float(v - halo); };
  const auto above = [&](float v, float end) { return v + halo >= end ? kUnbounded : float(v + halo); };
  return {{below(wanted.min.x, whole.min.x), below(wanted.min.y, whole.min.y), below(wanted.min.z, whole.min.z)},
          {above(wanted.max.x, whole.max.x), above(wanted.max.y, whole.max.y), above(wanted.max.z, whole.max.z)}};
}

bool lies_inside(const point::Region& r, const Bounds& b) {
  return b.min.x >= r.min.x && b.max.x <= r.max.x && b.min.y >= r.min.y && b.max.y <= r.max.y && b.min.z >= r.min.z &&
         b.max.z <= r.max.z;
}

bool may_overlap(const point::Region& r, const Bounds& b) {
  return b.valid > 0 && b.min.x <= r.max.x && b.max.x >= r.min.x && b.min.y <= r.max.y && b.max.y >= r.min.y &&
         b.min.z <= r.max.z && b.max.z >= r.min.z;
}

double reach_of_nearest(const Bounds& whole, double k, const Bounds& b) {
  double sides[] = {double(b.max.x) - b.min.x, double(b.max.y) - b.min.y, double(b.max.z) - b.min.z};
  std::ranges::sort(sides);
  const double count = double(std::max<std::uint64_t>(b.valid, 1));
  const double spacing = std::max(std::sqrt(sides[2] * sides[1] / count), sides[2] / count);
  const double diagonal = portable::hypot(double(whole.max.x) - whole.min.x, double(whole.max.y) - whole.min.y,
                                          double(whole.max.z) - whole.min.z);
  return std::max(2.5 * std::sqrt((k + 1) / std::numbers::pi) * spacing, 1e-6 * diagonal);
}

double first_halo(const Bounds& whole, const FramedSettings& stages, const Bounds& b) {
  const NeighborSettings& n = stages.neighbors;
  double nearest = reach_of_nearest(whole, n.k > 0 ? n.k : n.min_neighbors, b);
  if (n.reach_levels) nearest *= *std::ranges::max_element(n.reach_levels->levels);
  double reach = n.k > 0 ? nearest : portable::hypot(nearest, double(n.radius));
  if (n.k > 0 && n.radius > 0) reach = std::min(reach, 1.01 * double(n.radius));
  if (n.constraint) reach += double(n.reach);
  const FairingSettings& f = stages.fairing;
  const bool reads_others = f.symmetric || f.area_weight != AreaWeight::none || f.pull_outliers;
  const int steps = f.method != Method::bilateral ? 2 : int(reads_others);
  return reach * (stages.normals.filter_rounds + double(stages.normals.flat_scale) * (1 + steps));
}

}  // namespace pointfair
