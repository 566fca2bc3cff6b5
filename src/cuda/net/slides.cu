// SPDX-License-Identifier: Apache-2.0
#include "cuda/net/slides.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;

// A point a thread, as the next two.
__global__ void __launch_bounds__(kBlock) start_points(const __grid_constant__ NetCloud cloud) {
  const Index at = blockIdx.x * kBlock + threadIdx.x;
  if (at < cloud.places) cloud.step[at] = cloud.place(at).classical;
}

__global__ void __launch_bounds__(kBlock)
    slide_points(const __grid_constant__ NetCloud cloud, const Index* list, const Vec* from, Vec* to) {
  const Index at = blockIdx.x * kBlock + threadIdx.x;
  if (at >= cloud.places) return;
  const net::Place start = cloud.place(at);
  const Vec here = from[at];
  if (!net::can_move(start)) {
    to[at] = here;
    return;
  }
  Vec offsets[net::kNeighbors];
  float squares = 0;
#pragma unroll
  for (int e = 0; e < net::kNeighbors; ++e) {
    offsets[e] = net::along_plane(from[NetCloud::listed(list, at, e)] - here, start.normal);
    squares = squares + point::squared_length(offsets[e]);
  }
  const float per_mean_square = net::per_mean_square(squares);
  Vec pushes{};
#pragma unroll
  for (int e = 0; e < net::kNeighbors; ++e) pushes = pushes + net::push_of(offsets[e], per_mean_square);
  to[at] = net::slid(start, here, pushes);
}

__global__ void __launch_bounds__(kBlock) place_slid_points(const __grid_constant__ NetCloud cloud) {
  const Index at = blockIdx.x * kBlock + threadIdx.x;
  if (at >= cloud.places) return;
  const net::Place start = cloud.place(at);
  const Vec slid = cloud.step[at];
  cloud.step[at] = net::can_move(start) ? net::in_noises(start, slid - start.classical) : Vec{};
  cloud.classical[at] = {slid.x, slid.y, slid.z, start.noise};
}

}  // namespace

void begin_slides(Context& context, const NetCloud& cloud) {
  launch(context, "beginning the net", start_points, blocks_for(cloud.places, kBlock), kBlock, cloud);
}

void slide(Context& context, const NetCloud& cloud, const Index* list, const Vec* from, Vec* to) {
  launch(context, "beginning the net", slide_points, blocks_for(cloud.places, kBlock), kBlock, cloud, list, from, to);
}

void end_slides(Context& context, const NetCloud& cloud) {
  launch(context, "beginning the net", place_slid_points, blocks_for(cloud.places, kBlock), kBlock, cloud);
}

}  // namespace pointfair::cuda
