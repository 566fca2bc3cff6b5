// SPDX-License-Identifier: Apache-2.0
// The seam's refine() with the kernels of any instruction set, which all give the same bits.
#pragma once

#include "cpu/kernels.h"
#include "seam/refinement.hpp"

namespace pointfair::cpu {

void refine(const Classical& classical, const NetWeights& weights, const Frame& frame, const Kernels& kernels,
            const NetKernels& net_kernels, std::span<Point> out, const std::stop_token& stop,
            const NetProgress& progress = {});

}  // namespace pointfair::cpu
