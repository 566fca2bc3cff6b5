// SPDX-License-Identifier: Apache-2.0
// Method::implicit: one system of equations for all points (docs/methods.md, Eq. 28).
#pragma once

#include <stop_token>

#include "cuda/stages/list_stages.cuh"
#include "pointfair/report.hpp"
#include "seam/settings.hpp"

namespace pointfair::cuda {

// Over lists, in the order of an index along a curve, which is that of the sums. Waits for the card. Memory, bytes a
// point: that of the graph (weighted_graph.cuh), and 96.
SolverReport fair_implicitly(Context& context, const Tree& tree, const Lists& lists, const FairingSettings& settings,
                             const FairedPoints& faired, const std::stop_token& stop);

}  // namespace pointfair::cuda
