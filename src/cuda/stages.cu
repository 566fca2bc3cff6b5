// SPDX-License-Identifier: Apache-2.0
// A thread a point, in sorted order. Both kernels run over their neighbours through `for_neighbors(visit)`, which calls
// visit(offset, sorted position) for each, always in the same order.
#include "cuda/stages.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;

// The listed neighbours of one point. Lists of at most kHeld are fetched once and held in registers.
template <int kHeld>
struct Listed {
  Vec offset[kHeld];
  Index position[kHeld];

  __device__ __forceinline__ Listed(const Tree& tree, const Lists& lists, std::size_t at, Vec here) {
    const Index* list = lists.of(at);
#pragma unroll
    for (int i = 0; i < kHeld; ++i) position[i] = i < lists.k ? list[i * kWarp] : point::kNoNeighbor;
#pragma unroll
    for (int i = 0; i < kHeld; ++i)
      offset[i] = position[i] != point::kNoNeighbor ? position_of(tree.points[position[i]]) - here : Vec{};
  }
  template <class Visit>
  __device__ __forceinline__ void operator()(Visit visit) const {
#pragma unroll
    for (int i = 0; i < kHeld; ++i)
      if (position[i] != point::kNoNeighbor) visit(offset[i], position[i]);
  }
};

// Lists of any length, fetched again for every round.
template <>
struct Listed<0> {
  const float4* points;
  const Index* list;
  int k;
  Vec here;

  __device__ __forceinline__ Listed(const Tree& tree, const Lists& lists, std::size_t at, Vec its_position)
      : points(tree.points), list(lists.of(at)), k(lists.k), here(its_position) {}
  template <class Visit>
  __device__ __forceinline__ void operator()(Visit visit) const {
    for (int i = 0; i < k; ++i) {
      const Index at = list[i * kWarp];
      if (at == point::kNoNeighbor) return;
      visit(position_of(points[at]) - here, at);
    }
  }
};

// Everything within a radius, in sorted order; the warp walks the tree for its leaf.
struct Ball {
  const Tree& tree;
  float squared_radius;
  Index at;
  Vec here;
  bool active;
  Box box;

  __device__ __forceinline__ Ball(const Tree& its_tree, float squared, Index its_place, Vec position, bool is_active)
      : tree(its_tree),
        squared_radius(squared),
        at(its_place),
        here(position),
        active(is_active),
        box(warp_box(position, is_active)) {}

  template <class Visit>
  __device__ __forceinline__ void operator()(Visit visit) const {
    const auto near = [&](const Box& other) { return squared_gap(other, box) <= squared_radius; };
    const auto near_group = [&](const BoxGroup& group) { return near(box_of_lane(group)); };
    Walk walk(tree);
    for (Index leaf = walk.next(near_group); leaf != point::kNoNeighbor; leaf = walk.next(near_group)) {
      const Vec mine = position_of(tree.points[leaf * kLeafSize + lane_number()]);
      for (unsigned all = __ballot_sync(kAllLanes, near({mine, mine})); all != 0; all &= all - 1) {
        const int lane = __ffs(static_cast<int>(all)) - 1;
        const Vec there = {__shfl_sync(kAllLanes, mine.x, lane), __shfl_sync(kAllLanes, mine.y, lane),
                           __shfl_sync(kAllLanes, mine.z, lane)};
        const Vec offset = there - here;
        const Index position = leaf * kLeafSize + Index(lane);
        if (active && position != at && point::squared_length(offset) <= squared_radius) visit(offset, position);
      }
    }
  }
};

template <class ForNeighbors>
__device__ __forceinline__ void normal_of(ForNeighbors for_neighbors, point::NormalWeights weights, std::size_t at,
                                          bool valid, Normals normals, CloudState* state) {
  point::CentroidSum<float> centroid_sum;
  int found = 0;
  for_neighbors([&](Vec offset, Index) {
    centroid_sum.add(offset, true, weights);
    ++found;
  });
  const Vec centroid = centroid_sum.centroid();
  point::CovarianceSum<float> covariance;
  for_neighbors([&](Vec offset, Index) { covariance.add(offset, centroid, true, weights); });
  const point::Direction<float> normal = covariance.normal();
  const bool enough = found >= point::kLeastNeighbors;
  normals.set(at, enough && valid ? normal.unit : Vec{});
  const unsigned few = __ballot_sync(kAllLanes, valid && !enough);
  const unsigned none = __ballot_sync(kAllLanes, valid && enough && !normal.exists);
  if (lane_number() != 0) return;
  if (few != 0) atomicAdd(&state->too_few_neighbors, static_cast<unsigned long long>(__popc(few)));
  if (none != 0) atomicAdd(&state->no_normal, static_cast<unsigned long long>(__popc(none)));
}

template <int kHeld>
__global__ void __launch_bounds__(kBlock) listed_normals(const __grid_constant__ Tree tree, CloudState* state,
                                                         Lists lists, point::NormalWeights weights, Normals normals) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const Listed<kHeld> neighbors(tree, lists, at, position_of(tree.points[at]));
  normal_of(neighbors, weights, at, at < state->valid, normals, state);
}

__global__ void __launch_bounds__(kBlock)
    ball_normals(const __grid_constant__ Tree tree, CloudState* state, float squared_radius,
                 point::NormalWeights weights, Normals normals) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const bool valid = at < state->valid;
  const Ball neighbors(tree, squared_radius, Index(at), position_of(tree.points[at]), valid);
  normal_of(neighbors, weights, at, valid, normals, state);
}

template <class ForNeighbors>
__device__ __forceinline__ void fair_one(ForNeighbors for_neighbors, const Tree& tree, std::size_t at, Normals normals,
                                         AreaWeights areas, point::BilateralWeights weights, const Point* points,
                                         std::size_t count, FairedPoints faired) {
  const float4 p = tree.points[at];
  const Vec normal = normals.at(at);
  point::BilateralSum<float> sum;
  for_neighbors([&](Vec offset, Index neighbor) { sum.add(offset, normal, areas.of(neighbor), true, weights); });
  const Vec moved = point::moved(position_of(p), normal, sum.distance());
  if (faired.sorted != nullptr) {
    faired.sorted[at] = {moved.x, moved.y, moved.z, 0};
  } else if (at < count) {
    const Index original = original_of(p);
    faired.in_order[original] = at < tree.state->valid ? Point{moved.x, moved.y, moved.z} : points[original];
  }
}

template <int kHeld>
__global__ void __launch_bounds__(kBlock)
    listed_fairing(const __grid_constant__ Tree tree, Lists lists, Normals normals, AreaWeights areas,
                   point::BilateralWeights weights, const Point* points, std::size_t count, FairedPoints faired) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= count) return;
  const Listed<kHeld> neighbors(tree, lists, at, position_of(tree.points[at]));
  fair_one(neighbors, tree, at, normals, areas, weights, points, count, faired);
}

__global__ void __launch_bounds__(kBlock)
    ball_fairing(const __grid_constant__ Tree tree, float squared_radius, Normals normals, AreaWeights areas,
                 point::BilateralWeights weights, const Point* points, std::size_t count, FairedPoints faired) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const Ball neighbors(tree, squared_radius, Index(at), position_of(tree.points[at]), at < tree.state->valid);
  fair_one(neighbors, tree, at, normals, areas, weights, points, count, faired);
}

__global__ void invert(const __grid_constant__ Tree tree, std::size_t count, Index* place_of) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at < count) place_of[original_of(tree.points[at])] = Index(at);
}

__global__ void pull(const __grid_constant__ Tree tree, const Point* points, std::size_t count, FairedPoints faired) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i >= count) return;
  const Index at = faired.place_of[i];
  const float4 p = faired.sorted[at];
  faired.in_order[i] = at < tree.state->valid ? Point{p.x, p.y, p.z} : points[i];
}

__global__ void scatter_normals(const __grid_constant__ Tree tree, Normals normals, std::size_t count, Point* out) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= count) return;
  const Vec n = normals.at(at);
  out[original_of(tree.points[at])] = {n.x, n.y, n.z};
}

}  // namespace

void estimate_normals(Context& context, const Tree& tree, CloudState* state, Neighborhoods neighborhoods,
                      point::NormalWeights weights, Normals normals) {
  const cudaStream_t stream = context.stream();
  check(cudaMemsetAsync(&state->too_few_neighbors, 0, 2 * sizeof(state->too_few_neighbors), stream),
        "preparing normals");
  const unsigned blocks = blocks_for(tree.leaves, kWarps);
  const int k = neighborhoods.lists.k;
  if (k == 0) {
    ball_normals<<<blocks, kBlock, 0, stream>>>(tree, state, neighborhoods.squared_radius, weights, normals);
  } else {
    const auto kernel = k <= 8 ? listed_normals<8> : k <= 16 ? listed_normals<16> : listed_normals<0>;
    kernel<<<blocks, kBlock, 0, stream>>>(tree, state, neighborhoods.lists, weights, normals);
  }
  check(cudaGetLastError(), "estimating normals");
}

void fair(Context& context, const Tree& tree, Neighborhoods neighborhoods, Normals normals, AreaWeights areas,
          point::BilateralWeights weights, const Point* points, std::size_t count, FairedPoints faired) {
  const cudaStream_t stream = context.stream();
  const unsigned blocks = blocks_for(tree.leaves, kWarps);
  const int k = neighborhoods.lists.k;
  if (k == 0) {
    ball_fairing<<<blocks, kBlock, 0, stream>>>(tree, neighborhoods.squared_radius, normals, areas, weights, points,
                                                count, faired);
  } else {
    const auto kernel = k <= 8 ? listed_fairing<8> : k <= 16 ? listed_fairing<16> : listed_fairing<0>;
    kernel<<<blocks, kBlock, 0, stream>>>(tree, neighborhoods.lists, normals, areas, weights, points, count, faired);
  }
  check(cudaGetLastError(), "fairing");
  if (faired.sorted == nullptr) return;
  pull<<<blocks_for(count, kBlock), kBlock, 0, stream>>>(tree, points, count, faired);
  check(cudaGetLastError(), "bringing points into upload order");
}

void find_places(Context& context, const Tree& tree, std::size_t count, Index* place_of) {
  invert<<<blocks_for(count, kBlock), kBlock, 0, context.stream()>>>(tree, count, place_of);
  check(cudaGetLastError(), "finding the places of points");
}

void restore_order(Context& context, const Tree& tree, Normals normals, std::size_t count, Point* out) {
  scatter_normals<<<blocks_for(count, kBlock), kBlock, 0, context.stream()>>>(tree, normals, count, out);
  check(cudaGetLastError(), "bringing normals into upload order");
}

}  // namespace pointfair::cuda
