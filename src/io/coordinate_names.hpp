// SPDX-License-Identifier: Apache-2.0
// Which columns are the coordinates, by the names that programs and people give them.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace pointfair::io {

using AxisColumns = std::array<std::size_t, 3>;

/// The column of each axis: "x", "X [m]", "Points:0", "Easting", "Rechtswert" and so on. Where several could be meant,
/// the plainest name counts. A missing axis has the number of columns.
AxisColumns find_axes(const std::vector<std::string>& names);

/// The same if all three axes are there.
std::optional<AxisColumns> find_coordinates(const std::vector<std::string>& names);

/// The columns as a message names them, the first ones.
std::string listed(const std::vector<std::string>& names);

/// Gives names that were there before a number: i, i_2. None has more bytes than `longest`.
void make_distinct(std::vector<std::string>& names, std::size_t longest = std::string::npos);

}  // namespace pointfair::io
