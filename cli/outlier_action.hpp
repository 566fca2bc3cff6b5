// SPDX-License-Identifier: Apache-2.0
// --outliers classify, withheld and remove, as users write them, and what is said of them.
#pragma once

#include <filesystem>
#include <string>

#include "arguments.hpp"
#include "pointfair/pointfair.hpp"

namespace pointfair::cli {

/// The words of --outliers that act on the file alone.
inline constexpr const char* kOutlierActions = "classify[=CLASS]|withheld|remove";

/// Takes `--outliers classify`, `withheld` and `remove` out of the parameters; `mark` stays there in their place.
/// Throws ErrorKind::usage for a class that is none.
OutlierAction take_outlier_action(ParamArguments& params);

/// Refuses before the run what would fail after it, writing to `output`. Throws ErrorKind::usage.
void check_outlier_action(const OutlierAction& action, Outliers outliers, const Cloud& cloud,
                          const std::filesystem::path& output, const WriteOptions& options);

/// A sentence on what was done and, where many of the outliers were vegetation or wires, on how to leave these out.
std::string outcome_text(const OutlierAction& action, const OutlierOutcome& outcome);

}  // namespace pointfair::cli
