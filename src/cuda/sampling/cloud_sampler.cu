// SPDX-License-Identifier: Apache-2.0
#include <bit>

#include "cuda/runtime/warp.cuh"
#include "cuda/sampling/cloud_sampler.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256, kWarps = kBlock / kWarp;
constexpr int kBlocks = 8;                // of a processor
constexpr std::size_t kLeastRoom = 4096;  // candidates

__global__ void clear_sample(SampleState* state) {
  if (threadIdx.x < 3) {
    state->min[threadIdx.x] = ~0u;
    state->max[threadIdx.x] = 0;
  }
  if (threadIdx.x == 0) state->valid = 0;
}

__global__ void __launch_bounds__(kBlock) find_bounds(const Point* points, std::size_t count, SampleState* state) {
  unsigned low[3] = {~0u, ~0u, ~0u}, high[3] = {}, valid = 0;
  for (std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x; i < count;
       i += std::size_t(gridDim.x) * kBlock) {
    const Point p = points[i];
    if (!point::is_indexable(p)) continue;
    const unsigned v[3] = {ordered(p.x), ordered(p.y), ordered(p.z)};
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = min(low[axis], v[axis]);
      high[axis] = max(high[axis], v[axis]);
    }
    ++valid;
  }
  // one atomic a block and number: all blocks meet in the same place
  __shared__ unsigned lows[3][kWarps], highs[3][kWarps], valids[kWarps];
  const unsigned warp = threadIdx.x / kWarp, lane = lane_number();
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    lows[axis][warp] = warp_min(low[axis]);
    highs[axis][warp] = warp_max(high[axis]);
  }
  valids[warp] = warp_sum(valid);
  __syncthreads();
  if (warp > 0) return;
  const bool holds = lane < kWarps;
  const unsigned all = warp_sum(holds ? valids[lane % kWarps] : 0u);
  for (int axis = 0; axis < 3; ++axis) {
    const unsigned least = warp_min(holds ? lows[axis][lane % kWarps] : ~0u);
    const unsigned most = warp_max(holds ? highs[axis][lane % kWarps] : 0u);
    if (lane == 0) atomicMin(&state->min[axis], least);
    if (lane == 0) atomicMax(&state->max[axis], most);
  }
  if (lane == 0) atomicAdd(&state->valid, all);
}

__global__ void __launch_bounds__(kBlock)
    find_candidates(const Point* points, std::size_t count, Candidates wanted, std::size_t room, SampleState* state,
                    SampleCandidate* candidates) {
  const point::Vec3<float> corner = {unordered(state->min[0]), unordered(state->min[1]), unordered(state->min[2])},
                           end = {unordered(state->max[0]), unordered(state->max[1]), unordered(state->max[2])};
  const double cells = point::cells_per_unit(corner, end, wanted.refinement);
  for (std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x; i < count;
       i += std::size_t(gridDim.x) * kBlock) {
    const Point p = points[i];
    if (!point::is_indexable(p)) continue;
    const unsigned hash = point::cell_hash({p.x, p.y, p.z}, corner, cells);
    if (hash > wanted.limit) continue;
    const unsigned place = atomicAdd(&state->candidates, 1u);
    if (place < room) candidates[place] = {hash, static_cast<std::uint32_t>(i), p};
  }
}

}  // namespace

void CloudSampler::collect(const Point* points, std::size_t count, Candidates wanted) {
  const unsigned blocks = std::min(blocks_for(count, kBlock), static_cast<unsigned>(context_.processors() * kBlocks));
  const cudaStream_t stream = context_.stream();
  for (;;) {
    const std::size_t room = candidates_.size();
    check(cudaMemsetAsync(&state_.data()->candidates, 0, sizeof(unsigned), stream), "sampling the cloud");
    candidates_.clear("sampling the cloud");
    launch(context_, "sampling the cloud", find_candidates, blocks, kBlock, points, count, wanted, room, state_.data(),
           candidates_.data());
    fetched_.resize(room);
    state_.download({fetched_state_.get(), 1}, "sampling the cloud");
    candidates_.download({fetched_.get(), room}, "sampling the cloud");
    context_.finish();
    if (fetched_state_.get()->candidates <= room) return;
    candidates_.resize(fetched_state_.get()->candidates);  // many points share a place
  }
}

std::vector<SampleCandidate> CloudSampler::fetched(std::uint32_t limit) const {
  std::vector<SampleCandidate> candidates;
  candidates.reserve(fetched_state_.get()->candidates);
  for (unsigned i = 0; i < fetched_state_.get()->candidates; ++i)
    if (fetched_.get()[i].hash <= limit) candidates.push_back(fetched_.get()[i]);
  return candidates;
}

CloudSample CloudSampler::draw(const Point* points, std::size_t count, std::size_t wanted) {
  if (count == 0 || wanted == 0) return {};
  state_.resize(1);
  candidates_.resize(std::max(kLeastRoom, 2 * wanted));
  const unsigned blocks = std::min(blocks_for(count, kBlock), static_cast<unsigned>(context_.processors() * kBlocks));
  clear_sample<<<1, kWarp, 0, context_.stream()>>>(state_.data());
  launch(context_, "sampling the cloud", find_bounds, blocks, kBlock, points, count, state_.data());
  // as if all were valid, which is mostly enough
  Candidates collected = first_candidates(count, wanted);
  collect(points, count, collected);
  const SampleState& state = *fetched_state_.get();
  if (state.valid == 0) return {};
  const auto coordinate = [](unsigned o) { return std::bit_cast<float>(unordered_bits(o)); };
  const Bounds bounds{{coordinate(state.min[0]), coordinate(state.min[1]), coordinate(state.min[2])},
                      {coordinate(state.max[0]), coordinate(state.max[1]), coordinate(state.max[2])},
                      state.valid};
  CloudSample sample = draw_sample(bounds, wanted, [&](Candidates asked) {
    if (asked.limit > collected.limit || asked.refinement != collected.refinement)
      collect(points, count, collected = asked);
    return fetched(asked.limit);
  });
  candidates_.release();
  return sample;
}

}  // namespace pointfair::cuda
