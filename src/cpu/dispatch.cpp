// SPDX-License-Identifier: Apache-2.0
// Chooses the kernels for this processor.
#if defined(__x86_64__)
#include <cpuid.h>
#endif

#include <cstdlib>
#include <string_view>

#include "cpu/instruction_sets.h"

namespace pointfair::cpu {

#if defined(__x86_64__)
// What the processor has and the system keeps the registers of (Intel's manual, volume 1, 14.3). Not by
// __builtin_cpu_supports: it asks the compiler's run time library, and that of zig always says no.
struct Processor {
  bool has_avx2 = false, has_avx_vnni = false, has_avx512 = false, has_avx512_vnni = false;

  Processor() {
    unsigned a = 0, b = 0, c = 0, d = 0;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & bit_OSXSAVE) == 0) return;
    unsigned kept = 0, high = 0;
    __asm__("xgetbv" : "=a"(kept), "=d"(high) : "c"(0));
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d)) return;
    constexpr unsigned kAvx = 0x06, kAvx512 = 0xe6;  // registers that are kept
    constexpr unsigned kUsed = bit_AVX512F | bit_AVX512DQ | bit_AVX512BW | bit_AVX512VL;
    constexpr unsigned kAvx512Vnni = 1u << 11, kAvxVnni = 1u << 4;
    has_avx2 = (kept & kAvx) == kAvx && (b & bit_AVX2) != 0;
    has_avx512 = (kept & kAvx512) == kAvx512 && (b & kUsed) == kUsed;
    has_avx512_vnni = has_avx512 && (c & kAvx512Vnni) != 0;
    if (has_avx2 && __get_cpuid_count(7, 1, &a, &b, &c, &d)) has_avx_vnni = (a & kAvxVnni) != 0;
  }
};
static const Processor& processor() {
  static const Processor its;
  return its;
}

bool has_avx2() { return processor().has_avx2; }
bool has_avx512() { return processor().has_avx512; }
bool has_avx512_vnni() { return processor().has_avx512_vnni; }
bool has_avx_vnni() { return processor().has_avx_vnni; }

// Whether the limit that the environment sets, if any, is not below that of this name.
static bool may_use(std::string_view name) {
  const char* wanted = std::getenv("POINTFAIR_ISA");
  const std::string_view limit = wanted ? wanted : "";
  constexpr std::string_view kOrder[] = {"sse2", "avx2", "avxvnni", "avx512"};
  for (const std::string_view one : kOrder) {
    if (one == name) return true;
    if (one == limit) return false;
  }
  return true;
}

static const Kernels& choose_kernels() {
  if (has_avx512() && may_use("avx512")) return avx512::kKernels;
  if (has_avx2() && may_use("avx2")) return avx2::kKernels;
  return sse2::kKernels;
}
static const NetKernels& choose_net_kernels() {
  if (has_avx512_vnni() && may_use("avx512vnni")) return avx512vnni::kNetKernels;
  if (has_avx512() && may_use("avx512")) return avx512::kNetKernels;
  if (has_avx_vnni() && may_use("avxvnni")) return avxvnni::kNetKernels;
  if (has_avx2() && may_use("avx2")) return avx2::kNetKernels;
  return sse2::kNetKernels;
}
#elif defined(__aarch64__)
namespace neon {  // of every such processor
extern const Kernels kKernels;
extern const NetKernels kNetKernels;
}  // namespace neon

static const Kernels& choose_kernels() { return neon::kKernels; }
static const NetKernels& choose_net_kernels() { return neon::kNetKernels; }
#else
namespace generic {
extern const Kernels kKernels;
extern const NetKernels kNetKernels;
}  // namespace generic

static const Kernels& choose_kernels() { return generic::kKernels; }
static const NetKernels& choose_net_kernels() { return generic::kNetKernels; }
#endif

const Kernels& best_kernels() {
  static const Kernels& chosen = choose_kernels();
  return chosen;
}
const NetKernels& best_net_kernels() {
  static const NetKernels& chosen = choose_net_kernels();
  return chosen;
}

}  // namespace pointfair::cpu

namespace pointfair {

const SampleFits& sample_fits() { return cpu::best_kernels().fits; }

}  // namespace pointfair
