// SPDX-License-Identifier: Apache-2.0
// The order of the tree's leaves: keys of points along a space-filling curve, and sorting by them.
#pragma once

#include <concepts>
#include <cstdint>

#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "point/curve.h"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

using CoarseKey = std::uint32_t;

// Indices of points in the order of their keys, and these keys if they are to be refined.
struct Sorted {
  explicit Sorted(Context& context) : order(context), coarse(context) {}
  DeviceArray<Index> order;
  DeviceArray<CoarseKey> coarse;
};

inline constexpr int kCurveBits = 2 * point::kDigitBits;  // kBits for the curve of src/point/curve.h

// One bit more for the curve of src/point/curve.h, whose order must be exact: there invalid points have a bit of their
// own.
template <int kBits>
inline constexpr int kKeyBits = 3 * kBits + (kBits == kCurveBits ? 1 : 0);

// A cloud of fewer points is sorted by all bits of its keys but the lowest kRefinedBits, in three passes instead of
// four: on a surface the cells of 2^8 steps an axis then hold fewer points than a leaf. Where one holds more, the
// points are sorted by the other bits, those of a group of leaves at a time (gather_points()).
inline constexpr std::size_t kFewPoints = 1 << 21;
inline constexpr int kRefinedBits = 6;

// Of invalid points; no valid one has it.
template <class Key, int kBits>
inline constexpr Key kInvalid = (Key(1) << kKeyBits<kBits>)-1;

// Lays the key's cube, of `steps` an axis, over most points: between the 2 % and the 98 % quantile of a sample on each
// axis, widened by the longest side, and no wider than the sample itself. A stray point far away does not stretch it;
// points outside are clamped for the key only. `fresh`, if not null, is made that of an empty cloud.
void lay_grid(Context& context, const Point* points, std::size_t count, float steps, KeyGrid* grid, CloudState* fresh);

// The cube of the curve of src/point/curve.h, and `fresh` that of an empty cloud.
void lay_grid(Context& context, point::CurveCube cube, CloudState* fresh);

// Two places for the keys and indices of a cloud or one of its parts, and sorting there. Keys of kBits an axis: 10 in
// 32 bits, 13 or kCurveBits in 64.
template <class Key, int kBits>
class KeySort {
 public:
  // Room for `count` points.
  KeySort(Context& context, const Point* points, std::size_t count, CloudState* state);

  void reserve(std::size_t count);  // all memory that sort(count) takes
  // Of points [begin, end), as upload order has them. Bounds and number of valid points are added to the state.
  void find_keys(std::size_t begin, std::size_t end, const KeyGrid* grid);
  // The first `count` by their keys, but for the lowest bits; equal ones as uploaded, or where there are many along a
  // curve of their own (dense_cells.cuh).
  void sort(std::size_t count, int lowest_bit = 0);

  const Index* order() const { return order_[place_].data(); }
  const Key* keys() const { return keys_[place_].data(); }
  void take(Sorted& sorted) { sorted.order.swap(order_[place_]); }
  // With points of one cell by position (curve_cells.cuh).
  void take_ordered(std::size_t count, Sorted& sorted)
    requires(kBits == kCurveBits);
  void take_coarse(Sorted& sorted)
    requires std::same_as<Key, CoarseKey>
  {
    take(sorted);
    sorted.coarse.swap(keys_[place_]);
  }

 private:
  void call_sort(std::size_t count, int lowest_bit, void* scratch, std::size_t& bytes);

  Context& context_;
  const Point* points_;
  CloudState* state_;
  int place_ = 0;  // which of two holds what sort() made
  DeviceArray<Key> keys_[2];
  DeviceArray<Index> order_[2];
  DeviceArray<std::byte> scratch_;
};

extern template class KeySort<CoarseKey, 10>;
extern template class KeySort<std::uint64_t, 13>;
extern template class KeySort<std::uint64_t, kCurveBits>;

}  // namespace pointfair::cuda
