// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "estimate/constants.hpp"
#include "pointfair/cloud.hpp"
#include "seam/sampling.hpp"

namespace pointfair {

// Rows of samples and their nearest other points, as Sampling::sample_neighborhoods has them. Readers look at a few
// samples first, and at more where these show something.
class NearestRows {
 public:
  // Returns the rows of the first `samples` samples, `neighbors` + 1 points each.
  using Ask = std::function<std::vector<Point>(std::size_t samples, int neighbors)>;

  // `near`: rows of the first samples that are known; the others are asked for.
  NearestRows(std::size_t samples, NearRows near, Ask ask)
      : samples_(samples), near_(std::move(near)), ask_(std::move(ask)) {
    heads_ = of(looked_at(), constants::kStepNeighbors);
  }

  std::size_t samples() const { return samples_; }
  std::size_t looked_at() const { return std::min(samples_, constants::kLookedAt); }
  std::vector<Point> of(std::size_t samples, int neighbors) const {
    const std::size_t row = std::size_t(neighbors) + 1, known = std::size_t(near_.neighbors) + 1;
    if (row > known || samples * known > near_.points.size()) return ask_(samples, neighbors);
    std::vector<Point> rows(samples * row);
    for (std::size_t i = 0; i < samples; ++i) std::copy_n(&near_.points[i * known], row, &rows[i * row]);
    return rows;
  }
  // The rows of eight nearest points of the samples that are looked at first.
  const std::vector<Point>& heads() const { return heads_; }

 private:
  std::size_t samples_;
  NearRows near_;
  Ask ask_;
  std::vector<Point> heads_;
};

}  // namespace pointfair
