// SPDX-License-Identifier: Apache-2.0
#include "pointfair/viewpoint.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "io/scalar.hpp"
#include "io/source.hpp"
#include "pointfair/file_info.hpp"

namespace pointfair {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

using Words = std::array<std::string_view, 3>;

[[noreturn]] void refuse(std::string_view text, const std::string& why) {
  throw Error(ErrorKind::usage, "--viewpoint cannot be '" + std::string(text.substr(0, 60)) + "': " + why);
}

// Between commas.
Words words_of(std::string_view text) {
  const auto wrong = [&] {
    refuse(text, "give x,y,z in the file's coordinates, the names of three attributes as vx,vy,vz, or none");
  };
  Words words;
  std::string_view rest = text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::size_t comma = rest.find(',');
    if ((comma == std::string_view::npos) != (i + 1 == words.size())) wrong();
    words[i] = rest.substr(0, comma);
    if (words[i].empty()) wrong();
    rest = comma == std::string_view::npos ? std::string_view() : rest.substr(comma + 1);
  }
  return words;
}

// A number, and how many metres its unit has; none for the file's own unit.
struct Coordinate {
  double value;
  std::optional<double> metres;
};
std::optional<Coordinate> coordinate_of(std::string_view word) {
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || !std::isfinite(value)) return std::nullopt;
  const std::string_view unit = word.substr(std::size_t(end - word.data()));
  if (unit.empty()) return Coordinate{value, std::nullopt};
  if (unit == "mm") return Coordinate{value, 0.001};
  if (unit == "cm") return Coordinate{value, 0.01};
  if (unit == "ft") return Coordinate{value, 0.3048};
  if (unit == "m") return Coordinate{value, 1.0};
  return std::nullopt;
}

bool is_name(std::string_view word) { return !coordinate_of(word); }

Position position_of(std::string_view text, const Words& words, const Cloud& cloud) {
  Position position;
  for (std::size_t axis = 0; axis < words.size(); ++axis) {
    const std::optional<Coordinate> coordinate = coordinate_of(words[axis]);
    if (!coordinate) refuse(text, "its words are numbers and names; give three of one kind");
    position[axis] = coordinate->value;
    if (!coordinate->metres) continue;
    const std::optional<double> metres = file_info(cloud).metres_per_unit;
    if (!metres)
      refuse(text, "the cloud's file does not say how long its unit is; give numbers without mm, cm, m or ft");
    position[axis] *= *coordinate->metres / *metres;
  }
  return position;
}

void read_axis(std::string_view text, std::string_view name, const Cloud& cloud, std::size_t axis,
               std::vector<Position>& out) {
  std::string has;
  bool found = false;
  for (const AttributeInfo& info : attributes(cloud)) {
    if (info.components != 1) continue;
    has += (has.empty() ? "" : ", ") + info.name;
    found = found || info.name == name;
  }
  if (!found)
    refuse(text, "the cloud has no attribute '" + std::string(name) + "' of one number a point; it has " +
                     (has.empty() ? "none" : has));
  const Attribute values = attribute(cloud, name);
  const auto* const from = reinterpret_cast<const char*>(values.data.data());
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i][axis] = io::load_double(from + i * size_of(values.type), io::native(values.type), false);
}

}  // namespace

std::vector<Position> file_viewpoints(const Cloud& cloud) {
  if (!cloud.source) return {};
  const Source& source = *cloud.source;
  const std::size_t blocks = source.block_count();
  const auto place = [&](std::size_t block) { return source.sensor(block).value_or(Position{kNan, kNan, kNan}); };
  bool any = false, one = true;
  for (std::size_t block = 0; block < blocks; ++block) {
    const std::optional<Position> its = source.sensor(block);
    any = any || its;
    one = one && its == source.sensor(0);
  }
  if (!any) return {};
  if (one) return {place(0)};
  std::vector<Position> places(cloud.points.size(), Position{kNan, kNan, kNan});
  for (std::size_t block = 0; block < blocks; ++block)
    std::fill_n(places.begin() + std::ptrdiff_t(source.block_begin(block)), source.block_size(block), place(block));
  return places;
}

void check_viewpoint(std::string_view text) {
  if (text.empty() || text == "none") return;
  const Words words = words_of(text);
  const auto names = std::count_if(words.begin(), words.end(), is_name);
  if (names != 0 && names != std::ptrdiff_t(words.size()))
    refuse(text, "its words are numbers and names; give three of one kind");
}

std::vector<Position> parse_viewpoints(std::string_view text, const Cloud& cloud) {
  if (text.empty()) return file_viewpoints(cloud);
  if (text == "none") return {};
  check_viewpoint(text);
  const Words words = words_of(text);
  if (!is_name(words[0])) return {position_of(text, words, cloud)};
  std::vector<Position> places(cloud.points.size());
  for (std::size_t axis = 0; axis < words.size(); ++axis) read_axis(text, words[axis], cloud, axis, places);
  return places;
}

}  // namespace pointfair
