// SPDX-License-Identifier: Apache-2.0
// The paper's stages: the bodies of src/point/stages.h over lists, a thread a point, in sorted order.
#include <bit>
#include <cub/device/device_radix_sort.cuh>

#include "cuda/runtime/launch.cuh"
#include "cuda/stages/faired_points.cuh"
#include "cuda/stages/list_stages.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;

// The listed neighbours of one point (src/point/neighborhoods.h). Lists of at most kHeld are fetched once and held in
// registers.
template <int kHeld>
struct HeldList {
  using Number = float;
  using Count = int;
  Vec offset[kHeld];
  Index position[kHeld];
  int count = 0;

  __device__ __forceinline__ HeldList(const Tree& tree, const Lists& lists, std::size_t at, Vec here) {
    const Index* list = lists.of(at);
#pragma unroll
    for (int i = 0; i < kHeld; ++i) position[i] = i < lists.k ? list[i * kWarp] : point::kNoNeighbor;
#pragma unroll
    for (int i = 0; i < kHeld; ++i) {
      const bool exists = position[i] != point::kNoNeighbor;
      offset[i] = exists ? position_of(tree.points[position[i]]) - here : Vec{};
      count += exists;
    }
  }
  template <class Load, class Visit>
  __device__ __forceinline__ void operator()(Load load, Visit visit) const {
#pragma unroll
    for (int i = 0; i < kHeld; ++i)
      if (i < count) visit(offset[i], load(position[i]), true);
  }
};

// Lists of any length, fetched again for every round.
template <>
struct HeldList<0> {
  using Number = float;
  using Count = int;
  const float4* points;
  const Index* list;
  int k;
  Vec here;

  __device__ __forceinline__ HeldList(const Tree& tree, const Lists& lists, std::size_t at, Vec its_position)
      : points(tree.points), list(lists.of(at)), k(lists.k), here(its_position) {}
  template <class Load, class Visit>
  __device__ __forceinline__ void operator()(Load load, Visit visit) const {
    for (int i = 0; i < k; ++i) {
      const Index at = list[i * kWarp];
      if (at == point::kNoNeighbor) return;
      visit(position_of(points[at]) - here, load(at), true);
    }
  }
};

template <class Neighbors>
__device__ __forceinline__ Vec moved_point(const Neighbors& neighbors, Vec here, Vec normal, AreaWeights areas,
                                           point::BilateralWeights weights) {
  return point::moved(here, normal, point::paper_distance(neighbors, weights, normal, areas, [](Vec, bool) {}));
}

template <int kHeld>
__global__ void __launch_bounds__(kBlock) listed_normals(const __grid_constant__ Tree tree, CloudState* state,
                                                         Lists lists, point::NormalWeights weights, Normals normals) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const float4 p = tree.points[at];
  const bool valid = is_present(p);
  const HeldList<kHeld> neighbors(tree, lists, at, position_of(p));
  const auto normal = point::normal_of(neighbors, weights);
  normals.set(at, valid ? normal.unit : Vec{});
  count_unmoved(state, valid, normal);
}

// Both stages for lists: the neighbours are fetched once. Without area weights it is known here that there are none.
template <int kHeld, bool kAreas>
__global__ void __launch_bounds__(kBlock)
    listed_normals_and_fairing(const __grid_constant__ Tree tree, CloudState* state, LeafRange leaves, Lists lists,
                               point::NormalWeights weights, Normals normals, AreaWeights areas,
                               point::BilateralWeights fairing_weights, FairedPoints faired) {
  begin_kernel();
  const std::size_t at = std::size_t(leaves.begin) * kLeafSize + std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(leaves.end) * kLeafSize) return;  // whole leaves, so whole warps
  const float4 p = tree.points[at];
  const bool valid = is_present(p);
  const HeldList<kHeld> neighbors(tree, lists, at, position_of(p));
  const auto normal = point::normal_of(neighbors, weights);
  normals.set(at, valid ? normal.unit : Vec{});
  count_unmoved(state, valid, normal);
  store_faired(
      faired, at, p, valid,
      moved_point(neighbors, position_of(p), normal.unit, kAreas ? areas : AreaWeights{nullptr, 0}, fairing_weights));
}

template <int kHeld, bool kAreas>
__global__ void __launch_bounds__(kBlock)
    listed_fairing(const __grid_constant__ Tree tree, Lists lists, Normals normals, AreaWeights areas,
                   point::BilateralWeights weights, FairedPoints faired) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const float4 p = tree.points[at];
  const HeldList<kHeld> neighbors(tree, lists, at, position_of(p));
  store_faired(
      faired, at, p, is_present(p),
      moved_point(neighbors, position_of(p), normals.at(at), kAreas ? areas : AreaWeights{nullptr, 0}, weights));
}

__global__ void scatter_staged(FairedPoints faired) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  const bool exists = i < faired.count;
  const Point p = exists ? faired.staged[i] : Point{};
  scatter(faired.in_order, exists ? faired.staged_originals[i] : point::kNoNeighbor, {p.x, p.y, p.z});
}

__global__ void scatter_normals(const __grid_constant__ Tree tree, Normals normals, std::size_t count, Point* out) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  const bool exists = at < count;
  scatter(out, exists ? original_of(tree.points[at]) : point::kNoNeighbor, exists ? normals.at(at) : Vec{});
}

}  // namespace

// Random writes all over a large cloud miss the cache, so a pass of radix sort by the highest bits of the original
// index comes first: what is written at one time then goes to a 256th of the array.
void bring_into_order(Context& context, FairedPoints faired) {
  if (faired.staged == nullptr) return;
  const cudaStream_t stream = context.stream();
  const Index count = static_cast<Index>(faired.count);
  const int end = std::bit_width(count - 1), begin = std::max(end - 8, 0);
  with_scratch(context, "bringing points into upload order", [&](void* scratch, std::size_t& bytes) {
    return cub::DeviceRadixSort::SortPairs(scratch, bytes, faired.originals, faired.staged_originals, faired.in_order,
                                           faired.staged, count, begin, end, context.stream());
  });
  launch(context, "bringing points into upload order", scatter_staged, blocks_for(count, kBlock), kBlock, faired);
}

void estimate_normals(Context& context, const Tree& tree, CloudState* state, Lists lists, point::NormalWeights weights,
                      Normals normals) {
  const int k = lists.k;
  const auto kernel = k <= 8 ? listed_normals<8> : k <= 16 ? listed_normals<16> : listed_normals<0>;
  launch(context, "estimating normals", kernel, blocks_for(tree.leaves, kWarps), kBlock, tree, state, lists, weights,
         normals);
}

void fair(Context& context, const Tree& tree, Lists lists, Normals normals, AreaWeights areas,
          point::BilateralWeights weights, FairedPoints faired) {
  const int k = lists.k;
  const bool with = areas.power > 0;
  const auto kernel = k <= 8    ? (with ? listed_fairing<8, true> : listed_fairing<8, false>)
                      : k <= 16 ? (with ? listed_fairing<16, true> : listed_fairing<16, false>)
                                : (with ? listed_fairing<0, true> : listed_fairing<0, false>);
  launch(context, "fairing", kernel, blocks_for(tree.leaves, kWarps), kBlock, tree, lists, normals, areas, weights,
         faired);
  bring_into_order(context, faired);
}

void estimate_normals_and_fair(Context& context, const Tree& tree, CloudState* state, LeafRange leaves, Lists lists,
                               point::NormalWeights weights, Normals normals, AreaWeights areas,
                               point::BilateralWeights fairing_weights, FairedPoints faired) {
  const int k = lists.k;
  const bool with = areas.power > 0;
  const auto kernel = k <= 8    ? (with ? listed_normals_and_fairing<8, true> : listed_normals_and_fairing<8, false>)
                      : k <= 16 ? (with ? listed_normals_and_fairing<16, true> : listed_normals_and_fairing<16, false>)
                                : (with ? listed_normals_and_fairing<0, true> : listed_normals_and_fairing<0, false>);
  launch_early(context, "estimating normals and fairing", kernel, blocks_for(leaves.count(), kWarps), kBlock, tree,
               state, leaves, lists, weights, normals, areas, fairing_weights, faired);
  bring_into_order(context, faired);
}

void restore_order(Context& context, const Tree& tree, Normals normals, std::size_t count, Point* out) {
  launch(context, "bringing normals into upload order", scatter_normals, blocks_for(count, kBlock), kBlock, tree,
         normals, count, out);
}

}  // namespace pointfair::cuda
