// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "estimate/constants.hpp"
#include "pointfair/cloud.hpp"

namespace pointfair {

// Rows of samples and their nearest other points, as Sampling::sample_neighborhoods has them. Readers look at a few
// samples first, and at more where these show something.
class NearestRows {
 public:
  // Returns the rows of the first `samples` samples, `neighbors` + 1 points each.
  using Ask = std::function<std::vector<Point>(std::size_t samples, int neighbors)>;

  NearestRows(std::size_t samples, Ask ask) : samples_(samples), ask_(std::move(ask)) {}

  std::size_t samples() const { return samples_; }
  std::size_t looked_at() const { return std::min(samples_, constants::kLookedAt); }
  std::vector<Point> of(std::size_t samples, int neighbors) const { return ask_(samples, neighbors); }
  // The rows of eight nearest points of the samples that are looked at first, asked for once.
  const std::vector<Point>& heads() {
    if (heads_.empty()) heads_ = ask_(looked_at(), constants::kStepNeighbors);
    return heads_;
  }

 private:
  std::size_t samples_;
  Ask ask_;
  std::vector<Point> heads_;
};

}  // namespace pointfair
