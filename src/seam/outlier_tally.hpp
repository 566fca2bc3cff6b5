// SPDX-License-Identifier: Apache-2.0
// Outliers counted by reason, by many threads.
#pragma once

#include <atomic>
#include <cstdint>

#include "point/outliers.h"
#include "pointfair/report.hpp"

namespace pointfair {

inline void count(point::Outlier outlier, OutlierCounts& counts) {
  counts.isolated += outlier == point::Outlier::isolated;
  counts.off_surface += outlier == point::Outlier::off_surface;
  counts.mixed_pixels += outlier == point::Outlier::mixed_pixel;
}

inline void add(OutlierCounts& counts, const OutlierCounts& more) {
  counts.isolated += more.isolated;
  counts.off_surface += more.off_surface;
  counts.mixed_pixels += more.mixed_pixels;
}

class OutlierTally {
 public:
  void add(const OutlierCounts& some) {
    isolated_.fetch_add(some.isolated, std::memory_order_relaxed);
    off_surface_.fetch_add(some.off_surface, std::memory_order_relaxed);
    mixed_pixels_.fetch_add(some.mixed_pixels, std::memory_order_relaxed);
  }
  OutlierCounts counts() const { return {isolated_, off_surface_, mixed_pixels_}; }

 private:
  std::atomic<std::uint64_t> isolated_{0}, off_surface_{0}, mixed_pixels_{0};
};

}  // namespace pointfair
