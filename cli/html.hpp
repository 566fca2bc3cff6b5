// SPDX-License-Identifier: Apache-2.0
// The parts of a page that stands alone: no script, and nothing that is fetched.
#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace pointfair::cli {

/// With the characters that HTML gives a meaning to written as what they are.
std::string escaped(std::string_view text);

using Pairs = std::vector<std::pair<std::string, std::string>>;

/// A table of names and values; pairs without a value are left out, and no pairs are no table.
std::string table_of(std::string_view caption, const Pairs& pairs);
/// A table whose first row has the names of the columns.
std::string grid_of(std::string_view caption, const std::vector<std::vector<std::string>>& rows);

/// A picture with its words; `alt` says what there is to see to who does not.
std::string figure_of(const std::string& png, std::string_view alt, std::string_view caption,
                      std::string_view more_html = {});

/// The colours of a map with what its ends mean.
std::string scale_of(std::span<const char* const> colours, std::string_view low, std::string_view high);

/// Bars of counts over equal steps from 0 to `most`, as a drawing; `alt` as above.
std::string histogram_of(const std::vector<double>& counts, std::string_view alt, std::string_view most,
                         std::string_view axis);

/// Parts beside each other, where there is room.
std::string beside(std::initializer_list<std::string_view> html);

std::string section_of(std::string_view title, std::string_view html);

/// The page. `title` and `lead` are plain text, `html` is the sections.
std::string page_of(std::string_view title, std::string_view lead, std::string_view html);

}  // namespace pointfair::cli
