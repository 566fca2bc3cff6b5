// SPDX-License-Identifier: Apache-2.0
// What a run in tiles does to the outliers of its files beside leaving them where they are.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "options/height_grid.hpp"
#include "scale/emit.hpp"

namespace pointfair::scale {

/// Why tiles cannot do it to this file; empty if they can. Throws ErrorKind::usage for an attribute that holds no
/// classes, or not this one.
std::string why_no_outlier_action(const OutlierAction& action, const Source& source);

/// The attribute that the file gets and does not have; empty: none.
std::string added_outlier_attribute(const OutlierAction& action, const Params& params, const Source& source);

/// Adds the points of the file that are no outliers.
void add_heights(const TileResults& results, unsigned threads, HeightGrid& heights);

void save(const HeightGrid& heights, const std::filesystem::path& path);
HeightGrid load_heights(const std::filesystem::path& path);

/// What one file is written with, and what it came to.
struct OutlierEdits {
  std::vector<Attribute> added;
  std::vector<std::uint8_t> removed;  ///< of each point; empty: none is
  OutlierOutcome outcome;
};
void add(OutlierOutcome& to, const OutlierOutcome& more);

/// Of the file that the results are of. `heights`: of all files, where the action needs them. Two bytes a point of the
/// file.
OutlierEdits outlier_edits(const TileResults& results, const Plan& plan, const std::shared_ptr<const Source>& source,
                           const HeightGrid& heights, unsigned threads);

}  // namespace pointfair::scale
