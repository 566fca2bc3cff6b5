// SPDX-License-Identifier: Apache-2.0
// The kernels of each instruction set.
#pragma once

#include "cpu/kernels.h"

#if defined(__x86_64__)
namespace pointfair::cpu {

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

}  // namespace pointfair::cpu
#endif
