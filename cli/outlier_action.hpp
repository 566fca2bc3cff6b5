// SPDX-License-Identifier: Apache-2.0
// What becomes of outliers in the file beside the library's own words: --outliers classify, withheld and
// remove.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "pointfair/pointfair.hpp"

namespace pointfair::cli {

struct OutlierAction {
  enum class Kind : std::uint8_t { none, classify, withhold, remove };
  Kind kind = Kind::none;
  std::optional<std::uint8_t> value;  ///< the class of all outliers; unset: 7 below the surface, 18 above
};

/// The words of --outliers that act on the file alone.
inline constexpr const char* kOutlierActions = "classify[=CLASS]|withheld|remove";

/// Takes `--outliers classify`, `withheld` and `remove` out of the parameters; `mark` stays there in their place.
/// Throws ErrorKind::usage for a class that is none.
OutlierAction take_outlier_action(ParamArguments& params);

/// Refuses before the run what would fail after it, writing to `output`. Throws ErrorKind::usage.
void check_outlier_action(const OutlierAction& action, const Cloud& cloud, const std::filesystem::path& output,
                          const WriteOptions& options);

/// Puts outliers into their classes, or sets their flag. `reasons` as Pipeline::outliers, `before` where points were.
/// Returns a sentence on what was done and, where many of the outliers were vegetation or wires, on how to leave these
/// out. Removes none: without_points() does. O(N).
std::string act_on_outliers(const OutlierAction& action, std::span<const std::uint8_t> reasons,
                            std::span<const Point> before, Cloud& cloud);

}  // namespace pointfair::cli
