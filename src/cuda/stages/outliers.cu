// SPDX-License-Identifier: Apache-2.0
#include "cuda/index/tree.cuh"
#include "cuda/stages/outliers.cuh"
#include "point/outliers.h"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256;

__global__ void __launch_bounds__(kBlock)
    limit_points(HeldBack points, Point* out, std::uint8_t* outliers, OutlierTotals* totals) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  point::Outlier outlier = point::Outlier::none;
  if (i < points.count) {
    const Point before = points.before[i], after = points.after[i];
    if (point::is_indexable(before)) {
      const point::Vec3<float> from = {before.x, before.y, before.z};
      const float level = point::node_value(points.field, from);
      const point::Limited limited = point::limited(from, {after.x, after.y, after.z}, points.limits, level);
      out[i] = {limited.place.x, limited.place.y, limited.place.z};
      outlier = limited.outlier;
    } else {
      out[i] = before;
    }
    if (outliers != nullptr) outliers[i] = static_cast<std::uint8_t>(outlier);
  }
  if (!__syncthreads_or(outlier != point::Outlier::none)) return;
  for (int reason = 0; reason < point::kOutlierReasons; ++reason) {
    const int found =
        __syncthreads_count(outlier != point::Outlier::none && point::place_among_reasons(outlier) == reason);
    if (threadIdx.x == 0 && found > 0) atomicAdd(&totals->of_reason[reason], static_cast<unsigned long long>(found));
  }
}

}  // namespace

void hold_back(Context& context, HeldBack points, Point* out, std::uint8_t* outliers, OutlierTotals* totals) {
  if (points.count == 0) return;
  launch(context, "holding back outliers", limit_points, blocks_for(points.count, kBlock), kBlock, points, out,
         outliers, totals);
}

}  // namespace pointfair::cuda
