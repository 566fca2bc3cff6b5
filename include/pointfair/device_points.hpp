// SPDX-License-Identifier: Apache-2.0
// Positions in the memory of a card, for calls that copy nothing through the host.
#pragma once

#include <cstddef>

#include "pointfair/cloud.hpp"

namespace pointfair {

/// A stream of a card, the pointer that the runtime and the driver of CUDA both give, which orders a call with the
/// caller's own work. Null is the card's default stream.
struct DeviceStream {
  void* handle = nullptr;
};

/// The coordinates x, y, z of points in the memory of a card, which the caller owns.
template <class Memory>
struct PointsOnCard {
  Memory* data = nullptr;                 ///< x of the first point
  std::size_t count = 0;                  ///< points
  std::ptrdiff_t row_stride = 3;          ///< from one point to the next, in scalars
  std::ptrdiff_t column_stride = 1;       ///< from x to y and from y to z, in scalars
  ScalarType type = ScalarType::float32;  ///< or float64
  int card = 0;                           ///< that holds the memory, as Device::index counts them
};

/// Positions that are read.
using DevicePoints = PointsOnCard<const void>;
/// Positions that are written. No two coordinates share an address.
using DeviceOutput = PointsOnCard<void>;

}  // namespace pointfair
