// SPDX-License-Identifier: Apache-2.0
#include "cuda/net/layers.cuh"
#include "cuda/net/refiner.cuh"
#include "cuda/search/search.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256;
constexpr std::size_t kLargeCloud = 3'000'000;  // points; of fewer no step is long

__global__ void __launch_bounds__(kBlock) gather_places(const __grid_constant__ Tree tree, RefinedCloud from,
                                                        float4* classical, float4* normal, float2* measured) {
  const Index at = blockIdx.x * kBlock + threadIdx.x;
  if (at >= tree.leaves * kLeafSize) return;
  const float4 p = tree.points[at];
  if (!is_present(p)) {
    classical[at] = {0, 0, 0, 1};
    normal[at] = {0, 0, 0, 0};
    measured[at] = {0, 0};
    return;
  }
  const Index original = original_of(p);
  const Point m = from.measured[original], n = from.normals[original];
  classical[at] = {p.x, p.y, p.z, from.noise[original]};
  normal[at] = {n.x, n.y, n.z, m.x};
  measured[at] = {m.y, m.z};
}

}  // namespace

Refiner::Refiner(Context& context)
    : context_(context),
      index_(context),
      weights_(context),
      biases_(context),
      lists_{DeviceArray<Index>(context), DeviceArray<Index>(context), DeviceArray<Index>(context),
             DeviceArray<Index>(context)},
      classical_(context),
      given_normal_(context),
      normal_(context),
      measured_(context),
      side_(context),
      step_(context),
      size_(context),
      state_(context),
      stored_(context) {}

void Refiner::run(const RefinedCloud& cloud, const NetWeights& weights, const Frame& frame, Point* out,
                  const std::stop_token& stop) {
  if (cloud.count == 0) return;
  const cudaStream_t stream = context_.stream();
  if (out != cloud.classical)
    check(cudaMemcpyAsync(out, cloud.classical, cloud.count * sizeof(Point), cudaMemcpyDeviceToDevice, stream),
          "beginning the net");
  index_.build(cloud.classical, cloud.count, frame, nullptr);
  const ScaleCounts counts = count_scales(context_, index_.tree());
  if (counts[0] <= Index{net::kNeighbors}) return;
  find_lists(counts, frame, stop);
  const NetCloud its = make_room(cloud);
  const net::Weights view = upload(weights);
  begin_net(context_, its, view);
  for (int layer = 0; layer < net::kLayers; ++layer) {
    store_for_neighbors(context_, its, view.layers[layer]);
    run_layer(context_, its, view.layers[layer], net::kPlan[layer]);
    pace(stop);
  }
  end_net(context_, its, view, index_.tree(), cloud.held, out);
}

void Refiner::find_lists(const ScaleCounts& counts, const Frame& frame, const std::stop_token& stop) {
  CoarsePoints coarse(context_);
  for (int s = 0; s < net::kScales; ++s) {
    if (counts[s] <= Index{net::kNeighbors}) {  // too few points: as the finer scale
      lists_of_[s] = lists_of_[s - 1];
      continue;
    }
    lists_[s].resize(index_.leaves() * kLeafSize * net::kNeighbors);
    lists_of_[s] = lists_[s].data();
    if (s == 0) {
      find_nearest(lists_[s].data());
    } else {
      coarse.choose(index_.tree(), s, counts[s], frame);
      coarse.find_nearest(index_.tree(), lists_[s].data());
    }
    pace(stop);
  }
}

void Refiner::find_nearest(Index* list) {
  const std::size_t places = index_.leaves() * kLeafSize;
  DeviceArray<HardLeaf> leaves(context_);
  DeviceArray<Index> queries(context_);
  leaves.resize(index_.leaves());
  queries.resize(places);
  cuda::find_nearest(context_, index_.tree(), index_.state(), {net::kNeighbors, __builtin_inff()}, list,
                     {leaves.data(), queries.data()}, {});
}

NetCloud Refiner::make_room(const RefinedCloud& cloud) {
  const std::size_t places = index_.leaves() * kLeafSize;
  for (DeviceArray<float4>* array : {&classical_, &given_normal_, &normal_}) array->resize(places);
  measured_.resize(places);
  side_.resize(places);
  step_.resize(places);
  size_.resize(net::kScales * places);
  state_.resize(places * net::kChannelWords);
  stored_.resize(places * net::kChannelWords);
  gather_places<<<blocks_for(places, kBlock), kBlock, 0, context_.stream()>>>(index_.tree(), cloud, classical_.data(),
                                                                              given_normal_.data(), measured_.data());
  check(cudaGetLastError(), "beginning the net");
  NetCloud its{static_cast<Index>(places),
               classical_.data(),
               given_normal_.data(),
               normal_.data(),
               measured_.data(),
               side_.data(),
               step_.data(),
               {},
               state_.data(),
               stored_.data(),
               {}};
  for (int s = 0; s < net::kScales; ++s) {
    its.size[s] = size_.data() + s * places;
    its.lists[s] = lists_of_[s];
  }
  return its;
}

net::Weights Refiner::upload(const NetWeights& weights) {
  weights_.resize(weights.numbers().size());
  biases_.resize(weights.biases().size());
  check(cudaMemcpyAsync(weights_.data(), weights.numbers().data(), weights.numbers().size(), cudaMemcpyHostToDevice,
                        context_.stream()),
        "uploading weights");
  check(cudaMemcpyAsync(biases_.data(), weights.biases().data(), weights.biases().size_bytes(), cudaMemcpyHostToDevice,
                        context_.stream()),
        "uploading weights");
  return weights.view_over(weights_.data(), biases_.data());
}

void Refiner::pace(const std::stop_token& stop) {
  if (!stop.stop_possible()) return;
  if (index_.points() >= kLargeCloud) context_.finish();
  if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
}

}  // namespace pointfair::cuda
