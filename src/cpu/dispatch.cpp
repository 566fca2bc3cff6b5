// SPDX-License-Identifier: Apache-2.0
// Chooses the kernels for this processor.
#include <cstdlib>
#include <string_view>

#if defined(__x86_64__)
#include <cpuid.h>
#endif

#include "cpu/kernels.h"

namespace pointfair::cpu {

#if defined(__x86_64__)
namespace sse2 {
extern const Kernels kKernels;
extern const NetKernels kNetKernels;
}  // namespace sse2
namespace avx2 {
extern const Kernels kKernels;
extern const NetKernels kNetKernels;
}  // namespace avx2
namespace avxvnni {
extern const NetKernels kNetKernels;
}
namespace avx512 {
extern const Kernels kKernels;
extern const NetKernels kNetKernels;
}  // namespace avx512
namespace avx512vnni {
extern const NetKernels kNetKernels;
}

bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
         __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
}
bool has_avx512_vnni() { return has_avx512() && __builtin_cpu_supports("avx512vnni"); }
bool has_avx_vnni() {  // not every compiler knows its name
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __builtin_cpu_supports("avx2") && __get_cpuid_count(7, 1, &a, &b, &c, &d) != 0 && (a >> 4 & 1u) != 0;
}

static std::string_view limit() {
  const char* wanted = std::getenv("POINTFAIR_ISA");
  return wanted ? wanted : "";
}
// Whether the limit, if any, is not below that of this name.
static bool may_use(std::string_view name) {
  constexpr std::string_view kOrder[] = {"sse2", "avx2", "avxvnni", "avx512"};
  for (const std::string_view one : kOrder) {
    if (one == name) return true;
    if (one == limit()) return false;
  }
  return true;
}

static const Kernels& choose_kernels() {
  if (has_avx512() && may_use("avx512")) return avx512::kKernels;
  if (__builtin_cpu_supports("avx2") && may_use("avx2")) return avx2::kKernels;
  return sse2::kKernels;
}
static const NetKernels& choose_net_kernels() {
  if (has_avx512_vnni() && may_use("avx512vnni")) return avx512vnni::kNetKernels;
  if (has_avx512() && may_use("avx512")) return avx512::kNetKernels;
  if (has_avx_vnni() && may_use("avxvnni")) return avxvnni::kNetKernels;
  if (__builtin_cpu_supports("avx2") && may_use("avx2")) return avx2::kNetKernels;
  return sse2::kNetKernels;
}
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
