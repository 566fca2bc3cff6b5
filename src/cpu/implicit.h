// SPDX-License-Identifier: Apache-2.0
// Method::implicit: one system of equations for all points (docs/methods.md, Eq. 28).
#pragma once

#include <span>
#include <stop_token>

#include "cpu/weighted_graph.h"
#include "pointfair/report.hpp"

namespace pointfair::cpu {

// Moved positions in sorted order. Memory while it runs: that of the graph, and 120 bytes a point.
SolverReport fair_implicitly(const GraphSource& source, const FairingSettings& settings, std::span<Point> out,
                             const std::stop_token& stop);

}  // namespace pointfair::cpu
