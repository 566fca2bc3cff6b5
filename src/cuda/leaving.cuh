// SPDX-License-Identifier: Apache-2.0
// Points on their way out of a chain: held back where they moved too far, and copied to the host.
#pragma once

#include <span>

#include "cuda/chain.cuh"
#include "cuda/runtime/transfer.cuh"
#include "cuda/stages/outliers.cuh"

namespace pointfair::cuda {

class Leaving {
 public:
  Leaving(Context& context, Staging& staging) : context_(context), staging_(staging), side_(context) {}

  // To be called before a result leaves.
  void begin() { *held_back_.get() = {}; }
  // Whether points may not leave as they were faired: some move too far, or an iteration before turned them into NaN.
  static bool holds_back(int iteration, const DisplacementLimits& limits) {
    return limits.farthest > 0 || iteration > 0;
  }
  // Starts to write all points within their limits (point::limited). held_back() and `outliers` are valid once the
  // context's stream is done. `marks`, unless null, gets the same as `outliers` on the card.
  void hold_back(const DeviceArray<Point>& uploaded, Chain& from, const DisplacementLimits& limits,
                 std::span<std::uint8_t> outliers, DeviceArray<Point>& out, std::uint8_t* marks = nullptr);
  // Starts to limit the way of points that are no outliers.
  void limit(const DeviceArray<Point>& uploaded, Chain& from, const DisplacementLimits& limits,
             DeviceArray<Point>& points);
  OutlierCounts held_back() const {
    const auto& of_reason = held_back_.get()->of_reason;
    return {of_reason[0], of_reason[1], of_reason[2]};
  }

  // Start to copy. Parts that are faired before all leave at once.
  void copy_faired(Chain& from, std::span<Point> to);
  void copy(const Point* from, std::span<Point> to) const;

 private:
  Context& context_;
  Staging& staging_;
  SideStream side_;
  Pinned<OutlierTotals> held_back_;
};

}  // namespace pointfair::cuda
