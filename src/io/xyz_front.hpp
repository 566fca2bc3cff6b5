// SPDX-License-Identifier: Apache-2.0
// What precedes the first row of a text with columns of numbers: titles, remarks, names, units, a count.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/coordinate_names.hpp"
#include "pointfair/io.hpp"

namespace pointfair::io {

struct XyzFront {
  std::size_t end = 0;      ///< where the first point's line begins
  std::size_t columns = 0;  ///< of the first point's line
  char line_end = '\n';
  char separator = ' ';            ///< of the words in a row
  char decimal = '.';              ///< or ','
  std::vector<std::string> names;  ///< of all columns
  std::size_t named = 0;           ///< how many of them the file or the options name
  bool is_by_place = false;        ///< names follow from how many columns there are
  AxisColumns coordinates{0, 1, 2};
  std::size_t names_end = 0;  ///< where the line with the names takes further ones; 0: there is none
  char names_separator = ' ';
  std::optional<std::uint64_t> count;  ///< of rows, as a line of one number says
  bool has_titles = false;             ///< lines that say nothing about the columns
  bool is_doubtful = false;            ///< with one more name, lines that are none of rows might pass for some
};

/// Throws Error(file) in the name of `name` if no row of numbers is found, or if it is not known which columns are the
/// coordinates.
XyzFront read_xyz_front(std::string_view text, const std::string& name, const ReadOptions& options, Format format);

}  // namespace pointfair::io
