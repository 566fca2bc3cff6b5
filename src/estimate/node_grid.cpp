// SPDX-License-Identifier: Apache-2.0
#include "estimate/node_grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "estimate/constants.hpp"
#include "point/node_field.h"

namespace pointfair {
namespace {

using constants::kAside, constants::kSurroundings;

// Sums over the cells of a cube of n cells an axis, and the mean once it is known.
struct Level {
  explicit Level(int cells) : n(cells), weight(std::size_t(n) * n * n), sum(weight.size()) {}
  std::size_t at(int x, int y, int z) const { return (std::size_t(z) * n + y) * n + x; }
  int n;
  std::vector<double> weight, sum;
};

// Gortler and others 1996: sums are pushed to ever wider cells, and means are pulled back.
std::vector<Level> push(Level finest) {
  std::vector<Level> levels;
  levels.push_back(std::move(finest));
  while (levels.back().n > 1) {
    const Level& from = levels.back();
    Level to(from.n / 2);
    for (int z = 0; z < from.n; ++z)
      for (int y = 0; y < from.n; ++y)
        for (int x = 0; x < from.n; ++x) {
          const std::size_t cell = to.at(x / 2, y / 2, z / 2);
          to.weight[cell] += from.weight[from.at(x, y, z)];
          to.sum[cell] += from.sum[from.at(x, y, z)];
        }
    levels.push_back(std::move(to));
  }
  return levels;
}

// Along an axis of n cells: the middle of each of 2 n finer cells lies three quarters towards one cell from the next.
void refine(int n, const double* coarse, double* fine, std::size_t stride) {
  for (int i = 0; i < n; ++i) {
    const double here = coarse[i * stride], before = coarse[std::max(i - 1, 0) * stride],
                 after = coarse[std::min(i + 1, n - 1) * stride];
    fine[2 * i * stride] = here + (before - here) / 4;
    fine[(2 * i + 1) * stride] = here + (after - here) / 4;
  }
}

// The means of `fine` from its own sums and from the means of cells twice as wide, trilinear between their middles.
std::vector<double> pull(const Level& fine, const std::vector<double>& coarse, const ForEach& for_each) {
  const std::size_t n = fine.n / 2, m = fine.n;
  std::vector<double> along_z(m * n * n), mean(m * m * m);
  for (std::size_t column = 0; column < n * n; ++column) refine(int(n), &coarse[column], &along_z[column], n * n);
  for_each(m, [&](std::size_t z) {
    std::vector<double> along_y(m * n);
    for (std::size_t x = 0; x < n; ++x) refine(int(n), &along_z[z * n * n + x], &along_y[x], n);
    for (std::size_t y = 0; y < m; ++y) {
      const std::size_t row = (z * m + y) * m;
      refine(int(n), &along_y[y * n], &mean[row], 1);
      for (std::size_t cell = row; cell < row + m; ++cell)
        mean[cell] = (fine.sum[cell] + kSurroundings * mean[cell]) / (fine.weight[cell] + kSurroundings);
    }
  });
  return mean;
}

// Trilinear shares of a value at its eight nodes.
void add(Level& nodes, const point::NodeField& field, const Point& p, double value) {
  const point::NodePlace along[] = {point::node_place(p.x, field.first.x, field.nodes_per_unit),
                                    point::node_place(p.y, field.first.y, field.nodes_per_unit),
                                    point::node_place(p.z, field.first.z, field.nodes_per_unit)};
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

NodeLevels grid_around(const std::vector<Point>& places) {
  float low[3], widest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> values;
    for (const Point& p : places) values.push_back(axis == 0 ? p.x : axis == 1 ? p.y : p.z);
    std::sort(values.begin(), values.end());
    const std::size_t aside = std::size_t(kAside * double(values.size()));
    low[axis] = values[aside];
    widest = std::max(widest, values[values.size() - 1 - aside] - values[aside]);
  }
  return {{}, {low[0], low[1], low[2]}, widest > 0 ? float(point::kFieldNodes - 1) / widest : 0};
}

}  // namespace

NodeLevels levels_between(const std::vector<Point>& places, const std::vector<double>& log_levels,
                          const ForEach& for_each) {
  NodeLevels result = grid_around(places);
  const point::NodeField field{nullptr, {result.first.x, result.first.y, result.first.z}, result.nodes_per_unit};
  Level nodes(point::kFieldNodes);
  for (std::size_t i = 0; i < places.size(); ++i) add(nodes, field, places[i], log_levels[i]);
  const std::vector<Level> levels = push(std::move(nodes));
  std::vector<double> mean{levels.back().sum[0] / levels.back().weight[0]};
  for (std::size_t level = levels.size() - 1; level > 0; --level) mean = pull(levels[level - 1], mean, for_each);
  result.levels.resize(mean.size());
  for_each(point::kFieldNodes, [&](std::size_t z) {
    const std::size_t slab = mean.size() / point::kFieldNodes;
    for (std::size_t i = z * slab; i < (z + 1) * slab; ++i) result.levels[i] = std::exp(float(mean[i]));
  });
  return result;
}

}  // namespace pointfair
