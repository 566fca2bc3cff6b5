// SPDX-License-Identifier: Apache-2.0
// The caller's positions as kernels see them, and which of them are of a sample.
#pragma once

#include <cstddef>
#include <cstdint>

#include "pointfair/device_points.hpp"

namespace pointfair::cuda {

// Strides in scalars.
template <class T>
struct Rows {
  T* data;
  std::ptrdiff_t row, column;
  __device__ T& at(std::size_t i, int axis) const { return data[static_cast<std::ptrdiff_t>(i) * row + axis * column]; }
};
template <class T, class Memory>
Rows<T> rows_of(const PointsOnCard<Memory>& points) {
  return {static_cast<T*>(points.data), points.row_stride, points.column_stride};
}

// Calls with a null pointer of the type that the scalars have.
template <class Call>
void with_type(ScalarType type, const Call& call) {
  if (type == ScalarType::float64) {
    call(static_cast<double*>(nullptr));
  } else {
    call(static_cast<float*>(nullptr));
  }
}

// As OriginSample of src/io/origin_sample.hpp: positions of a sample, and how few may be chosen by chance.
inline constexpr std::uint64_t kSampledPositions = 4096;
inline constexpr unsigned kFewSampled = 64;
__host__ __device__ constexpr unsigned long long sample_limit(std::size_t count) {
  return count > kSampledPositions ? ~0ull / count * kSampledPositions : ~0ull;
}
__device__ __forceinline__ bool is_sampled(const double (&p)[3], unsigned long long limit) {
  unsigned long long hash = 0x9e3779b97f4a7c15ull;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    hash = (hash ^ static_cast<unsigned long long>(__double_as_longlong(p[axis] + 0.0))) * 0xff51afd7ed558ccdull;
    hash ^= hash >> 33;
  }
  return hash * 0xc4ceb9fe1a85ec53ull <= limit;
}

}  // namespace pointfair::cuda
