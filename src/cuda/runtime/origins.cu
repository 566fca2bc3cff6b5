// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/callers_rows.cuh"
#include "cuda/runtime/origins.cuh"
#include "cuda/runtime/warp.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256, kWarps = kBlock / kWarp;
constexpr double kLarge = 4;  // as in src/io/origin_sample.cpp

// Over a block, of a value a thread; all get it.
template <class T, class Combine>
__device__ T over_block(T value, T (&shared)[kWarps], const Combine& combine) {
  for (int step = kWarp / 2; step > 0; step /= 2) value = combine(value, __shfl_xor_sync(kAllLanes, value, step));
  __syncthreads();
  if (lane_number() == 0) shared[threadIdx.x / kWarp] = value;
  __syncthreads();
  value = shared[0];
  for (int warp = 1; warp < kWarps; ++warp) value = combine(value, shared[warp]);
  return value;
}

// A block to each cloud, over its sample.
template <class T>
__global__ void __launch_bounds__(kBlock)
    look_for_origins(Rows<const T> from, const unsigned* ends, unsigned char* surely_none) {
  __shared__ double doubles[kWarps];
  __shared__ unsigned counts[kWarps];
  const std::size_t begin = blockIdx.x == 0 ? 0 : ends[blockIdx.x - 1], end = ends[blockIdx.x];
  const unsigned long long limit = sample_limit(end - begin);
  const auto for_sampled = [&](const auto& body) {
    unsigned sampled = 0;
    for (std::size_t i = begin + threadIdx.x; i < end; i += kBlock) {
      const double p[3] = {from.at(i, 0), from.at(i, 1), from.at(i, 2)};
      if (limit != ~0ull && !is_sampled(p, limit)) continue;
      ++sampled;
      if (isfinite(p[0] + p[1] + p[2])) body(p);
    }
    return sampled;
  };
  const auto add = [](unsigned a, unsigned b) { return a + b; };
  double least[3], most[3], low[3], high[3];
  for (int axis = 0; axis < 3; ++axis) {
    least[axis] = __longlong_as_double(0x7ff0000000000000ll);
    most[axis] = -least[axis];
  }
  unsigned finite = 0;
  unsigned sampled = for_sampled([&](const double(&p)[3]) {
    ++finite;
    for (int axis = 0; axis < 3; ++axis) {
      least[axis] = fmin(least[axis], p[axis]);
      most[axis] = fmax(most[axis], p[axis]);
    }
  });
  sampled = over_block(sampled, counts, add);
  finite = over_block(finite, counts, add);
  double size = 0, least_extent = 0;
  for (int axis = 0; axis < 3; ++axis) {
    least[axis] = over_block(least[axis], doubles, [](double a, double b) { return fmin(a, b); });
    most[axis] = over_block(most[axis], doubles, [](double a, double b) { return fmax(a, b); });
    const double quarter = (most[axis] - least[axis]) / 4;
    low[axis] = least[axis] + quarter;
    high[axis] = most[axis] - quarter;
    size = fmax(size, fmax(fabs(least[axis]), fabs(most[axis])));
  }
  unsigned lows[3] = {}, highs[3] = {};
  for_sampled([&](const double(&p)[3]) {
    for (int axis = 0; axis < 3; ++axis) {
      lows[axis] += p[axis] <= low[axis];
      highs[axis] += p[axis] >= high[axis];
    }
  });
  for (int axis = 0; axis < 3; ++axis) {
    const unsigned its_lows = over_block(lows[axis], counts, add), its_highs = over_block(highs[axis], counts, add);
    if (min(its_lows, its_highs) > finite / 20) least_extent = fmax(least_extent, high[axis] - low[axis]);
  }
  if (threadIdx.x != 0) return;
  const bool is_sample = limit == ~0ull || sampled >= kFewSampled;
  surely_none[blockIdx.x] = is_sample && (finite == 0 || (least_extent > 0 && size <= kLarge * least_extent));
}

}  // namespace

std::vector<std::uint8_t> surely_have_no_origin(Context& context, const DevicePoints& points, const unsigned* ends,
                                                std::size_t clouds) {
  std::vector<std::uint8_t> result(clouds);
  if (clouds == 0) return result;
  DeviceArray<unsigned char> found(context);
  found.resize(clouds);
  with_type(points.type, [&]<class T>(T*) {
    look_for_origins<T>
        <<<static_cast<unsigned>(clouds), kBlock, 0, context.stream()>>>(rows_of<const T>(points), ends, found.data());
  });
  check(cudaGetLastError(), "looking for origins");
  found.download(result, "looking for origins");
  context.finish();
  return result;
}

}  // namespace pointfair::cuda
