// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "cuda/leaving.cuh"

namespace pointfair::cuda {

static constexpr float kInfinity = __builtin_inff();

void Leaving::hold_back(const DeviceArray<Point>& uploaded, Chain& from, const DisplacementLimits& limits,
                        std::span<std::uint8_t> outliers, DeviceArray<Point>& out, std::uint8_t* marks) {
  const bool limited = limits.farthest > 0;
  if (!limited) std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
  const std::span<std::uint8_t> marked = limited ? outliers : std::span<std::uint8_t>{};
  DeviceArray<std::uint8_t> own_marks(context_);
  DeviceArray<OutlierTotals> total(context_);
  out.resize(uploaded.size());
  if (marks == nullptr && !marked.empty()) {
    own_marks.resize(marked.size());
    marks = own_marks.data();
  }
  total.resize(1);
  total.clear("clearing a count");
  const DisplacementLimits its = limits.or_endless();
  cuda::hold_back(context_, {uploaded.data(), from.faired().data(), uploaded.size(), its, from.noise_field(its.levels)},
                  out.data(), marks, total.data());
  total.download({held_back_.get(), 1}, "reading a count");
  if (!marked.empty())
    check(cudaMemcpyAsync(marked.data(), marks, marked.size(), cudaMemcpyDeviceToHost, context_.stream()),
          "downloading outliers");
}

void Leaving::limit(const DeviceArray<Point>& uploaded, Chain& from, const DisplacementLimits& limits,
                    DeviceArray<Point>& points) {
  DisplacementLimits its = limits;
  its.outlier_distance = kInfinity;
  DeviceArray<OutlierTotals> none(context_);
  none.resize(1);
  cuda::hold_back(context_, {uploaded.data(), points.data(), points.size(), its, from.noise_field(its.levels)},
                  points.data(), nullptr, none.data());
}

void Leaving::copy_faired(Chain& chain, std::span<Point> to) {
  const Point* const from = chain.faired().data();
  std::size_t left = 0;
  for (const FairedPart& part : chain.faired_parts()) {
    side_.wait_for(part.done);
    const OnStream stream(context_, side_);
    copy(from + left, to.subspan(left, part.end - left));
    left = part.end;
  }
  chain.join();
  if (left < to.size()) copy(from + left, to.subspan(left));
  if (left > 0) side_.join();
}

void Leaving::copy(const Point* from, std::span<Point> to) const { staging_.download(from, to, context_.stream()); }

}  // namespace pointfair::cuda
