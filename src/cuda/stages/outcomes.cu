// SPDX-License-Identifier: Apache-2.0
#include "cuda/stages/outcomes.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;

// 1 or 0 for exact or not: neighbourhoods and mean distances.
__global__ void __launch_bounds__(kBlock)
    find_exact(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings,
               const __grid_constant__ OutcomeQuery query, float* neighborhood, float* mean, unsigned char* is_short) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const Index valid = tree.state->valid;
  neighborhood[at] = mean[at] = 1;
  is_short[at] = 0;
  if (!tree.holds(at)) return;
  const Vec here = position_of(tree.points[at]);
  const float gap = point::squared_gap_to_outside(query.loaded, here);
  if (query.mean_distance != nullptr) {
    const bool found = valid > point::kAreaNeighbors;
    mean[at] = point::is_exact_mean(found ? query.mean_distance[at] : __int_as_float(0x7f800000), gap);
  }
  const Lists& lists = surroundings.lists;
  if (lists.k == 0) {
    const bool found = surroundings.radii.min_neighbors == 0 || valid > Index(surroundings.radii.min_neighbors);
    const float* growth = surroundings.radii.squared_growth;
    const float squared_radius = surroundings.radii.squared_radius[at] * (growth == nullptr ? 1.0f : growth[at]);
    neighborhood[at] = point::is_exact_radius(squared_radius, found, gap);
    return;
  }
  const Index* list = lists.of(at);
  int entries = 0;
  Index last = 0;
  for (; entries < lists.k && list[entries * kWarp] != point::kNoNeighbor; ++entries) last = list[entries * kWarp];
  const float squared_last = entries > 0 ? point::squared_length(position_of(tree.points[last]) - here) : 0.0f;
  neighborhood[at] = point::is_exact_list(query.rule, entries, squared_last, gap);
  is_short[at] = query.rule.constraint && entries < lists.k;
}

__global__ void __launch_bounds__(kBlock)
    unite_read(std::size_t count, const float* normal, const float* mean, bool reads_normals, float* read_there) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at < count) read_there[at] = fminf(reads_normals ? normal[at] : 1.0f, mean[at]);
}

__global__ void __launch_bounds__(kBlock)
    write_outcomes(const __grid_constant__ Tree tree, Normals normals, const float* neighborhood, const float* normal,
                   const float* step, const float* counts, const unsigned char* is_short, unsigned char* out) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize || !tree.holds(at)) return;
  const bool exact = neighborhood[at] * normal[at] * step[at] > 0;
  out[original_of(tree.points[at])] = point::outcome_of(exact, is_short[at] != 0, counts[at], normals.at(at));
}

}  // namespace

void find_outcomes(Context& context, const Tree& tree, Surroundings surroundings, Normals normals,
                   const OutcomeQuery& query, std::size_t count, unsigned char* out) {
  const std::size_t places = std::size_t(tree.leaves) * kLeafSize;
  const unsigned blocks = blocks_for(tree.leaves, kWarps);
  const cudaStream_t stream = context.stream();
  DeviceArray<float> values(context);  // an array after the other
  DeviceArray<unsigned char> is_short(context);
  values.resize(5 * places);
  is_short.resize(places);
  float *neighborhood = values.data(), *mean = neighborhood + places, *counts = mean + places,
        *normal = counts + places, *least = normal + places;
  check(cudaMemsetAsync(out, 0, count, stream), "finding outcomes");
  find_exact<<<blocks, kBlock, 0, stream>>>(tree, surroundings, query, neighborhood, mean, is_short.data());
  check(cudaMemcpyAsync(normal, neighborhood, places * sizeof(float), cudaMemcpyDeviceToDevice, stream),
        "finding outcomes");
  Surroundings of_step = surroundings;
  if (surroundings.radii.squared_growth != nullptr) of_step.collected = {};
  surroundings.radii.squared_growth = nullptr;
  for (int round = 0; round < query.filter_rounds; ++round) {
    survey(context, tree, surroundings, normal, counts, least);
    std::swap(normal, least);
  }
  unite_read<<<blocks, kBlock, 0, stream>>>(places, normal, mean, query.reads_normals, mean);
  survey(context, tree, of_step, mean, counts, least);
  if (query.reads_displacements) {
    unite_read<<<blocks, kBlock, 0, stream>>>(places, neighborhood, least, true, mean);
    survey(context, tree, surroundings, mean, counts, least);
  }
  write_outcomes<<<blocks, kBlock, 0, stream>>>(tree, normals, neighborhood, normal, least, counts, is_short.data(),
                                                out);
  check(cudaGetLastError(), "finding outcomes");
}

}  // namespace pointfair::cuda
