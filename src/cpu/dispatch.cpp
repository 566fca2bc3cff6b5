// SPDX-License-Identifier: Apache-2.0
// Chooses the kernels for this processor.
#include <cstdlib>
#include <string_view>

#include "cpu/kernels.h"

namespace pointfair::cpu {

#if defined(__x86_64__)
namespace sse2 {
extern const Kernels kKernels;
}
namespace avx2 {
extern const Kernels kKernels;
}
namespace avx512 {
extern const Kernels kKernels;
}

static const Kernels& choose_kernels() {
  const char* wanted = std::getenv("POINTFAIR_ISA");
  const std::string_view limit = wanted ? wanted : "";
  const bool has_avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                          __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
  if (has_avx512 && limit != "avx2" && limit != "sse2") return avx512::kKernels;
  if (__builtin_cpu_supports("avx2") && limit != "sse2") return avx2::kKernels;
  return sse2::kKernels;
}
#else
namespace generic {
extern const Kernels kKernels;
}

static const Kernels& choose_kernels() { return generic::kKernels; }
#endif

const Kernels& best_kernels() {
  static const Kernels& chosen = choose_kernels();
  return chosen;
}

}  // namespace pointfair::cpu
