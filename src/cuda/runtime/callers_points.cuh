// SPDX-License-Identifier: Apache-2.0
// Between the caller's positions on the card and points relative to an origin, by the rules of positions in host memory
// (include/pointfair/positions.hpp). Memory: 12 or 24 bytes a point, unless they are floats whose origin is 0.
#pragma once

#include <array>
#include <vector>

#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/transfer.cuh"
#include "pointfair/device_points.hpp"

namespace pointfair::cuda {

using Position = std::array<double, 3>;

// What the sample of positions is made of; offers are counted beyond the room too.
struct PositionSampleState {
  unsigned long long least[3], most[3];  // of finite positions, ordered as numbers
  unsigned long long chosen;
};

// Throws Error(usage) unless the points lie on this card, and have a type that holds coordinates.
void require_on_card(const void* data, std::size_t count, ScalarType type, int card, int of_context);

class CallersPoints {
 public:
  explicit CallersPoints(Context& context);

  // Starts to write the points, relative to `origin`, to `to`, and keeps what give() needs of them.
  void take(const DevicePoints& from, const Position& origin, Point* to);
  // As if floats with the origin 0 had been taken.
  void forget();
  // Starts to write the taken positions, moved as from `before` to `after`, two arrays of points. Throws Error(usage)
  // if `to` has another type.
  void give(const Point* before, const Point* after, const DeviceOutput& to) const;
  // Starts to write what has no origin, as normals.
  void give_plain(const Point* from, const DeviceOutput& to) const;

  // 1 for each cloud whose origin is surely 0 (is_surely_small of src/io/origin_sample.cpp); cloud i has the points
  // ends[i - 1] to ends[i]. Waits.
  std::vector<std::uint8_t> surely_have_no_origin(const DevicePoints& from, const unsigned* ends, std::size_t clouds);

  // A sample of positions, as files draw it (src/io/source.cpp), in two calls: the sample does not wait for what the
  // context's stream gets between them, and what it gets there is launched first.
  void await_points();
  void start_sample(const DevicePoints& from);
  cudaEvent_t sampled() const { return sampled_.get(); }  // after the last look at the points
  // The sample; waits for nothing else.
  std::vector<Position> sample(const DevicePoints& from);

 private:
  Context& context_;
  SideStream side_;  // of the sample
  Position origin_{};
  ScalarType type_ = ScalarType::float32;
  DeviceArray<std::byte> own_;  // rows in their type; empty: the points themselves
  DeviceArray<PositionSampleState> state_;
  DeviceArray<Position> chosen_;
  Pinned<PositionSampleState> fetched_state_;
  Pinned<Position> fetched_;
  Event sampled_;
};

}  // namespace pointfair::cuda
