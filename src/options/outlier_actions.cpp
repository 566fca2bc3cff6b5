// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include "options/outlier_values.hpp"
#include "pointfair/file_info.hpp"
#include "pointfair/io.hpp"

namespace pointfair {
namespace {

using Kind = OutlierAction::Kind;

constexpr std::uint8_t kLowNoise = 7, kHighNoise = 18;

bool is_thin(std::byte of_class) {
  const auto value = std::to_integer<unsigned>(of_class);
  return (value >= 3 && value <= 5) || (value >= 13 && value <= 16);
}

bool is_one_byte(const AttributeInfo& info) { return info.type == ScalarType::uint8 && info.components == 1; }

// The cloud's own values, or zeros.
Attribute values_of(const Cloud& cloud, const std::string& name) {
  if (const std::optional<AttributeInfo> info = attribute_info(cloud, name)) {
    check_outlier_attribute(*info);
    return attribute(cloud, name);
  }
  return {{name, ScalarType::uint8}, std::vector<std::byte>(cloud.points.size())};
}

}  // namespace

std::string outlier_attribute(const OutlierAction& action, std::span<const AttributeInfo> attributes) {
  const std::string name = action.kind == Kind::classify ? "classification" : "withheld";
  if (action.kind != Kind::classify && action.kind != Kind::withhold) return "";
  if (std::ranges::find(attributes, name, &AttributeInfo::name) != attributes.end()) return name;
  const auto alias = std::ranges::find(attributes, name, [](const AttributeInfo& info) { return las_name(info.name); });
  return alias == attributes.end() ? name : alias->name;
}

void check_outlier_attribute(const AttributeInfo& info) {
  if (!is_one_byte(info))
    throw Error(ErrorKind::usage, "--outliers: the attribute '" + info.name +
                                      "' of this cloud is not one byte a point, so it can hold no class; use "
                                      "--outliers mark");
}

void put_outlier_values(const OutlierAction& action, bool has_old_classes, std::span<const std::uint8_t> reasons,
                        std::span<const Point> before, const HeightGrid& heights, std::span<const std::byte> classes,
                        std::span<std::byte> values, OutlierOutcome& outcome) {
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    ++outcome.of_reason[std::min<std::size_t>(reasons[i], outcome.of_reason.size() - 1)];
    if (reasons[i] == 0) continue;
    if (has_old_classes) ++outcome.in_old_classes;
    if (!classes.empty() && is_thin(classes[i])) ++outcome.thin;
    if (values.empty()) continue;
    std::uint8_t value = action.value.value_or(1);
    if (needs_heights(action)) {
      const std::optional<double> height = heights.height_at(before[i]);
      const bool is_above = !has_old_classes && height && before[i].z > *height;
      value = is_above ? kHighNoise : kLowNoise;
      ++(is_above ? outcome.high : outcome.low);
    }
    values[i] = std::byte{value};
  }
}

OutlierOutcome act_on_outliers(const OutlierAction& action, std::span<const std::uint8_t> reasons,
                               std::span<const Point> before, Cloud& cloud) {
  if (reasons.size() != cloud.points.size() || before.size() != cloud.points.size())
    throw Error(ErrorKind::usage, "outliers: there are " + std::to_string(reasons.size()) + " reasons and " +
                                      std::to_string(before.size()) + " points before, and the cloud has " +
                                      std::to_string(cloud.points.size()) + " points");
  OutlierOutcome outcome;
  HeightGrid heights(before.size());
  for (std::size_t i = 0; needs_heights(action) && i < before.size(); ++i)
    if (reasons[i] == 0 && is_finite(before[i])) heights.add(before[i]);
  heights.finish();
  std::vector<std::byte> classes;
  const std::vector<AttributeInfo> all = attributes(cloud);
  const std::string of_classes = outlier_attribute({Kind::classify, {}}, all);
  if (const auto info = attribute_info(cloud, of_classes); info && is_one_byte(*info))
    classes = attribute(cloud, of_classes).data;
  const std::string name = outlier_attribute(action, all);
  Attribute values;
  if (!name.empty()) values = values_of(cloud, name);
  put_outlier_values(action, file_info(cloud).has_old_classes, reasons, before, heights, classes, values.data, outcome);
  if (name.empty()) return outcome;
  std::erase_if(cloud.added, [&](const Attribute& other) { return other.name == name; });
  cloud.added.push_back(std::move(values));
  return outcome;
}

}  // namespace pointfair
