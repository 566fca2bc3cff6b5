// SPDX-License-Identifier: Apache-2.0
// Chooses the kernels for this processor.
#if defined(__x86_64__)
#include <cpuid.h>
#endif

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

// What the processor has and the system keeps the registers of (Intel's manual, volume 1, 14.3). Not by
// __builtin_cpu_supports: it asks the compiler's run time library, and that of zig always says no.
struct Processor {
  bool has_avx2 = false, has_avx512 = false;

  Processor() {
    unsigned a = 0, b = 0, c = 0, d = 0;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & bit_OSXSAVE) == 0) return;
    unsigned kept = 0, high = 0;
    __asm__("xgetbv" : "=a"(kept), "=d"(high) : "c"(0));
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d)) return;
    constexpr unsigned kAvx = 0x06, kAvx512 = 0xe6;  // registers that are kept
    constexpr unsigned kUsed = bit_AVX512F | bit_AVX512DQ | bit_AVX512BW | bit_AVX512VL;
    has_avx2 = (kept & kAvx) == kAvx && (b & bit_AVX2) != 0;
    has_avx512 = (kept & kAvx512) == kAvx512 && (b & kUsed) == kUsed;
  }
};

static const Kernels& choose_kernels() {
  const Processor processor;
  const char* wanted = std::getenv("POINTFAIR_ISA");
  const std::string_view limit = wanted ? wanted : "";
  if (processor.has_avx512 && limit != "avx2" && limit != "sse2") return avx512::kKernels;
  if (processor.has_avx2 && limit != "sse2") return avx2::kKernels;
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
