// SPDX-License-Identifier: Apache-2.0
// The net of method learned over a cloud on the card (src/point/net.h): an index of where the stages put its points,
// lists of neighbours in four scales, and the layers. Gives the bits of src/cpu/refinement.cpp.
// Memory, bytes a point, while it runs: index 21, lists 256, places 56, states 48 and 96, sizes 16, sides and steps 24,
// coarse points 12.
#pragma once

#include <stop_token>

#include "cuda/index/index.cuh"
#include "cuda/net/coarse.cuh"
#include "cuda/net/net_cloud.cuh"
#include "seam/net_weights.hpp"

namespace pointfair::cuda {

// A row for each point, in upload order, on the card.
struct RefinedCloud {
  const Point *measured, *classical, *normals;
  const float* noise;
  const std::uint8_t* held;
  std::size_t count;
};

class Refiner {
 public:
  explicit Refiner(Context& context);

  // As pointfair::refine of src/seam/refinement.hpp; `out`, which may be `cloud.classical`, is on the card. Starts the
  // last of the work; waits for some of it.
  void run(const RefinedCloud& cloud, const NetWeights& weights, const Frame& frame, Point* out,
           const std::stop_token& stop);

 private:
  void find_lists(const ScaleCounts& counts, const Frame& frame, const std::stop_token& stop);
  void find_nearest(Index* list);
  NetCloud make_room(const RefinedCloud& cloud);
  net::Weights upload(const NetWeights& weights);
  // The host is one step ahead of the card where a stop may come.
  void pace(const std::stop_token& stop);

  Context& context_;
  DeviceIndex index_;
  DeviceArray<std::int8_t> weights_;
  DeviceArray<int> biases_;
  DeviceArray<Index> lists_[net::kScales];
  const Index* lists_of_[net::kScales] = {};
  DeviceArray<float4> classical_, given_normal_, normal_;
  DeviceArray<float2> measured_;
  DeviceArray<Vec> side_, step_;
  DeviceArray<float> size_;
  DeviceArray<unsigned> state_;
  DeviceArray<uint2> stored_;
};

}  // namespace pointfair::cuda
