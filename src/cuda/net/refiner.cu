// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdlib>

#include "cuda/net/layers.cuh"
#include "cuda/net/refiner.cuh"
#include "cuda/net/slides.cuh"
#include "cuda/search/search.cuh"
#include "point/neighbors.h"
#include "seam/stop.hpp"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256;
constexpr std::size_t kLargeCloud = 3'000'000;  // points; of fewer no step is long

// A thread for each place, which the stages may have brought several points to. They lie side by side in the order of
// the input, and count as the one that was measured first in the order of positions.
__global__ void __launch_bounds__(kBlock) gather_places(const __grid_constant__ Tree tree, RefinedCloud from,
                                                        float4* classical, float4* normal, float2* measured) {
  const Index at = blockIdx.x * kBlock + threadIdx.x, end = tree.leaves * kLeafSize;
  if (at >= end) return;
  const float4 p = tree.points[at];
  if (!is_present(p)) {
    classical[at] = {0, 0, 0, 1};
    normal[at] = {0, 0, 0, 0};
    measured[at] = {0, 0};
    return;
  }
  const auto is_here = [&](Index other) {
    const float4 q = tree.points[other];
    return q.x == p.x && q.y == p.y && q.z == p.z;
  };
  if (at > 0 && is_here(at - 1)) return;
  const auto measured_at = [&](Index original) {
    const Point m = from.measured[original];
    return point::Vec3<float>{m.x, m.y, m.z};
  };
  Index first = original_of(p), behind = at + 1;
  for (; behind < end && is_here(behind); ++behind) {
    const Index other = original_of(tree.points[behind]);
    if (point::lies_before(measured_at(other), measured_at(first))) first = other;
  }
  const Point m = from.measured[first], n = from.normals[first];
  for (Index i = at; i < behind; ++i) {
    const Vec here = position_of(tree.points[i]);  // zeros have signs
    classical[i] = {here.x, here.y, here.z, from.noise[first]};
    normal[i] = {n.x, n.y, n.z, m.x};
    measured[i] = {m.y, m.z};
  }
}

// Whether a sum over what a neighbour has may need more than the 16 bits that count of it.
bool may_clamp(const net::Layer& layer) {
  constexpr int kLargest = 127, kRoom = 32767 << net::kStoredShift;
  for (int channel = 0; channel < net::kChannels; ++channel) {
    int weights = 0;
    for (int input = 0; input < net::kChannels; ++input)
      weights += std::abs(layer.other[(input / 4 * net::kChannels + channel) * 4 + input % 4]);
    if (weights * kLargest >= kRoom) return true;
  }
  return false;
}

}  // namespace

Refiner::Refiner(Context& context)
    : context_(context),
      index_(context),
      lists_{HeldList(context), HeldList(context), HeldList(context)},
      weights_(context),
      biases_(context),
      classical_(context),
      given_normal_(context),
      normal_(context),
      measured_(context),
      side_(context),
      step_(context),
      size_(context),
      scale_(context),
      state_(context),
      next_(context) {}

void Refiner::take(const RefinedCloud& cloud, const Frame& frame) {
  if (cloud.count == 0) return;
  frame_ = frame;
  index_.build(cloud.classical, cloud.count, frame);
  const std::size_t places = index_.leaves() * kLeafSize;
  classical_.resize(places);
  given_normal_.resize(places);
  measured_.resize(places);
  launch(context_, "beginning the net", gather_places, blocks_for(places, kBlock), kBlock, index_.tree(), cloud,
         classical_.data(), given_normal_.data(), measured_.data());
}

void Refiner::run(const NetWeights& weights, const std::uint8_t* held, Point* out, const std::stop_token& stop) {
  if (index_.points() == 0) return;
  counts_ = count_scales(context_, index_.tree());
  if (counts_[0] <= Index{net::kNeighbors}) return;
  const net::Weights its = upload(weights);
  begin(its, stop);
  for (int layer = 0; layer < net::kLayers; ++layer) {
    const int scale = net::kPlan[layer];
    run_layer(context_, view(), its.layers[layer], scale, list_of(scale), may_clamp(weights.view().layers[layer]));
    state_.swap(next_);
    pace(stop);
  }
  end_net(context_, view(), its, index_.tree(), held, out);
}

void Refiner::begin(const net::Weights& weights, const std::stop_token& stop) {
  const std::size_t places = index_.leaves() * kLeafSize;
  side_.resize(places);
  step_.resize(places);
  slide_apart();
  size_.resize(net::kScales * places);
  scale_.resize(net::kScales * places);
  for (const int s :
       {3, 2, 0, 1}) {  // so that the lists of the first layers are there, and that of 0 is not found again
    measure_scale(context_, view(), s, list_of(s));
    pace(stop);
  }
  normal_.resize(places);
  next_.resize(places * net::kChannelWords);
  begin_net(context_, view(), weights);
  scale_.release();
  given_normal_.release();
  state_.swap(next_);
  next_.resize(places * net::kChannelWords);
}

void Refiner::slide_apart() {
  const NetCloud cloud = view();
  const Index* const list = list_of(0);
  begin_slides(context_, cloud);
  static_assert(net::kSlides % 2 == 0);
  for (int round = 0; round < net::kSlides; round += 2) {
    slide(context_, cloud, list, step_.data(), side_.data());
    slide(context_, cloud, list, side_.data(), step_.data());
  }
  end_slides(context_, cloud);
}

const Index* Refiner::list_of(int scale) {
  while (counts_[scale] <= Index{net::kNeighbors}) --scale;  // too few points: as the finer scale
  HeldList* oldest = lists_;
  for (HeldList& one : lists_) {
    if (one.used < oldest->used) oldest = &one;
    if (one.scale != scale) continue;
    one.used = ++lists_used_;
    return one.list.data();
  }
  oldest->list.resize(index_.leaves() * kLeafSize * net::kNeighbors);
  find_list(scale, oldest->list.data());
  oldest->scale = scale;
  oldest->used = ++lists_used_;
  return oldest->list.data();
}

void Refiner::find_list(int scale, Index* list) {
  if (scale == 0) return find_nearest(list);
  CoarsePoints coarse(context_);
  coarse.choose(index_.tree(), scale, counts_[scale], frame_);
  coarse.find_nearest(index_.tree(), list);
}

void Refiner::find_nearest(Index* list) {
  DeviceArray<HardLeaf> leaves(context_);
  DeviceArray<Index> queries(context_);
  leaves.resize(index_.leaves());
  queries.resize(index_.leaves() * kLeafSize);
  constexpr std::size_t kFirst = offsetof(CloudState, leaf_retries), kEnd = offsetof(CloudState, too_few_neighbors);
  check(cudaMemsetAsync(reinterpret_cast<std::byte*>(index_.state()) + kFirst, 0, kEnd - kFirst, context_.stream()),
        "clearing counts");
  cuda::find_nearest(context_, index_.tree(), index_.state(), {net::kNeighbors, __builtin_inff()}, list,
                     {leaves.data(), queries.data()}, {});
}

NetCloud Refiner::view() const {
  const std::size_t places = index_.leaves() * kLeafSize;
  NetCloud its{};
  its.places = static_cast<Index>(places);
  its.classical = classical_.data();
  its.given_normal = given_normal_.data();
  its.normal = normal_.data();
  its.measured = measured_.data();
  its.side = side_.data();
  its.step = step_.data();
  its.state = state_.data();
  its.next = next_.data();
  for (int s = 0; s < net::kScales; ++s) {
    its.size[s] = size_.data() + s * places;
    its.scale[s] = scale_.data() + s * places;
  }
  return its;
}

net::Weights Refiner::upload(const NetWeights& weights) {
  weights_.upload(weights.numbers(), "uploading weights");
  biases_.upload(weights.biases(), "uploading weights");
  return weights.view_over(weights_.data(), biases_.data());
}

void Refiner::pace(const std::stop_token& stop) {
  if (!stop.stop_possible()) return;
  if (index_.points() >= kLargeCloud) context_.finish();
  throw_if_stopped(stop);
}

}  // namespace pointfair::cuda
