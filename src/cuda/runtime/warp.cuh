// SPDX-License-Identifier: Apache-2.0
// What the 32 lanes of a warp do together.
#pragma once

namespace pointfair::cuda {

inline constexpr int kWarp = 32;
inline constexpr unsigned kAllLanes = 0xffffffffu;

__device__ inline unsigned lane_number() { return threadIdx.x % kWarp; }
__device__ inline unsigned lanes_below() { return (1u << lane_number()) - 1u; }

// Blocks of so many threads that a processor is to hold at once: `wanted`, or as many as the architecture can (CUDA
// programming guide, compute capabilities), since ptxas refuses launch bounds beyond that.
constexpr int resident_blocks(int wanted, int threads) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ == 750
  const int most_blocks = 16, most_threads = 1024;
#elif defined(__CUDA_ARCH__) && (__CUDA_ARCH__ == 860 || __CUDA_ARCH__ == 870)
  const int most_blocks = 16, most_threads = 1536;
#elif defined(__CUDA_ARCH__) && (__CUDA_ARCH__ == 890 || __CUDA_ARCH__ >= 1200)
  const int most_blocks = 24, most_threads = 1536;
#else
  const int most_blocks = 32, most_threads = 2048;
#endif
  const int most = most_threads / threads < most_blocks ? most_threads / threads : most_blocks;
  return wanted < most ? wanted : most;
}

// Not to be called in a short block under a condition that is the same in all lanes: ptxas of CUDA 13.0 turns such a
// block into predicated instructions and gives REDUX a wrong predicate (@!P0 for @!UP0), so it runs or not by chance.
__device__ inline unsigned warp_max(unsigned value) {
#if __CUDA_ARCH__ >= 800
  return __reduce_max_sync(kAllLanes, value);
#else
  for (int step = kWarp / 2; step > 0; step /= 2) value = max(value, __shfl_xor_sync(kAllLanes, value, step));
  return value;
#endif
}
__device__ inline unsigned warp_sum(unsigned value) {
#if __CUDA_ARCH__ >= 800
  return __reduce_add_sync(kAllLanes, value);
#else
  for (int step = kWarp / 2; step > 0; step /= 2) value += __shfl_xor_sync(kAllLanes, value, step);
  return value;
#endif
}
__device__ inline unsigned warp_min(unsigned value) { return ~warp_max(~value); }

// Floats as integers of the same order, so that integer reductions and atomics serve them. Exact, NaN excluded.
__device__ inline unsigned ordered(float x) {
  const unsigned bits = __float_as_uint(x);
  return bits ^ ((static_cast<int>(bits) >> 31) | 0x80000000u);
}
__host__ __device__ inline unsigned unordered_bits(unsigned o) { return (o & 0x80000000u) != 0 ? o ^ 0x80000000u : ~o; }
// The same for numbers that are compared for order only: both zeros are one.
__device__ inline unsigned ordered_number(float x) { return ordered(x + 0.0f); }
__device__ inline float unordered(unsigned o) { return __uint_as_float(unordered_bits(o)); }

// Words of shared memory by address. Ordered among themselves, but free to move past other accesses, so that loads of
// other arrays need not wait for these stores.
__device__ inline unsigned shared_address(const void* p) { return static_cast<unsigned>(__cvta_generic_to_shared(p)); }
__device__ inline void store_word(unsigned address, unsigned value) {
  asm volatile("st.shared.u32 [%0], %1;" ::"r"(address), "r"(value));
}
__device__ inline unsigned load_word(unsigned address) {
  unsigned value;
  asm volatile("ld.shared.u32 %0, [%1];" : "=r"(value) : "r"(address));
  return value;
}

}  // namespace pointfair::cuda
