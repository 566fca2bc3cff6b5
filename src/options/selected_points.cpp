// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "pointfair/selection.hpp"

namespace pointfair {
namespace {

[[noreturn]] void refuse(std::string_view name, std::string_view text) {
  throw Error(ErrorKind::usage,
              "--" + std::string(name) + " cannot be '" + std::string(text.substr(0, 60)) +
                  "': give an attribute and integers or ranges of them, as in classification=2,6,64-255");
}

// Takes an integer off the front of `text`; false: there is none.
bool take_integer(std::string_view& text, std::int64_t& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return true;
}

bool take(std::string_view& text, char wanted) {
  if (!text.starts_with(wanted)) return false;
  text.remove_prefix(1);
  return true;
}

Selection parse_one(std::string_view name, std::string_view text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos || equals == 0) refuse(name, text);
  Selection selection{std::string(text.substr(0, equals)), {}};
  std::string_view rest = text.substr(equals + 1);
  do {
    std::int64_t first = 0;
    if (!take_integer(rest, first)) refuse(name, text);
    std::int64_t last = first;
    if (take(rest, '-') && !take_integer(rest, last)) refuse(name, text);
    if (last < first) refuse(name, text);
    selection.ranges.push_back({first, last});
  } while (take(rest, ','));
  if (!rest.empty()) refuse(name, text);
  return selection;
}

}  // namespace

std::vector<Selection> parse_selections(std::string_view name, std::string_view text) {
  std::vector<Selection> selections;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(';'), text.size());
    selections.push_back(parse_one(name, text.substr(0, end)));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return selections;
}

std::string selections_text(const std::vector<Selection>& selections) {
  std::string text;
  for (const Selection& selection : selections) {
    text += (text.empty() ? "" : ";") + selection.attribute;
    char separator = '=';
    for (const auto& [first, last] : selection.ranges) {
      text += separator + std::to_string(first);
      if (last != first) text += '-' + std::to_string(last);
      separator = ',';
    }
  }
  return text;
}

std::vector<std::uint8_t> selected_points(const Selection& selection, const Cloud& cloud) {
  const std::optional<AttributeInfo> meant = meant_attribute(cloud, selection.attribute);
  const Attribute values = attribute(cloud, meant ? meant->name : selection.attribute);
  const auto refuse_unless = [&](bool is_integer) {
    if (!is_integer)
      throw Error(ErrorKind::usage, "the attribute '" + values.name + "' is not one integer a point; choose another");
  };
  refuse_unless(values.components == 1);
  std::vector<std::uint8_t> selected(cloud.points.size());
  for (std::size_t i = 0; i < selected.size(); ++i) {
    const double value = value_at(values, i);  // texts have classes such as 2.000
    refuse_unless(!std::isfinite(value) || value == std::floor(value));
    selected[i] = std::ranges::any_of(selection.ranges, [&](const auto& range) {
      return value >= static_cast<double>(range[0]) && value <= static_cast<double>(range[1]);
    });
  }
  return selected;
}

}  // namespace pointfair
