// SPDX-License-Identifier: Apache-2.0
// Holds back points that moved far (src/point/outliers.h).
#pragma once

#include "cuda/runtime/memory.cuh"
#include "point/node_field.h"
#include "point/outliers.h"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

struct HeldBack {
  const Point *before, *after;  // in upload order
  std::size_t count;
  point::DisplacementLimits limits;
  point::NodeField field;  // nodes on the card
};

struct OutlierTotals {
  unsigned long long of_reason[point::kOutlierReasons];
};

// Positions within the limits into `out`, which may be `after`; 1 or 0 for each point into `outliers` unless it is
// null; adds the outliers to *totals. Invalid points stay as they are and are none.
void hold_back(Context& context, HeldBack points, Point* out, std::uint8_t* outliers, OutlierTotals* totals);

}  // namespace pointfair::cuda
