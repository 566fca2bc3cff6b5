// SPDX-License-Identifier: Apache-2.0
// The CPU's kernels of every instruction set that this processor has.
#pragma once

#include <vector>

#include "cpu/instruction_sets.h"

namespace pointfair {

inline std::vector<const cpu::Kernels*> available_kernels() {
#if defined(__x86_64__)
  std::vector<const cpu::Kernels*> result = {&cpu::sse2::kKernels};
  if (__builtin_cpu_supports("avx2")) result.push_back(&cpu::avx2::kKernels);
  if (cpu::has_avx512()) result.push_back(&cpu::avx512::kKernels);
  return result;
#else
  return {&cpu::best_kernels()};
#endif
}

inline std::vector<const cpu::NetKernels*> available_net_kernels() {
#if defined(__x86_64__)
  std::vector<const cpu::NetKernels*> result = {&cpu::sse2::kNetKernels};
  if (__builtin_cpu_supports("avx2")) result.push_back(&cpu::avx2::kNetKernels);
  if (cpu::has_avx_vnni()) result.push_back(&cpu::avxvnni::kNetKernels);
  if (cpu::has_avx512()) result.push_back(&cpu::avx512::kNetKernels);
  if (cpu::has_avx512_vnni()) result.push_back(&cpu::avx512vnni::kNetKernels);
  return result;
#else
  return {&cpu::best_net_kernels()};
#endif
}

}  // namespace pointfair
