// SPDX-License-Identifier: Apache-2.0
// What `pointfair info` says of the file behind a cloud, and of the classes and returns of its points.
#pragma once

#include <string>
#include <string_view>

#include "report.hpp"

namespace pointfair::cli {

/// What a LAS class means (LAS 1.4 R15, table 17).
std::string_view class_name(unsigned value);

/// Rows for people; empty for a file that says nothing and has neither classes nor returns.
std::string file_text(const Cloud& cloud);

/// {"version": ..., "metres_per_unit": ..., "geographic": ..., "step": ..., "classes": {"2": 10}, "returns": {"1": 12}}
Json file_json(const Cloud& cloud);

}  // namespace pointfair::cli
