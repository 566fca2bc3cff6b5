// SPDX-License-Identifier: Apache-2.0
// Copies that a device makes while it computes.
#pragma once

#include <span>

#include "pointfair/cloud.hpp"
#include "seam/backend.hpp"

namespace pointfair {

class Overlap {
 public:
  virtual ~Overlap() = default;
  // As Backend::upload, but `points` must stay as they are until finish_upload(), and stages may be called before. The
  // costs then tell how long it took.
  virtual void start_upload(std::span<const Point> points, IndexOrder expected) = 0;
  virtual void finish_upload() = 0;
};

}  // namespace pointfair
