// SPDX-License-Identifier: Apache-2.0
// The net's kernels, compiled once per instruction set with POINTFAIR_ISA naming it, as those of src/cpu/kernels.cpp:
// for more of them, since its products of bytes have instructions of their own.
#include "cpu/net_loops.h"

namespace pointfair::cpu::POINTFAIR_ISA {

extern const NetKernels kNetKernels;
const NetKernels kNetKernels = {POINTFAIR_ISA_LABEL, net_slide, net_begin, net_store, net_layer};

}  // namespace pointfair::cpu::POINTFAIR_ISA
