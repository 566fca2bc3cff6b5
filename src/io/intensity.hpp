// SPDX-License-Identifier: Apache-2.0
// Intensity as LAS has it: whole numbers from 0 to 65535.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "io/table.hpp"

namespace pointfair::io {

/// Whether the values of a column of the type fit as they are.
bool is_las_intensity(std::span<const char> data, NativeType type);

/// Which of the names is that of the intensity: "intensity", else the first that differs in its capitals only; or their
/// number.
std::size_t find_intensity(const std::vector<std::string>& names);

/// Makes the column of the intensity fit: values from 0 to 65535 are rounded, those from 0 to 1 become 65535 times as
/// large, others are spread from the least to the greatest.
void use_las_intensity(Table& table);

}  // namespace pointfair::io
