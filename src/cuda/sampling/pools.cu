// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/launch.cuh"
#include "cuda/runtime/warp.cuh"
#include "cuda/sampling/pools.cuh"
#include "point/sample.h"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256;
constexpr int kPool = point::kPool;

// A block to each cloud, a thread to each sample, which looks at all others.
__global__ void __launch_bounds__(kBlock) fill_pools(const Poolable samples, Index* pools) {
  __shared__ Point places[kMostPooled];
  const Index first = blockIdx.x == 0 ? 0 : samples.ends[blockIdx.x - 1], count = samples.ends[blockIdx.x] - first;
  constexpr float kInfinity = __builtin_inff();
  for (Index i = threadIdx.x; i < count; i += kBlock)  // one that shows no noise is nowhere near
    places[i] = samples.shows[first + i] != 0 ? samples.places[(first + i) * point::kHeadRow] : Point{kInfinity, 0, 0};
  __syncthreads();
  for (Index i = threadIdx.x; i < count; i += kBlock) {
    const Point from = places[i];
    double squared[kPool];
    Index nearest[kPool];
#pragma unroll
    for (int n = 0; n < kPool; ++n) {
      squared[n] = __longlong_as_double(0x7ff0000000000000ll);
      nearest[n] = 0;
    }
    const Index among = from.x < kInfinity ? count : 0;  // of one that shows no noise nobody asks
    for (Index j = 0; j < among; ++j) {
      const Point to = places[j];
      const double x = double(from.x) - to.x, y = double(from.y) - to.y, z = double(from.z) - to.z;
      const double its = x * x + y * y + z * z;
      if (!(its < squared[kPool - 1])) continue;
#pragma unroll
      for (int n = kPool - 1; n >= 0; --n) {  // behind those as near, whose numbers are less
        const bool moves = n > 0 && its < squared[n - 1];
        if (its < squared[n]) {
          squared[n] = moves ? squared[n > 0 ? n - 1 : 0] : its;
          nearest[n] = moves ? nearest[n > 0 ? n - 1 : 0] : j;
        }
      }
    }
#pragma unroll
    for (int n = 0; n < kPool; ++n) pools[std::size_t(first + i) * kPool + n] = nearest[n];
  }
}

// A warp to each sample, which has the distances to all in shared memory, and takes the least of them after each other.
__global__ void __launch_bounds__(kWarp)
    fill_pool(const Point* rows, std::size_t row, const unsigned char* shows, Index samples, Index* pools) {
  extern __shared__ double squared[];
  const Index sample = blockIdx.x, lane = lane_number();
  if (shows[sample] == 0) return;
  constexpr double kInfinity = __builtin_inf();
  const Point from = rows[sample * row];
  double least = kInfinity;
  Index at = lane;
  for (Index i = lane; i < samples; i += kWarp) {
    const double its = shows[i] == 0 ? kInfinity : point::squared_length(point::offset_between(from, rows[i * row]));
    squared[i] = its;
    if (its < least) least = its, at = i;
  }
  for (int n = 0; n < kPool; ++n) {
    double least_of_all = least;
    Index nearest = at;
    for (int step = kWarp / 2; step > 0; step /= 2) {
      const double its = __shfl_xor_sync(kAllLanes, least_of_all, step);
      const Index whose = __shfl_xor_sync(kAllLanes, nearest, step);
      if (its < least_of_all || (its == least_of_all && whose < nearest)) least_of_all = its, nearest = whose;
    }
    if (lane == 0) pools[std::size_t(sample) * kPool + n] = least_of_all < kInfinity ? nearest : 0;
    if (at != nearest) continue;
    squared[at] = kInfinity;
    least = kInfinity;
    for (Index i = lane; i < samples; i += kWarp)
      if (squared[i] < least) least = squared[i], at = i;
  }
}

}  // namespace

void find_pools(Context& context, const Poolable& samples, Index* pools) {
  if (samples.clouds == 0) return;
  launch(context, "pooling samples", fill_pools, static_cast<unsigned>(samples.clouds), kBlock, samples, pools);
}

void find_pools(Context& context, const Point* rows, std::size_t row, const unsigned char* shows, std::size_t samples,
                Index* pools) {
  if (samples == 0) return;
  fill_pool<<<static_cast<unsigned>(samples), kWarp, samples * sizeof(double), context.stream()>>>(
      rows, row, shows, static_cast<Index>(samples), pools);
  check(cudaGetLastError(), "pooling samples");
}

}  // namespace pointfair::cuda
