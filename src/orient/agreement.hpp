// SPDX-License-Identifier: Apache-2.0
// Signs for the nodes of a graph whose edges say how much their ends agree.
#pragma once

#include <cstdint>
#include <vector>

namespace pointfair::orient {

/// 1: both ends have one sign; -1: they have opposite ones; 0: nothing is known.
struct Edge {
  float agreement;
  std::uint32_t a, b;
};

struct Signs {
  std::vector<std::int8_t> sign;    ///< of each node, 1 or -1, against the others of its part
  std::vector<std::uint32_t> part;  ///< nodes that edges connect have one, from 0
  std::uint32_t parts = 0;
};

/// Signs that agree with the edges as well as can be found fast: sure edges first, as in a minimum spanning tree
/// (Hoppe et al. 1992); what they join is then joined by the sum of all edges between two groups, the greatest sum
/// first. Reorders `edges`. Any order of them gives the same signs. O(E log E).
Signs agreeing_signs(std::uint32_t nodes, std::vector<Edge>& edges);

}  // namespace pointfair::orient
