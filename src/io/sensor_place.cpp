// SPDX-License-Identifier: Apache-2.0
#include "io/sensor_place.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "io/scalar.hpp"
#include "pointfair/viewpoint.hpp"

namespace pointfair {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

using Words = std::array<std::string_view, 3>;

[[noreturn]] void refuse(std::string_view text, const std::string& why) {
  throw Error(ErrorKind::usage, "--viewpoint cannot be '" + std::string(text.substr(0, 60)) + "': " + why);
}

// Between commas.
Words words_of(std::string_view text) {
  Words words;
  std::string_view rest = text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::size_t comma = rest.find(',');
    words[i] = rest.substr(0, comma);
    if ((comma == std::string_view::npos) != (i + 1 == words.size()) || words[i].empty())
      refuse(text, "give x,y,z in the file's coordinates, the names of three attributes as vx,vy,vz, or none");
    rest = comma == std::string_view::npos ? std::string_view() : rest.substr(comma + 1);
  }
  return words;
}

// None where the words are names.
std::optional<Position> position_of(std::string_view text, const Words& words) {
  Position position{};
  std::size_t numbers = 0;
  for (std::size_t axis = 0; axis < words.size(); ++axis) {
    const char* const end = words[axis].data() + words[axis].size();
    const auto [stop, error] = std::from_chars(words[axis].data(), end, position[axis]);
    numbers += error == std::errc() && stop == end && std::isfinite(position[axis]);
  }
  if (numbers == words.size()) return position;
  if (numbers > 0) refuse(text, "its words are numbers and names; give three of one kind");
  return std::nullopt;
}

void read_axis(std::string_view text, std::string_view name, const Cloud& cloud, std::size_t axis,
               std::vector<Position>& out) {
  std::string has;
  for (const AttributeInfo& info : attributes(cloud))
    if (info.components == 1) has += (has.empty() ? "" : ", ") + info.name;
  const std::optional<AttributeInfo> meant = meant_attribute(cloud, name);
  if (!meant || meant->components != 1)
    refuse(text, "the cloud has no attribute '" + std::string(name) + "' of one number a point; it has " +
                     (has.empty() ? "none" : has));
  const Attribute values = attribute(cloud, meant->name);
  for (std::size_t i = 0; i < out.size(); ++i) out[i][axis] = value_at(values, i);
}

}  // namespace

std::optional<Position> io::named_place(std::string_view text) {
  if (text.empty() || text == "none") return std::nullopt;
  return position_of(text, words_of(text));
}

std::optional<Position> io::common_sensor(const Source& source) {
  if (source.block_count() == 0) return std::nullopt;
  const std::optional<Position> first = source.sensor(0);
  for (std::size_t block = 1; block < source.block_count(); ++block)
    if (source.sensor(block) != first) return std::nullopt;
  return first;
}

bool io::has_sensor(const Source& source) {
  for (std::size_t block = 0; block < source.block_count(); ++block)
    if (source.sensor(block)) return true;
  return false;
}

std::vector<Position> file_viewpoints(const Cloud& cloud) {
  if (!cloud.source) return {};
  const Source& source = *cloud.source;
  if (const std::optional<Position> one = io::common_sensor(source)) return {*one};
  io::check_has_points_of_file(cloud);
  std::vector<Position> places;
  for (std::size_t block = 0; block < source.block_count(); ++block) {
    const std::optional<Position> its = source.sensor(block);
    if (!its) continue;
    places.resize(cloud.points.size(), Position{kNan, kNan, kNan});
    std::fill_n(places.begin() + std::ptrdiff_t(source.block_begin(block)), source.block_size(block), *its);
  }
  return places;
}

void check_viewpoint(std::string_view text) { io::named_place(text); }

std::vector<Position> parse_viewpoints(std::string_view text, const Cloud& cloud) {
  if (text.empty()) return file_viewpoints(cloud);
  if (text == "none") return {};
  if (const std::optional<Position> one = io::named_place(text)) return {*one};
  const Words words = words_of(text);
  io::check_has_points_of_file(cloud);
  std::vector<Position> places(cloud.points.size());
  for (std::size_t axis = 0; axis < words.size(); ++axis) read_axis(text, words[axis], cloud, axis, places);
  return places;
}

}  // namespace pointfair
