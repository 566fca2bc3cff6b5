// SPDX-License-Identifier: Apache-2.0
// What differs between a cloud and its denoised copy, point by point and attribute by attribute.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pointfair/pointfair.hpp"
#include "statistics.hpp"

namespace pointfair::cli {

struct Comparison {
  /// An attribute that both have: at how many points it differs.
  struct Row {
    std::string what;
    std::uint64_t differ = 0;
    bool has_bytes = true;  ///< values of one type were compared
  };
  std::vector<float> moved;  ///< how far each point moved, in file units; NaN where a position is not finite
  std::uint64_t kept = 0;    ///< points at their old place
  Statistics displacement;   ///< of the finite points
  std::vector<Row> rows;
  std::optional<std::uint64_t> faces_that_differ;  ///< in their corners; nothing unless both have faces
  std::vector<std::string> lost, added;            ///< attributes, and faces, that one of the clouds has
};

/// Throws ErrorKind::usage where both files say their unit and these differ. `names` are those of the files, for
/// errors.
void check_same_unit(const Cloud& a, const Cloud& b, const std::string& names);

/// `names` are those of the files, for errors. Throws ErrorKind::file if the numbers of points differ: then points
/// cannot be told from each other; and if an octree gave those of `after` another order; and as check_same_unit does.
/// O(N) for each attribute.
Comparison compare_copies(const Cloud& before, const Cloud& after, const std::string& names);

}  // namespace pointfair::cli
