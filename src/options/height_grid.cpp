// SPDX-License-Identifier: Apache-2.0
#include "options/height_grid.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace pointfair {
namespace {

using Cell = HeightGrid::Cell;

constexpr std::uint64_t kPointsOfCell = 16, kLeastCells = 4, kMostCells = std::uint64_t{1} << 19;
constexpr std::size_t kFresh = std::size_t{1} << 16;
constexpr int kFinest = -20;    // the exponent of a micrometre, in metres
constexpr int kCoarsest = 128;  // holds all floats
constexpr double kUnits = 4294967296.0, kHighest = 2147483647.0;

auto place_of(const Cell& cell) { return std::tuple(cell.y, cell.x); }
bool is_before(const Cell& a, const Cell& b) { return place_of(a) < place_of(b); }

// Makes one cell of those at one place, which follow each other.
void unite(std::vector<Cell>& cells) {
  std::size_t last = 0;
  for (std::size_t i = 1; i < cells.size(); ++i) {
    if (place_of(cells[i]) != place_of(cells[last])) {
      cells[++last] = cells[i];
      continue;
    }
    cells[last].whole += cells[i].whole;
    cells[last].part += cells[i].part;
    cells[last].count += cells[i].count;
  }
  if (!cells.empty()) cells.resize(last + 1);
}

// Two cells beside each other become one. The order of rows is kept, and that within one.
void widen(std::vector<Cell>& cells) {
  for (Cell& cell : cells) {
    cell.x >>= 1;
    cell.y >>= 1;
  }
  std::ranges::sort(cells, is_before);
  unite(cells);
}

// Merges what is in order with what is in order behind it, from the back, in place.
void merge_into(std::vector<Cell>& cells, const std::vector<Cell>& more) {
  std::size_t old = cells.size(), fresh = more.size(), to = old + fresh;
  cells.resize(to);
  while (fresh > 0) cells[--to] = old > 0 && is_before(more[fresh - 1], cells[old - 1]) ? cells[--old] : more[--fresh];
  unite(cells);
}

double mean_of(const Cell& cell) { return (double(cell.whole) + double(cell.part) / kUnits) / double(cell.count); }

}  // namespace

HeightGrid::HeightGrid(std::uint64_t points)
    : most_cells_(static_cast<std::size_t>(std::clamp(points / kPointsOfCell, kLeastCells, kMostCells))),
      exponent_(kFinest) {}

HeightGrid::HeightGrid(int exponent, std::vector<Cell> cells) : exponent_(exponent), cells_(std::move(cells)) {
  make_larger();
}

bool HeightGrid::holds(const Point& point) const {
  const double far = std::ldexp(kHighest, exponent_);
  return std::abs(double{point.x}) < far && std::abs(double{point.y}) < far;
}

Cell HeightGrid::cell_of(const Point& point) const {
  const auto index = [&](float value) {
    return static_cast<std::int32_t>(std::floor(std::ldexp(double{value}, -exponent_)));
  };
  const double height = std::clamp(double{point.z}, -kHighest, kHighest), whole = std::floor(height);
  return {index(point.x), index(point.y), static_cast<std::int64_t>(whole),
          static_cast<std::uint64_t>((height - whole) * kUnits), 1};
}

void HeightGrid::add(const Point& point) {
  while (!holds(point)) {
    settle();
    coarsen();
  }
  fresh_.push_back(cell_of(point));
  if (fresh_.size() == kFresh) settle();
}

void HeightGrid::settle() {
  std::ranges::sort(fresh_, is_before);
  unite(fresh_);
  merge_into(cells_, fresh_);
  fresh_.clear();
  while (cells_.size() > most_cells_) coarsen();
}

void HeightGrid::coarsen() {
  widen(cells_);
  ++exponent_;
}

void HeightGrid::finish() {
  settle();
  make_larger();
}

void HeightGrid::make_larger() {
  larger_.clear();
  const std::vector<Cell>* last = &cells_;
  for (int exponent = exponent_; last->size() > 1 && exponent < kCoarsest; ++exponent) {
    std::vector<Cell> wider = *last;
    widen(wider);
    last = &larger_.emplace_back(std::move(wider));
  }
}

std::optional<double> HeightGrid::height_at(const Point& point) const {
  if (cells_.empty()) return std::nullopt;
  const auto find = [](const std::vector<Cell>& cells, const Cell& wanted) -> const Cell* {
    const auto its = std::ranges::lower_bound(cells, wanted, is_before);
    return its != cells.end() && place_of(*its) == place_of(wanted) ? &*its : nullptr;
  };
  if (holds(point)) {
    Cell wanted = cell_of(point);
    if (const Cell* const own = find(cells_, wanted)) return mean_of(*own);
    for (const std::vector<Cell>& cells : larger_) {
      wanted.x >>= 1;
      wanted.y >>= 1;
      if (const Cell* const wider = find(cells, wanted)) return mean_of(*wider);
    }
  }
  // beyond all of them: the mean of all
  Cell all;
  for (const Cell& cell : larger_.empty() ? cells_ : larger_.back()) {
    all.whole += cell.whole;
    all.part += cell.part;
    all.count += cell.count;
  }
  return mean_of(all);
}

}  // namespace pointfair
