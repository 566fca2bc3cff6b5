// SPDX-License-Identifier: Apache-2.0
#include "cpu/sort.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "cpu/parallel.h"

namespace pointfair::cpu {
namespace {

constexpr int kDigitBits = 10, kDigits = 3;  // of a 30-bit key
constexpr std::size_t kBuckets = std::size_t(1) << kDigitBits;
constexpr std::size_t kSmall = 160;                       // below, comparison sorting wins
constexpr std::size_t kCacheable = std::size_t(1) << 19;  // elements of a run that one thread sorts in its caches
constexpr std::size_t kAlone = std::size_t(1) << 15;      // the same where others have nothing to do meanwhile
constexpr std::size_t kSortBlock = std::size_t(1) << 13;

using Elements = std::span<std::uint64_t>;
using Histogram = std::array<std::uint32_t, kBuckets>;

std::size_t digit_of(std::uint64_t element, int digit) {
  return std::size_t(element >> (32 + digit * kDigitBits)) & (kBuckets - 1);
}

bool same_cell(std::uint64_t a, std::uint64_t b) { return a >> 32 == b >> 32; }

// Calls visit(first, last) for each stretch of at least `least` elements in one cell.
template <class Visit>
void for_cells(Elements run, std::size_t least, Visit visit) {
  for (std::size_t first = 0; first + least <= run.size(); ++first) {
    if (!same_cell(run[first], run[first + least - 1])) continue;
    std::size_t last = first + least;
    while (last < run.size() && same_cell(run[first], run[last])) ++last;
    visit(first, last);
    first = last - 1;
  }
}

// Sorts keyed elements by their keys, and leaves cells of equal keys to `order_cells(run, scratch)`.
template <class OrderCells>
class KeySorter {
 public:
  KeySorter(const std::stop_token& stop, OrderCells order_cells) : stop_(stop), order_cells_(order_cells) {}

  void sort(Elements run, Elements scratch) const { sort_keyed(run, scratch, kDigits - 1); }

 private:
  // Sorts by digits `digit` to 0; those above agree throughout the run.
  void sort_keyed(Elements run, Elements scratch, int digit) const {
    if (run.size() <= alone_ || digit == 0) {
      sort_in_cache(run, scratch, digit);
      order_cells_(run, scratch);
      return;
    }
    const std::vector<std::size_t> ends = partition(run, scratch, digit);
    tbb::parallel_for(std::size_t(0), kBuckets, [&](std::size_t bucket) {
      throw_if_stopped(stop_);
      const std::size_t first = bucket == 0 ? 0 : ends[bucket - 1], size = ends[bucket] - first;
      if (size == 0) return;
      std::copy_n(scratch.begin() + first, size, run.begin() + first);
      sort_keyed(run.subspan(first, size), scratch.subspan(first, size), digit - 1);
    });
  }

  // Stable, into scratch; returns where each bucket ends.
  std::vector<std::size_t> partition(Elements run, Elements scratch, int digit) const {
    const std::size_t block_size = std::max(kSortBlock, run.size() / 64 + 1);
    std::vector<Histogram> next((run.size() + block_size - 1) / block_size);
    for_blocks(run.size(), block_size, stop_, [&](std::size_t first, std::size_t last, std::size_t block) {
      next[block].fill(0);
      for (std::size_t i = first; i < last; ++i) ++next[block][digit_of(run[i], digit)];
    });
    Histogram counts{};
    for (Histogram& histogram : next)  // row by row, since columns of all blocks lie in one set of a cache
      for (std::size_t bucket = 0; bucket < kBuckets; ++bucket)
        counts[bucket] += std::exchange(histogram[bucket], counts[bucket]);
    std::vector<std::size_t> ends(kBuckets);
    Histogram begins;
    std::size_t total = 0;
    for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
      begins[bucket] = std::uint32_t(total);
      ends[bucket] = total += counts[bucket];
    }
    for (Histogram& histogram : next)
      for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) histogram[bucket] += begins[bucket];
    for_blocks(run.size(), block_size, stop_, [&](std::size_t first, std::size_t last, std::size_t block) {
      for (std::size_t i = first; i < last; ++i) scratch[next[block][digit_of(run[i], digit)]++] = run[i];
    });
    return ends;
  }

  static void sort_in_cache(Elements run, Elements scratch, int digit) {
    if (run.size() <= kSmall) {
      std::ranges::sort(run);
      return;
    }
    Elements from = run, to = scratch;
    for (int d = 0; d <= digit; ++d) {
      Histogram next{};
      for (const std::uint64_t element : from) ++next[digit_of(element, d)];
      std::uint32_t total = 0;
      for (std::uint32_t& count : next) total += std::exchange(count, total);
      for (const std::uint64_t element : from) to[next[digit_of(element, d)]++] = element;
      std::swap(from, to);
    }
    if (from.data() != run.data()) std::ranges::copy(from, run.begin());
  }

  const std::stop_token& stop_;
  OrderCells order_cells_;
  std::size_t alone_ = tbb::this_task_arena::max_concurrency() > 1 ? kAlone : kCacheable;
};

class CurveSorter {
 public:
  CurveSorter(std::span<const Point> points, const Kernels& kernels, const std::stop_token& stop)
      : points_(points), kernels_(kernels), stop_(stop) {}

  // Keys the run within `box` and sorts it; scratch is of the same size.
  void sort(Elements run, Elements scratch, const Box& box) const {
    const float extent = std::max({box.max_x - box.min_x, box.max_y - box.min_y, box.max_z - box.min_z});
    const float scale = float(kBuckets) / extent;
    if (!(extent > 0) || !std::isfinite(scale)) {  // identical points, or as good as that
      std::ranges::sort(run, [](auto a, auto b) { return std::uint32_t(a) < std::uint32_t(b); });
      return;
    }
    for_blocks(run.size(), kSortBlock, stop_, [&](std::size_t first, std::size_t last, std::size_t) {
      kernels_.hilbert_keys(&points_[0].x, run.data() + first, last - first, box.min_x, box.min_y, box.min_z, scale);
    });
    KeySorter(stop_, [this](Elements part, Elements its_scratch) {
      refine_cells(part, its_scratch);
    }).sort(run, scratch);
  }

 private:
  // Gives every cell of more than a leaf of points a finer curve.
  void refine_cells(Elements run, Elements scratch) const {
    for_cells(run, kLeafSize + 1, [&](std::size_t first, std::size_t last) {
      const Elements cell = run.subspan(first, last - first);
      sort(cell, scratch.subspan(first, last - first), box_of(cell));
    });
  }

  Box box_of(Elements run) const {
    constexpr float inf = std::numeric_limits<float>::infinity();
    Box box{inf, inf, inf, -inf, -inf, -inf};
    for (const std::uint64_t element : run) {
      const Point p = points_[std::uint32_t(element)];
      box = {std::min(box.min_x, p.x), std::min(box.min_y, p.y), std::min(box.min_z, p.z),
             std::max(box.max_x, p.x), std::max(box.max_y, p.y), std::max(box.max_z, p.z)};
    }
    return box;
  }

  std::span<const Point> points_;
  const Kernels& kernels_;
  const std::stop_token& stop_;
};

// Sorts by both digits of the curve of src/point/curve.h, then by position.
class CubeSorter {
 public:
  CubeSorter(std::span<const Point> points, const point::CurveCube& cube, const Kernels& kernels,
             const std::stop_token& stop)
      : points_(points), cube_(cube), kernels_(kernels), stop_(stop) {}

  void sort(Elements elements, Elements scratch) const {
    for_blocks(elements.size(), kSortBlock, stop_, [&](std::size_t first, std::size_t last, std::size_t) {
      kernels_.curve_keys(&points_[0].x, elements.data() + first, last - first, cube_, false);
    });
    KeySorter(stop_, [this](Elements run, Elements its_scratch) {
      order_cells(run, its_scratch);
    }).sort(elements, scratch);
  }

 private:
  // The second digits of all points that share a cell are made at once, since most cells hold two or three.
  void order_cells(Elements run, Elements scratch) const {
    std::size_t shared = 0;
    for_cells(run, 2, [&](std::size_t first, std::size_t last) {
      std::copy(run.begin() + first, run.begin() + last, scratch.begin() + shared);
      shared += last - first;
    });
    kernels_.curve_keys(&points_[0].x, scratch.data(), shared, cube_, true);
    std::size_t next = 0;
    for_cells(run, 2, [&](std::size_t first, std::size_t last) {
      const Elements cell = scratch.subspan(next, last - first);
      next += cell.size();
      std::ranges::sort(cell);
      for_cells(cell, 2, [&](std::size_t tied, std::size_t end) { order_by_position(cell.subspan(tied, end - tied)); });
      // the key stays that of the first digit, which tells cells apart
      for (std::size_t i = 0; i < cell.size(); ++i)
        run[first + i] = (run[first + i] >> 32 << 32) | std::uint32_t(cell[i]);
    });
  }
  // Of identical points there may be many: they are in order as they are.
  void order_by_position(Elements run) const {
    const auto before = [this](std::uint64_t a, std::uint64_t b) {
      return point::lies_before(position_of(a), position_of(b));
    };
    if (!std::ranges::is_sorted(run, before)) std::ranges::stable_sort(run, before);
  }
  point::Vec3<float> position_of(std::uint64_t element) const {
    const Point& p = points_[std::uint32_t(element)];
    return {p.x, p.y, p.z};
  }

  std::span<const Point> points_;
  point::CurveCube cube_;
  const Kernels& kernels_;
  const std::stop_token& stop_;
};

}  // namespace

void sort_along_curve(std::span<const Point> points, std::span<std::uint64_t> elements,
                      std::span<std::uint64_t> scratch, const Box& core, const Kernels& kernels,
                      const std::stop_token& stop) {
  CurveSorter(points, kernels, stop).sort(elements, scratch, core);
}

void sort_along_curve(std::span<const Point> points, std::span<std::uint64_t> elements,
                      std::span<std::uint64_t> scratch, const point::CurveCube& cube, const Kernels& kernels,
                      const std::stop_token& stop) {
  CubeSorter(points, cube, kernels, stop).sort(elements, scratch);
}

}  // namespace pointfair::cpu
