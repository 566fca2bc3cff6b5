// SPDX-License-Identifier: Apache-2.0
#include "estimate/node_grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <utility>

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
  explicit Level(int cells) : n(cells), weight(std::size_t(n) * n * n), sum(weight.size()), mean(weight.size()) {}
  std::size_t at(int x, int y, int z) const { return (std::size_t(z) * n + y) * n + x; }
  void clear() {
    std::fill(weight.begin(), weight.end(), 0.0);
    std::fill(sum.begin(), sum.end(), 0.0);
  }
  int n;
  std::vector<double> weight, sum, mean;
};

// Memory that is kept for the next cloud: fresh memory costs more than what is computed in it.
template <class T>
class Kept {
 public:
  // Empty if none is kept.
  static std::vector<T> take() {
    const std::lock_guard lock(mutex());
    if (all().empty()) return {};
    std::vector<T> last = std::move(all().back());
    all().pop_back();
    return last;
  }
  static void give(std::vector<T> memory) {
    const std::lock_guard lock(mutex());
    if (all().size() < kMost) all().push_back(std::move(memory));
  }

 private:
  static constexpr std::size_t kMost = 512;
  // never destroyed, since clouds may outlive what is
  static std::mutex& mutex() {
    static auto& only = *new std::mutex;
    return only;
  }
  static std::vector<std::vector<T>>& all() {
    static auto& only = *new std::vector<std::vector<T>>;
    return only;
  }
};

// A megabyte of cells of all widths, the narrowest first.
class Levels {
 public:
  Levels() : levels_(Kept<Level>::take()) {
    if (levels_.empty())
      for (int n = kMostNodes; n > 0; n /= 2) levels_.emplace_back(n);
  }
  ~Levels() { Kept<Level>::give(std::move(levels_)); }
  Levels(const Levels&) = delete;
  Levels& operator=(const Levels&) = delete;
  Level& operator[](std::size_t level) { return levels_[level]; }
  std::size_t size() const { return levels_.size(); }

 private:
  std::vector<Level> levels_;
};

// Gortler and others 1996: sums are pushed to ever wider cells, and means are pulled back.
void push(const Level& from, Level& to) {
  const std::size_t row = std::size_t(from.n), slab = row * row;
  const std::size_t of_eight[] = {0, 1, row, row + 1, slab, slab + 1, slab + row, slab + row + 1};
  for (int z = 0; z < to.n; ++z)
    for (int y = 0; y < to.n; ++y)
      for (int x = 0; x < to.n; ++x) {
        const std::size_t first = from.at(2 * x, 2 * y, 2 * z), cell = to.at(x, y, z);
        double weight = 0, sum = 0;
        for (const std::size_t next : of_eight) {
          weight += from.weight[first + next];
          sum += from.sum[first + next];
        }
        to.weight[cell] = weight;
        to.sum[cell] = sum;
      }
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

// Of n cells, the one that a finer cell lies towards from its own.
std::size_t slab_beside(std::size_t fine, std::size_t n) {
  const std::size_t coarse = fine / 2;
  return fine % 2 == 0 ? (coarse == 0 ? 0 : coarse - 1) : std::min(coarse + 1, n - 1);
}

// Fewer are computed before other threads have begun.
constexpr std::size_t kSlabsWorthThreads = 16;

// The means of `fine` from its own sums and from the means of cells twice as wide, trilinear between their middles.
void pull(const Level& coarse, Level& fine, const ForEach& for_each) {
  const std::size_t n = std::size_t(coarse.n), m = 2 * n;
  const auto pull_slab = [&](std::size_t z) {
    std::array<double, kMostNodes * kMostNodes / 4> along_z;
    std::array<double, kMostNodes * kMostNodes / 2> along_y;
    const std::size_t here = z / 2 * n * n, beside = slab_beside(z, n) * n * n;
    for (std::size_t i = 0; i < n * n; ++i)
      along_z[i] = coarse.mean[here + i] + (coarse.mean[beside + i] - coarse.mean[here + i]) / 4;
    for (std::size_t x = 0; x < n; ++x) refine(int(n), &along_z[x], &along_y[x], n);
    for (std::size_t y = 0; y < m; ++y) {
      const std::size_t row = (z * m + y) * m;
      refine(int(n), &along_y[y * n], &fine.mean[row], 1);
      for (std::size_t cell = row; cell < row + m; ++cell)
        if (fine.weight[cell] > 0) fine.mean[cell] = (fine.sum[cell] + fine.mean[cell]) / (fine.weight[cell] + 1);
    }
  };
  if (m >= kSlabsWorthThreads)
    for_each(m, pull_slab);
  else
    for (std::size_t z = 0; z < m; ++z) pull_slab(z);
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

NodeLevels grid_around(const std::vector<Point>& places) {
  float low[3], widest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> values;
    for (const Point& p : places) values.push_back(axis == 0 ? p.x : axis == 1 ? p.y : p.z);
    const auto aside = std::ptrdiff_t(kAside * double(values.size()));
    const auto least = values.begin() + aside, most = values.end() - 1 - aside;
    std::nth_element(values.begin(), least, values.end());
    low[axis] = *least;
    std::nth_element(least, most, values.end());
    widest = std::max(widest, *most - low[axis]);
  }
  const int nodes = nodes_for(places.size());
  return {{}, nodes, {low[0], low[1], low[2]}, widest > 0 ? float(nodes - 1) / widest : 0};
}

}  // namespace

NodeLevels levels_between(const std::vector<Point>& places, const std::vector<double>& log_levels,
                          const ForEach& for_each) {
  NodeLevels result = grid_around(places);
  result.levels = Kept<float>::take();
  const point::NodeField field = field_of(&result);
  Levels levels;
  std::size_t finest = 0;
  while (levels[finest].n > result.nodes) ++finest;
  levels[finest].clear();
  for (std::size_t i = 0; i < places.size(); ++i) add(levels[finest], field, places[i], log_levels[i]);
  for (std::size_t level = finest + 1; level < levels.size(); ++level) push(levels[level - 1], levels[level]);
  Level& widest = levels[levels.size() - 1];
  widest.mean[0] = widest.sum[0] / widest.weight[0];
  for (std::size_t level = levels.size() - 1; level > finest; --level) pull(levels[level], levels[level - 1], for_each);
  const std::vector<double>& mean = levels[finest].mean;
  result.levels.resize(mean.size());
  for_each(std::size_t(result.nodes), [&](std::size_t z) {
    const std::size_t slab = mean.size() / std::size_t(result.nodes);
    for (std::size_t i = z * slab; i < (z + 1) * slab; ++i) result.levels[i] = float(portable::exp_within_700(mean[i]));
  });
  return result;
}

void keep_memory(std::vector<float> levels) { Kept<float>::give(std::move(levels)); }

}  // namespace pointfair
