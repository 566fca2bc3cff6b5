// SPDX-License-Identifier: Apache-2.0
#include "cuda/stages/outcomes.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;

// How deep in the loaded region the neighbourhoods of a leaf end, as ordered() floats: where that is deeper than every
// value of 0 lies, all values in them are 1, and the leaf is not surveyed (docs/decisions/039). Distances are rounded,
// and below `kLeast` squares have few bits.
constexpr float kLess = 1 - 1e-5f, kMore = 1 + 1e-5f, kLeast = 1e-30f;
constexpr unsigned kSurveyed = 0;  // in any case

__device__ unsigned end_of(float squared_gap, float squared_reach) {
  const float end = kLess * sqrtf(squared_gap) - kMore * sqrtf(fmaxf(squared_reach, 0.0f));
  return squared_gap > kLeast && end > -__int_as_float(0x7f800000) ? ordered(end) : kSurveyed;
}

// Of one point.
struct Exact {
  bool neighborhood, is_short;
  float squared_reach;
};

__device__ Exact exact_list(const Tree& tree, const Lists& lists, const point::ListRule& rule, std::size_t at,
                            float squared_gap) {
  const Index* list = lists.of(at);
  int entries = 0;
  Index last = 0;
  for (; entries < lists.k && list[entries * kWarp] != point::kNoNeighbor; ++entries) last = list[entries * kWarp];
  const float squared_last =
      entries > 0 ? point::squared_length(position_of(tree.points[last]) - position_of(tree.points[at])) : 0.0f;
  return {point::is_exact_list(rule, entries, squared_last, squared_gap), rule.constraint && entries < lists.k,
          squared_last};
}

__device__ Exact exact_radius(const point::Radii& radii, float reach_level, bool is_found, std::size_t at,
                              float squared_gap) {
  const float own = radii.squared_radius[at],
              grown = own * (radii.squared_growth == nullptr ? 1.0f : radii.squared_growth[at]);
  const float farthest = fmaxf(grown, point::squared_search(own, reach_level));
  return {point::is_exact_radius(farthest, is_found, squared_gap), false, fmaxf(own, grown)};
}

// 1 or 0 for exact or not: neighbourhoods and mean distances. The leaf of a point without a normal is surveyed in any
// case, since its neighbours are counted.
__global__ void __launch_bounds__(kBlock)
    find_exact(const __grid_constant__ Tree tree, const __grid_constant__ Surroundings surroundings, Normals normals,
               const __grid_constant__ OutcomeQuery query, float* neighborhood, float* mean, unsigned char* is_short,
               unsigned* ends) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  unsigned end = ~0u;
  float its_mean = 1;
  Exact exact{true, false, 0};
  if (tree.holds(at)) {
    const Index valid = tree.state->valid;
    const float gap = point::squared_gap_to_outside(query.loaded, position_of(tree.points[at]));
    if (query.mean_distance != nullptr)
      its_mean = point::is_exact_mean(
          valid > point::kAreaNeighbors ? query.mean_distance[at] : __int_as_float(0x7f800000), gap);
    const point::Radii& radii = surroundings.radii;
    if (!query.along_mesh)
      exact = surroundings.lists.k > 0
                  ? exact_list(tree, surroundings.lists, query.rule, at, gap)
                  : exact_radius(radii, point::node_value(query.reach, position_of(tree.points[at])),
                                 radii.min_neighbors == 0 || valid > Index(radii.min_neighbors), at, gap);
    const Vec normal = normals.at(at);
    const bool has_normal = normal.x != 0 || normal.y != 0 || normal.z != 0;
    end = has_normal ? end_of(gap, exact.squared_reach) : kSurveyed;
  }
  neighborhood[at] = exact.neighborhood;
  mean[at] = its_mean;
  is_short[at] = exact.is_short;
  const unsigned of_leaf = warp_min(end);
  if (lane_number() == 0) ends[at / kLeafSize] = of_leaf;
}

// How deep the deepest value of 0 lies, as an ordered() float; stays 0 where there is none.
__global__ void __launch_bounds__(kBlock)
    find_deepest_zero(const __grid_constant__ Tree tree, point::Region loaded, const float* values, unsigned* deepest) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  unsigned depth = 0;
  if (values[at] == 0 && tree.holds(at))
    depth = ordered(sqrtf(point::squared_gap_to_outside(loaded, position_of(tree.points[at]))));
  const unsigned most = warp_max(depth);
  if (lane_number() == 0 && most > *deepest) atomicMax(deepest, most);
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
  DeviceArray<unsigned> depths(context);  // the deepest zero of each survey, and where leaves end
  const std::size_t surveys = std::size_t(query.filter_rounds) + 2;
  values.resize(5 * places);
  is_short.resize(places);
  depths.resize(surveys + tree.leaves);
  unsigned *deepest = depths.data(), *const ends = deepest + surveys;
  float *neighborhood = values.data(), *mean = neighborhood + places, *counts = mean + places,
        *normal = counts + places, *least = normal + places;
  check(cudaMemsetAsync(out, 0, count, stream), "finding outcomes");
  check(cudaMemsetAsync(deepest, 0, surveys * sizeof(unsigned), stream), "finding outcomes");
  find_exact<<<blocks, kBlock, 0, stream>>>(tree, surroundings, normals, query, neighborhood, mean, is_short.data(),
                                            ends);
  const auto survey_all = [&](const Surroundings& its, const float* of, float* to) {
    find_deepest_zero<<<blocks, kBlock, 0, stream>>>(tree, query.loaded, of, deepest);
    survey(context, tree, its, of, counts, to, {ends, deepest++});
  };
  check(cudaMemcpyAsync(normal, neighborhood, places * sizeof(float), cudaMemcpyDeviceToDevice, stream),
        "finding outcomes");
  Surroundings of_step = surroundings;
  if (surroundings.radii.squared_growth != nullptr && !query.along_mesh) of_step.collected = {};
  surroundings.radii.squared_growth = nullptr;
  for (int round = 0; round < query.filter_rounds; ++round) {
    survey_all(surroundings, normal, least);
    std::swap(normal, least);
  }
  unite_read<<<blocks, kBlock, 0, stream>>>(places, normal, mean, query.reads_normals, mean);
  survey_all(of_step, mean, least);
  if (query.reads_displacements) {
    unite_read<<<blocks, kBlock, 0, stream>>>(places, neighborhood, least, true, mean);
    survey_all(surroundings, mean, least);
  }
  launch(context, "finding outcomes", write_outcomes, blocks, kBlock, tree, normals, neighborhood, normal, least,
         counts, is_short.data(), out);
}

}  // namespace pointfair::cuda
