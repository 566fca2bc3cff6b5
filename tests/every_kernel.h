// SPDX-License-Identifier: Apache-2.0
// The CPU's kernels of every instruction set that this processor has.
#pragma once

#include <vector>

#include "cpu/kernels.h"

#if defined(__x86_64__)
namespace pointfair::cpu {
namespace sse2 {
extern const Kernels kKernels;
}
namespace avx2 {
extern const Kernels kKernels;
}
namespace avx512 {
extern const Kernels kKernels;
}
}  // namespace pointfair::cpu
#endif

namespace pointfair {

inline std::vector<const cpu::Kernels*> available_kernels() {
#if defined(__x86_64__)
  std::vector<const cpu::Kernels*> result = {&cpu::sse2::kKernels};
  if (__builtin_cpu_supports("avx2")) result.push_back(&cpu::avx2::kKernels);
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512vl"))
    result.push_back(&cpu::avx512::kKernels);
  return result;
#else
  return {&cpu::best_kernels()};
#endif
}

}  // namespace pointfair
