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
// Lists are found for so many leaves at a time, 32 MiB, and of large clouds for an eighth of all: between kernels the
// card waits for its last queries.
constexpr Index kLeastPart = 1 << 14, kMostParts = 8;

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
      coarse_{CoarsePoints(context), CoarsePoints(context), CoarsePoints(context)},
      lists_{HeldList(context), HeldList(context), HeldList(context), HeldList(context)},
      weights_(context),
      biases_(context),
      classical_(context),
      normal_(context),
      measured_(context),
      side_(context),
      step_(context),
      size_(context),
      finest_(context),
      coarser_(context),
      state_(context),
      next_(context) {}

void Refiner::take(const RefinedCloud& cloud, const Frame& frame) {
  if (cloud.count == 0) return;
  frame_ = frame;
  index_.build(cloud.classical, cloud.count, frame);
  part_ = std::min(std::max(all().count() / kMostParts + 1, kLeastPart), all().count());
  const std::size_t places = index_.leaves() * kLeafSize;
  classical_.resize(places);
  normal_.resize(places);
  measured_.resize(places);
  launch(context_, "beginning the net", gather_places, blocks_for(places, kBlock), kBlock, index_.tree(), cloud,
         classical_.data(), normal_.data(), measured_.data());
}

void Refiner::run(const NetWeights& weights, const std::uint8_t* held, Point* out, const std::stop_token& stop) {
  if (index_.points() == 0) return;
  counts_ = count_scales(context_, index_.tree());
  if (counts_[0] <= Index{net::kNeighbors}) return;
  const net::Weights its = upload(weights);
  begin(its, stop);
  for (int layer = 0; layer < net::kLayers; ++layer) {
    const bool clamps = may_clamp(weights.view().layers[layer]);
    const int scale = net::kPlan[layer];
    for_parts(part_, [&](LeafRange part) {
      run_layer(context_, view(), part, its.layers[layer], scale, list_of(scale, part), clamps);
    });
    state_.swap(next_);
    pace(stop);
  }
  end_net(context_, view(), its, index_.tree(), held, out);
}

void Refiner::begin(const net::Weights& weights, const std::stop_token& stop) {
  const std::size_t places = index_.leaves() * kLeafSize;
  const bool is_one_part = part_ == all().count();
  side_.resize(places);
  step_.resize(places);
  slide_apart();
  size_.resize(net::kScales * places);
  finest_.resize(places);
  measure_scale(context_, view(), all(), 0, list_of(0, all()));
  pace(stop);
  if (!is_one_part) {
    lists_[0].list.release();
    lists_[0].scale = -1;
  }
  for (int scale = 1; scale < net::kScales && counts_[scale] > Index{net::kNeighbors}; ++scale)
    coarse_[scale - 1].choose(index_.tree(), scale, counts_[scale], frame_);
  next_.resize(places * net::kChannelWords);
  coarser_.resize((net::kScales - 1) * std::size_t(is_one_part ? part_ : part_ / 2) * kLeafSize);
  for_parts(is_one_part ? part_ : part_ / 2, [&](LeafRange part) {  // scales lie beside the lists
    for (int scale = 1; scale < net::kScales; ++scale)
      measure_scale(context_, view(), part, scale, list_of(scale, part));
    begin_net(context_, view(), part, weights);
    pace(stop);
  });
  finest_.release();
  coarser_.release();
  state_.swap(next_);
  next_.resize(places * net::kChannelWords);
}

void Refiner::slide_apart() {
  const NetCloud cloud = view();
  const Index* const list = list_of(0, all());
  begin_slides(context_, cloud);
  static_assert(net::kSlides % 2 == 0);
  for (int round = 0; round < net::kSlides; round += 2) {
    slide(context_, cloud, list, step_.data(), side_.data());
    slide(context_, cloud, list, side_.data(), step_.data());
  }
  end_slides(context_, cloud);
}

template <class Visit>
void Refiner::for_parts(Index leaves, const Visit& visit) const {
  for (Index begin = 0; begin < all().end; begin += leaves)
    visit(LeafRange{begin, std::min(begin + leaves, all().end)});
}

const Index* Refiner::list_of(int scale, LeafRange part) {
  while (counts_[scale] <= Index{net::kNeighbors}) --scale;  // too few points: as the finer scale
  HeldList& its = lists_[part.count() == all().count() ? scale : 0];
  if (its.scale == scale && its.leaves.begin == part.begin && its.leaves.end == part.end) return its.data();
  its.scale = scale;
  its.leaves = part;
  its.list.resize(std::size_t(part.count()) * kLeafSize * net::kNeighbors);
  if (scale == 0) {
    find_nearest(part, its.data());
  } else {
    coarse_[scale - 1].find_nearest(index_.tree(), part, its.data());
  }
  return its.data();
}

void Refiner::find_nearest(LeafRange part, Index* list) {
  DeviceArray<HardLeaf> leaves(context_);
  DeviceArray<Index> queries(context_);
  leaves.resize(part.count());
  queries.resize(std::size_t(part.count()) * kLeafSize);
  constexpr std::size_t kFirst = offsetof(CloudState, leaf_retries), kEnd = offsetof(CloudState, too_few_neighbors);
  check(cudaMemsetAsync(reinterpret_cast<std::byte*>(index_.state()) + kFirst, 0, kEnd - kFirst, context_.stream()),
        "clearing counts");
  const NearestQuery query{net::kNeighbors, __builtin_inff()};
  const Retries retries{leaves.data(), queries.data()};
  find_nearest_of(context_, index_.tree(), index_.state(), part, query, list, retries);
  find_nearest_of_left(context_, index_.tree(), part, query, list, retries);
}

NetCloud Refiner::view() const {
  const std::size_t places = index_.leaves() * kLeafSize;
  NetCloud its{};
  its.places = static_cast<Index>(places);
  its.classical = classical_.data();
  its.normal = normal_.data();
  its.measured = measured_.data();
  its.side = side_.data();
  its.step = step_.data();
  its.state = state_.data();
  its.next = next_.data();
  for (int s = 0; s < net::kScales; ++s) {
    its.size[s] = size_.data() + s * places;
    its.scale[s] =
        s == 0 ? finest_.data() : coarser_.data() + std::size_t(s - 1) * (coarser_.size() / (net::kScales - 1));
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
