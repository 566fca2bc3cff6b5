// SPDX-License-Identifier: Apache-2.0
#include "estimate/node_grid.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "estimate/constants.hpp"
#include "point/node_field.h"
#include "portable.hpp"
#include "seam/noise_levels.hpp"

namespace pointfair {
namespace {

using constants::kAside;
using constants::kMostNodes;

// Sums over the cells of a cube of n cells an axis, and their means once they are known.
struct Level {
  explicit Level(int cells)
      : n(cells),
        weight(std::size_t(n) * n * n),
        sum(weight.size()),
        mean(std::make_unique_for_overwrite<double[]>(weight.size())) {}
  std::size_t at(int x, int y, int z) const { return (std::size_t(z) * n + y) * n + x; }
  int n;
  std::vector<double> weight, sum;
  std::unique_ptr<double[]> mean;
};

// Calls body(z) for the slabs of a level, many at once where that is worth it.
void for_slabs(int slabs, const ForEach& for_each, const std::function<void(std::size_t)>& body) {
  constexpr int kWorthIt = 8;
  if (slabs >= kWorthIt) return for_each(std::size_t(slabs), body);
  for (std::size_t z = 0; z < std::size_t(slabs); ++z) body(z);
}

// Gortler and others 1996: sums are pushed to ever wider cells, and means are pulled back.
void push(const Level& from, Level& to, const ForEach& for_each) {
  for_slabs(to.n, for_each, [&](std::size_t slab) {
    for (int z = 2 * int(slab); z < 2 * int(slab) + 2; ++z)
      for (int y = 0; y < from.n; ++y)
        for (int x = 0; x < from.n; ++x) {
          to.weight[to.at(x / 2, y / 2, z / 2)] += from.weight[from.at(x, y, z)];
          to.sum[to.at(x / 2, y / 2, z / 2)] += from.sum[from.at(x, y, z)];
        }
  });
}

// The means of `fine` from its own sums and from the means of cells twice as wide, trilinear between their middles: the
// middle of a finer cell lies three quarters towards one cell from the next.
void pull(const Level& coarse, Level& fine, const ForEach& for_each) {
  const auto beside = [&](int i) { return std::clamp(i / 2 + (i % 2 == 0 ? -1 : 1), 0, coarse.n - 1); };
  const auto between = [](double own, double next) { return own + (next - own) / 4; };
  for_slabs(fine.n, for_each, [&](std::size_t slab) {
    const int z = int(slab);
    const auto along_z = [&](int x, int y) {
      return between(coarse.mean[coarse.at(x, y, z / 2)], coarse.mean[coarse.at(x, y, beside(z))]);
    };
    for (int y = 0; y < fine.n; ++y) {
      const auto along_y = [&](int x) { return between(along_z(x, y / 2), along_z(x, beside(y))); };
      for (int x = 0; x < fine.n; ++x) {
        const std::size_t cell = fine.at(x, y, z);
        fine.mean[cell] = (fine.sum[cell] + between(along_y(x / 2), along_y(beside(x)))) / (fine.weight[cell] + 1);
      }
    }
  });
}

// Trilinear shares of a value at its eight nodes.
void add(Level& nodes, const point::NodeField& field, const Point& p, double value) {
  const point::NodePlace along[] = {point::node_place(field, p.x, field.first.x),
                                    point::node_place(field, p.y, field.first.y),
                                    point::node_place(field, p.z, field.first.z)};
  for (int corner = 0; corner < 8; ++corner) {
    double share = 1;
    int at[3];
    for (int axis = 0; axis < 3; ++axis) {
      const bool high = corner >> axis & 1;
      at[axis] = along[axis].below + high;
      share *= high ? double(along[axis].above) : 1 - double(along[axis].above);
    }
    nodes.weight[nodes.at(at[0], at[1], at[2])] += share;
    nodes.sum[nodes.at(at[0], at[1], at[2])] += share * value;
  }
}

// As fine as places on a surface are dense, in powers of two.
int nodes_for(std::size_t places) {
  int nodes = kMostNodes;
  while (nodes > 2 && std::size_t(nodes / 2) * (nodes / 2) >= places) nodes /= 2;
  return nodes;
}

NodeLevels grid_around(const std::vector<Point>& places, const ForEach& for_each) {
  float low[3], wide[3];
  for_each(3, [&](std::size_t axis) {
    std::vector<float> values;
    values.reserve(places.size());
    for (const Point& p : places) values.push_back(axis == 0 ? p.x : axis == 1 ? p.y : p.z);
    const auto aside = std::ptrdiff_t(kAside * double(values.size()));
    const auto least = values.begin() + aside, most = values.end() - 1 - aside;
    std::nth_element(values.begin(), least, values.end());
    low[axis] = *least;
    std::nth_element(least, most, values.end());
    wide[axis] = *most - low[axis];
  });
  const float widest = std::max({0.0f, wide[0], wide[1], wide[2]});
  const int nodes = nodes_for(places.size());
  return {{}, nodes, {low[0], low[1], low[2]}, widest > 0 ? float(nodes - 1) / widest : 0};
}

}  // namespace

NodeLevels levels_between(const std::vector<Point>& places, const std::vector<double>& log_levels,
                          const ForEach& for_each) {
  NodeLevels result = grid_around(places, for_each);
  const point::NodeField field = field_of(&result);
  std::vector<Level> levels;  // the finest first
  for (int n = result.nodes; n > 0; n /= 2) levels.emplace_back(n);
  for (std::size_t i = 0; i < places.size(); ++i) add(levels[0], field, places[i], log_levels[i]);
  for (std::size_t level = 1; level < levels.size(); ++level) push(levels[level - 1], levels[level], for_each);
  levels.back().mean[0] = levels.back().sum[0] / levels.back().weight[0];
  for (std::size_t level = levels.size() - 1; level > 0; --level) pull(levels[level], levels[level - 1], for_each);
  result.levels.resize(levels[0].sum.size());
  for_each(std::size_t(result.nodes), [&](std::size_t z) {
    const std::size_t slab = result.levels.size() / std::size_t(result.nodes);
    for (std::size_t i = z * slab; i < (z + 1) * slab; ++i)
      result.levels[i] = float(portable::exp_within_700(levels[0].mean[i]));
  });
  return result;
}

}  // namespace pointfair
