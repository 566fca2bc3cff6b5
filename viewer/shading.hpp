// SPDX-License-Identifier: Apache-2.0
// The normals that a cloud is shaded with: of few neighbours, whatever the parameters are, so that what is rough looks
// rough. Memory: a second pipeline, on clouds of up to kMaxShaded points.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>

#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

/// A larger cloud is shaded with the normals of the run: a second pipeline would cost too much memory.
inline constexpr std::uint64_t kMaxShaded = 4'000'000;

class Shading {
 public:
  explicit Shading(std::function<Pipeline()> make_pipeline) : make_pipeline_(std::move(make_pipeline)) {}

  /// Fills `normals`, of as many points; a normal is 0 where there is none. Throws what Pipeline::run throws.
  void compute(std::span<const Point> points, std::span<Point> normals, std::stop_token stop);

  /// Gives its memory back.
  void reset() { pipeline_.reset(); }

 private:
  std::function<Pipeline()> make_pipeline_;
  std::optional<Pipeline> pipeline_;
};

}  // namespace pointfair::viewer
