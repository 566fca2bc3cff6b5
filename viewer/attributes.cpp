// SPDX-License-Identifier: Apache-2.0
#include "attributes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>

namespace pointfair::viewer {
namespace {

// The last ones are of E57.
constexpr std::array<std::array<std::string_view, 3>, 4> kColourNames{{{"red", "green", "blue"},
                                                                       {"r", "g", "b"},
                                                                       {"diffuse_red", "diffuse_green", "diffuse_blue"},
                                                                       {"colorRed", "colorGreen", "colorBlue"}}};
constexpr std::array<std::string_view, 2> kPackedNames{"rgb", "rgba"};  // of PCD: 0xRRGGBB in 4 bytes, often as a float

// How a file says its colours.
struct ColourSource {
  std::vector<std::string> channels;  // three names, or one packed
};

const AttributeInfo* find_info(const std::vector<AttributeInfo>& infos, std::string_view name) {
  const auto found = std::ranges::find_if(infos, [&](const auto& info) { return info.name == name; });
  return found == infos.end() ? nullptr : &*found;
}

ColourSource colour_source(const std::vector<AttributeInfo>& infos) {
  for (const auto& names : kColourNames) {
    const bool all = std::ranges::all_of(names, [&](std::string_view n) { return find_info(infos, n); });
    if (all) return {{names.begin(), names.end()}};
  }
  for (const std::string_view name : kPackedNames) {
    const AttributeInfo* info = find_info(infos, name);
    if (info && info->components == 1 && size_of(info->type) == 4) return {{std::string(name)}};
  }
  return {};
}

// Of full brightness, by type: whole numbers fill theirs (8 bits where the values say so), others go up to 1.
double white_of(const Attribute& channel, std::size_t points) {
  if (channel.type == ScalarType::uint8) return 255;
  if (channel.type == ScalarType::float32 || channel.type == ScalarType::float64) {
    for (std::size_t i = 0; i < points; ++i)
      if (value_at(channel, i) > 1) return 255;
    return 1;
  }
  for (std::size_t i = 0; i < points; ++i)
    if (value_at(channel, i) > 255) return 65535;
  return 255;
}

std::uint8_t brightness(double value, double white) {
  return static_cast<std::uint8_t>(std::clamp(255 * value / white, 0.0, 255.0) + 0.5);
}

bool is_zero_everywhere(const Attribute& attribute, std::uint32_t component, std::size_t points) {
  for (std::size_t i = 0; i < points; ++i)
    if (value_at(attribute, i, component) != 0) return false;
  return true;
}

struct Choice {
  std::string_view name;
  std::uint32_t component = 0;
};

Choice parse_choice(std::string_view choice) {
  const std::size_t open = choice.rfind('[');
  if (open == choice.npos || !choice.ends_with(']')) return {choice, 0};
  Choice result{choice.substr(0, open), 0};
  const auto [end, error] = std::from_chars(choice.data() + open + 1, choice.data() + choice.size(), result.component);
  return error == std::errc() && *end == ']' ? result : Choice{choice, 0};
}

}  // namespace

Json colour_choices(const Cloud& cloud) {
  const std::vector<AttributeInfo> infos = attributes(cloud);
  Json choices = Json::array();
  const std::vector<std::string> channels = colour_source(infos).channels;
  if (!channels.empty()) choices.push_back({{"name", "rgb"}, {"kind", "rgb"}});
  const auto is_channel = [&](const AttributeInfo& info) {
    return std::ranges::find(channels, info.name) != channels.end();
  };
  for (const AttributeInfo& info : infos) {
    if (is_channel(info)) continue;
    const Attribute values = attribute(cloud, info.name);
    for (std::uint32_t c = 0; c < info.components; ++c) {
      if (is_zero_everywhere(values, c, cloud.points.size())) continue;
      const std::string name = info.components == 1 ? info.name : fmt::format("{}[{}]", info.name, c);
      choices.push_back({{"name", name}, {"kind", "scalar"}});
    }
  }
  return choices;
}

std::vector<float> scalars(const Cloud& cloud, std::string_view choice, const Order& order, std::size_t count) {
  // a name that itself ends in [n] comes before a component
  const std::vector<AttributeInfo> infos = attributes(cloud);
  const Choice wanted = find_info(infos, choice) ? Choice{choice, 0} : parse_choice(choice);
  const Attribute values = attribute(cloud, wanted.name);
  if (wanted.component >= values.components)
    throw Error(ErrorKind::usage, fmt::format("the attribute '{}' has {} components", wanted.name, values.components));
  std::vector<float> result(count);
  for (std::size_t place = 0; place < count; ++place)
    result[place] = static_cast<float>(value_at(values, order.index(place), wanted.component));
  return result;
}

std::vector<std::uint8_t> colours(const Cloud& cloud, const Order& order, std::size_t count) {
  const std::vector<std::string> names = colour_source(attributes(cloud)).channels;
  if (names.empty()) throw Error(ErrorKind::usage, "the cloud has no colours");
  std::vector<std::uint8_t> result(4 * count, 255);
  if (names.size() == 1) {
    const Attribute packed = attribute(cloud, names[0]);
    for (std::size_t place = 0; place < count; ++place) {
      std::uint32_t value = 0;
      std::memcpy(&value, packed.data.data() + 4 * std::size_t{order.index(place)}, sizeof value);
      for (std::size_t c = 0; c < 3; ++c) result[4 * place + c] = static_cast<std::uint8_t>(value >> (16 - 8 * c));
    }
    return result;
  }
  const std::vector<Attribute> channels = attribute_values(cloud, std::span(names).first(3));
  for (std::size_t c = 0; c < 3; ++c) {
    const double white = white_of(channels[c], cloud.points.size());
    for (std::size_t place = 0; place < count; ++place)
      result[4 * place + c] = brightness(value_at(channels[c], order.index(place)), white);
  }
  return result;
}

}  // namespace pointfair::viewer
