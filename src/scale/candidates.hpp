// SPDX-License-Identifier: Apache-2.0
// Candidates for the sample of a cloud that is read from the disk.
#pragma once

#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "seam/cloud_sample.hpp"

namespace pointfair::scale {

/// Takes with what is asked for also what would be asked for next, so that the cloud is not read again where many of
/// its points share cells. The more points a cloud has, the more do.
class CandidatesAhead {
 public:
  /// Calls its argument for all points, some at a time.
  using ForAll = std::function<void(const std::function<void(std::span<const Point>)>&)>;

  CandidatesAhead(const Bounds& bounds, ForAll for_all, ForEach for_each)
      : bounds_(bounds), for_all_(std::move(for_all)), for_each_(std::move(for_each)) {}
  std::vector<SampleCandidate> collect(Candidates wanted);

 private:
  struct Held {
    Candidates asked;
    std::vector<SampleCandidate> found;
  };
  void add(std::span<const Point> points, Held& held) const;

  const Bounds bounds_;
  const ForAll for_all_;
  const ForEach for_each_;
  std::vector<Held> held_;
};

}  // namespace pointfair::scale
