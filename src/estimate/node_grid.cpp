// SPDX-License-Identifier: Apache-2.0
#include "estimate/node_grid.hpp"

#include <algorithm>
#include <cmath>

#include "estimate/constants.hpp"
#include "point/node_field.h"
#include "seam/noise_levels.hpp"
#include "seam/sample_fits.hpp"

namespace pointfair {
namespace {

using constants::kAside;
using constants::kMostNodes;

using Fields = std::vector<std::vector<double>>;  // values of each field

// Sums over cells, or nodes.
struct Sums {
  Sums(std::size_t cells, std::size_t fields) : weight(cells), values(fields, std::vector<double>(cells)) {}
  std::vector<double> weight;
  Fields values;
};

// The places that have a share in the nodes of each z, in their own order.
std::vector<std::vector<std::uint32_t>> places_of_slabs(const std::vector<Point>& places,
                                                        const point::NodeField& grid) {
  std::vector<std::vector<std::uint32_t>> of_slabs(std::size_t(grid.nodes));
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto below = std::size_t(point::node_place(grid, places[i].z, grid.first.z).below);
    of_slabs[below].push_back(std::uint32_t(i));
    of_slabs[below + 1].push_back(std::uint32_t(i));
  }
  return of_slabs;
}

// The nodes of one z. Each place has a trilinear share in eight nodes.
Sums slab_of(const std::vector<std::uint32_t>& in_slab, const std::vector<Point>& places, const Fields& values,
             const point::NodeField& grid, int z) {
  Sums slab(std::size_t(grid.nodes) * grid.nodes, values.size());
  const auto share = [](const point::NodePlace& along, bool after) {
    return after ? double(along.above) : 1 - double(along.above);
  };
  for (const std::uint32_t i : in_slab) {
    const point::NodePlace along_x = point::node_place(grid, places[i].x, grid.first.x),
                           along_y = point::node_place(grid, places[i].y, grid.first.y),
                           along_z = point::node_place(grid, places[i].z, grid.first.z);
    for (int corner = 0; corner < 4; ++corner) {
      const bool right = corner & 1, up = corner & 2;
      const double its = share(along_x, right) * share(along_y, up) * share(along_z, z > along_z.below);
      const std::size_t node = std::size_t(along_y.below + up) * grid.nodes + std::size_t(along_x.below + right);
      slab.weight[node] += its;
      for (std::size_t f = 0; f < values.size(); ++f) slab.values[f][node] += its * values[f][i];
    }
  }
  return slab;
}

// Cells of a cube of n an axis, and the means of each field once they are known. Gortler and others 1996: sums are
// pushed to ever wider cells, and means are pulled back.
struct Level {
  Level(int cells, std::size_t fields)
      : n(cells), sums(std::size_t(n) * n * n, fields), means(fields, std::vector<double>(sums.weight.size())) {}
  std::size_t at(int x, int y, int z) const { return (std::size_t(z) * n + y) * n + x; }

  // Adds a slab of cells half as wide, of which few hold a value.
  void push(const Sums& from, std::size_t first, int z) {
    for (int y = 0; y < 2 * n; ++y)
      for (int x = 0; x < 2 * n; ++x) {
        const std::size_t cell = first + std::size_t(y) * 2 * n + x, wider = at(x / 2, y / 2, z / 2);
        if (from.weight[cell] == 0) continue;
        sums.weight[wider] += from.weight[cell];
        for (std::size_t f = 0; f < means.size(); ++f) sums.values[f][wider] += from.values[f][cell];
      }
  }

  // Writes the means of a row of cells half as wide, from their own sums, of which `first` is the first, and from these
  // means, trilinear between the middles of cells: the middle of a finer cell lies three quarters towards one cell from
  // the next.
  void pull_row(const Sums& to, std::size_t first, std::size_t field, int y, int z, double* row_means) const {
    const auto beside = [&](int i) { return std::clamp(i / 2 + (i % 2 == 0 ? -1 : 1), 0, n - 1); };
    const auto between = [](double own, double next) { return own + (next - own) / 4; };
    const auto row = [&](int at_y, int at_z) { return means[field].data() + at(0, at_y, at_z); };
    const double *here = row(y / 2, z / 2), *next_z = row(y / 2, beside(z)), *next_y = row(beside(y), z / 2),
                 *next_yz = row(beside(y), beside(z));
    double wide[kMostNodes];
    for (int x = 0; x < n; ++x) wide[x] = between(between(here[x], next_z[x]), between(next_y[x], next_yz[x]));
    const double *const value = to.values[field].data() + first, *const weight = to.weight.data() + first;
    for (int x = 0; x < 2 * n; ++x) row_means[x] = (value[x] + between(wide[x / 2], wide[beside(x)])) / (weight[x] + 1);
  }

  void pull(Level& fine) const {
    for (std::size_t f = 0; f < means.size(); ++f)
      for (int z = 0; z < fine.n; ++z)
        for (int y = 0; y < fine.n; ++y)
          pull_row(fine.sums, fine.at(0, y, z), f, y, z, &fine.means[f][fine.at(0, y, z)]);
  }

  int n;
  Sums sums;
  Fields means;
};

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

std::vector<NodeLevels> levels_between(const std::vector<Point>& places,
                                       const std::vector<std::vector<double>>& log_levels, const ForEach& for_each) {
  const std::size_t fields = log_levels.size();
  std::vector<NodeLevels> results(fields, grid_around(places, for_each));
  const point::NodeField grid = field_of(&results.front());
  const std::size_t nodes = std::size_t(grid.nodes), size = nodes * nodes;  // of a slab
  // The nodes themselves are summed twice, slab by slab, since so many at once are new to each cache.
  std::vector<Level> levels;  // the finest first
  for (int n = grid.nodes / 2; n > 0; n /= 2) levels.emplace_back(n, fields);
  const auto in_slabs = places_of_slabs(places, grid);
  const auto slab = [&](std::size_t z) { return slab_of(in_slabs[z], places, log_levels, grid, int(z)); };
  for_each(nodes / 2, [&](std::size_t pair) {
    for (std::size_t z = 2 * pair; z < 2 * pair + 2; ++z) levels[0].push(slab(z), 0, int(z));
  });
  for (std::size_t level = 1; level < levels.size(); ++level)
    for (int z = 0; z < levels[level - 1].n; ++z)
      levels[level].push(levels[level - 1].sums, levels[level - 1].at(0, 0, z), z);
  Level& whole = levels.back();
  for (std::size_t f = 0; f < fields; ++f) whole.means[f][0] = whole.sums.values[f][0] / whole.sums.weight[0];
  for (std::size_t level = levels.size() - 1; level > 0; --level) levels[level].pull(levels[level - 1]);
  for (NodeLevels& result : results) result.levels.resize(size * nodes);
  for_each(nodes, [&](std::size_t z) {
    const Sums sums = slab(z);
    double means[kMostNodes];
    for (std::size_t f = 0; f < fields; ++f)
      for (std::size_t y = 0; y < nodes; ++y) {
        levels[0].pull_row(sums, y * nodes, f, int(y), int(z), means);
        sample_fits().exponentials(means, nodes, &results[f].levels[z * size + y * nodes]);
      }
  });
  return results;
}

}  // namespace pointfair
