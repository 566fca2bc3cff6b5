// SPDX-License-Identifier: Apache-2.0
// The net of method learned over a cloud on the card (src/point/net.h): an index of where the stages put its points,
// lists of neighbours in four scales, and the layers. Gives the bits of src/cpu/refinement.cpp.
// Memory, bytes a point: index 21, coarse points 20, places 40, sides and steps 24, sizes 16, and states 96; in their
// place while points slide apart a list of 64, and a scale of 28 and states of 48 after it. Besides, lists of one part
// of the cloud, 8 bytes a point or 32 MiB, and of clouds that are one part those of all scales.
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
  // Neighbours in one scale of the points of some leaves.
  struct HeldList {
    explicit HeldList(Context& context) : list(context) {}
    DeviceArray<Index> list;
    int scale = -1;
    LeafRange leaves{};
    Index* data() { return list.data() - std::size_t(leaves.begin) * kLeafSize * net::kNeighbors; }
  };

  void begin(const net::Weights& weights, const std::stop_token& stop);
  void slide_apart();
  LeafRange all() const { return {0, static_cast<Index>(index_.leaves())}; }
  // Calls visit(part) for each part of the cloud of up to so many leaves.
  template <class Visit>
  void for_parts(Index leaves, const Visit& visit) const;
  // Valid until the next is asked for; if the cloud is one part, until the end.
  const Index* list_of(int scale, LeafRange part);
  void find_nearest(LeafRange part, Index* list);
  NetCloud view() const;
  net::Weights upload(const NetWeights& weights);
  // The host is one step ahead of the card where a stop may come.
  void pace(const std::stop_token& stop);

  Context& context_;
  Frame frame_;
  DeviceIndex index_;
  Index part_ = 0;  // leaves
  ScaleCounts counts_{};
  CoarsePoints coarse_[net::kScales - 1];
  HeldList lists_[net::kScales];
  DeviceArray<std::int8_t> weights_;
  DeviceArray<int> biases_;
  DeviceArray<float4> classical_, normal_;
  DeviceArray<float2> measured_;
  DeviceArray<Vec> side_, step_;
  DeviceArray<float> size_;
  DeviceArray<net::Scale> finest_, coarser_;  // scales of all points, and of those of a part
  DeviceArray<unsigned> state_, next_;
};

}  // namespace pointfair::cuda
