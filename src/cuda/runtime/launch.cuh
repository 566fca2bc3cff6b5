// SPDX-License-Identifier: Apache-2.0
// Kernels that are brought to the card while the one before still runs (programmatic dependent launch, CUDA programming
// guide; from compute capability 9.0 on, elsewhere ordinary launches).
#pragma once

#include <utility>

#include "cuda/runtime/memory.cuh"

namespace pointfair::cuda {

// First call of every kernel that launch_early() starts, by all threads: lets the kernel after it come, and waits until
// the one before is done and its writes are seen. Until then no thread may touch device memory or return, since the
// kernel after next only waits for this one.
__device__ __forceinline__ void begin_kernel() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  cudaTriggerProgrammaticLaunchCompletion();
  cudaGridDependencySynchronize();
#endif
}

template <class... Parameters, class... Arguments>
void launch_early(const Context& context, const char* doing, void (*kernel)(Parameters...), unsigned blocks,
                  unsigned threads, Arguments&&... arguments) {
  cudaLaunchAttribute early{};
  early.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  early.val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = blocks;
  config.blockDim = threads;
  config.stream = context.stream();
  config.attrs = &early;
  config.numAttrs = context.launches_early() ? 1 : 0;
  check(cudaLaunchKernelEx(&config, kernel, std::forward<Arguments>(arguments)...), doing);
}

}  // namespace pointfair::cuda
