// SPDX-License-Identifier: Apache-2.0
// The net of method learned over a cloud on the card (src/point/net.h): an index of where the stages put its points,
// lists of neighbours in four scales, and the layers. Gives the bits of src/cpu/refinement.cpp.
// Memory, bytes a point, while it runs: index 21, lists 64 each, of which kHeldLists are kept and others found again,
// places 40, states 48 and 96, sizes 16, sides and steps 24; before the first state 112 in place of the 96.
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
  std::size_t count;
};

class Refiner {
 public:
  explicit Refiner(Context& context);

  // Reads all that it needs of `cloud`. Only starts the work.
  void take(const RefinedCloud& cloud, const Frame& frame);
  // Puts the points that move, in upload order, to `out`, as pointfair::refine of src/seam/refinement.hpp. `held`: 1
  // for each that keeps its place. Starts the last of the work; waits for some of it.
  void run(const NetWeights& weights, const std::uint8_t* held, Point* out, const std::stop_token& stop);

 private:
  // Layers go from fine scales to coarse ones and back: with three, two lists of six are found twice.
  static constexpr int kHeldLists = 3;
  struct HeldList {
    explicit HeldList(Context& context) : list(context) {}
    DeviceArray<Index> list;
    int scale = -1;
    int used = 0;
  };

  void begin(const net::Weights& weights, const std::stop_token& stop);
  void slide_apart();
  const Index* list_of(int scale);
  void find_list(int scale, Index* list);
  void find_nearest(Index* list);
  NetCloud view() const;
  net::Weights upload(const NetWeights& weights);
  // The host is one step ahead of the card where a stop may come.
  void pace(const std::stop_token& stop);

  Context& context_;
  Frame frame_;
  DeviceIndex index_;
  ScaleCounts counts_{};
  HeldList lists_[kHeldLists];
  int lists_used_ = 0;
  DeviceArray<std::int8_t> weights_;
  DeviceArray<int> biases_;
  DeviceArray<float4> classical_, given_normal_, normal_;
  DeviceArray<float2> measured_;
  DeviceArray<Vec> side_, step_;
  DeviceArray<float> size_;
  DeviceArray<net::Scale> scale_;
  DeviceArray<unsigned> state_, next_;
};

}  // namespace pointfair::cuda
