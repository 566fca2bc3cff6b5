// SPDX-License-Identifier: Apache-2.0
// Points chosen by the values of an attribute, such as the classes of a survey.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"

namespace pointfair {

/// The points whose attribute has one of some integers.
struct Selection {
  std::string attribute;
  std::vector<std::array<std::int64_t, 2>> ranges;  ///< first and last of each, both included
  friend bool operator==(const Selection&, const Selection&) = default;
};

/// Reads "classification=2,6,64-255": an attribute, and integers and ranges of them. Several with ';' between them.
/// Throws ErrorKind::usage with `name`, the flag, and the form.
POINTFAIR_EXPORT std::vector<Selection> parse_selections(std::string_view name, std::string_view text);

/// The text that parse_selections reads.
POINTFAIR_EXPORT std::string selections_text(const std::vector<Selection>& selections);

/// 1 for each point of the cloud that the selection contains, else 0. The attribute is that of meant_attribute. Throws
/// ErrorKind::usage if the cloud has none such, or it is not one integer a point, of any type. O(N), and what reading
/// the attribute costs.
POINTFAIR_EXPORT std::vector<std::uint8_t> selected_points(const Selection& selection, const Cloud& cloud);

}  // namespace pointfair
