// SPDX-License-Identifier: Apache-2.0
#include "outlier_action.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "point_noise.hpp"

namespace pointfair::cli {
namespace {

using Kind = OutlierAction::Kind;
constexpr std::uint8_t kLowNoise = 7, kHighNoise = 18;  // LAS 1.4 R15, table 17
constexpr std::string_view kClassify = "classify";

bool is_finite(const Point& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

std::uint8_t class_in(const std::string& text) {
  unsigned value = 256;
  const char* const first = text.data() + kClassify.size() + 1;
  const auto [end, error] = std::from_chars(first, text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value > 255)
    throw Error(ErrorKind::usage,
                fmt::format("--outliers {}: a class is a whole number from 0 to 255, as in classify=7", text));
  return static_cast<std::uint8_t>(value);
}

const char* attribute_of(const OutlierAction& action) {
  return action.kind == Kind::classify ? "classification" : "withheld";
}

// The mean height of the points that are no outliers, in cells of the plane that hold some 16 of them.
class Ground {
 public:
  Ground(std::span<const Point> points, std::span<const std::uint8_t> reasons) {
    std::vector<std::size_t> sound;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (reasons[i] == 0 && is_finite(points[i])) sound.push_back(i);
    if (sound.empty()) return;
    low_ = {points[sound[0]].x, points[sound[0]].y};
    std::array<float, 2> high = low_;
    for (const std::size_t i : sound) {
      low_ = {std::min(low_[0], points[i].x), std::min(low_[1], points[i].y)};
      high = {std::max(high[0], points[i].x), std::max(high[1], points[i].y)};
    }
    side_ = static_cast<std::size_t>(std::clamp(std::sqrt(double(sound.size()) / 16), 1.0, 4096.0));
    for (std::size_t axis = 0; axis < 2; ++axis)
      per_unit_[axis] = high[axis] > low_[axis] ? double(side_) / (double{high[axis]} - low_[axis]) : 0;
    sums_.resize(side_ * side_);
    counts_.resize(side_ * side_);
    for (const std::size_t i : sound) {
      sums_[cell_of(points[i])] += points[i].z;
      ++counts_[cell_of(points[i])];
    }
  }

  // The mean height in the nearest ring of cells that has points.
  double height_at(const Point& p) const {
    const std::size_t cell = cell_of(p);
    const auto row = std::ptrdiff_t(cell / side_), column = std::ptrdiff_t(cell % side_), side = std::ptrdiff_t(side_);
    for (std::ptrdiff_t ring = 0; ring < side; ++ring) {
      double sum = 0, count = 0;
      for (std::ptrdiff_t y = std::max<std::ptrdiff_t>(0, row - ring); y <= std::min(side - 1, row + ring); ++y) {
        const bool whole = y == row - ring || y == row + ring;
        for (std::ptrdiff_t x = column - ring; x <= column + ring; x += whole || ring == 0 ? 1 : 2 * ring) {
          if (x < 0 || x >= side) continue;
          sum += sums_[std::size_t(y * side + x)];
          count += counts_[std::size_t(y * side + x)];
        }
      }
      if (count > 0) return sum / count;
    }
    return 0;
  }
  bool is_empty() const { return counts_.empty(); }

 private:
  std::size_t cell_of(const Point& p) const {
    const auto step = [&](float value, std::size_t axis) {
      const double place = (double{value} - low_[axis]) * per_unit_[axis];
      return static_cast<std::size_t>(std::clamp(place, 0.0, double(side_ - 1)));
    };
    return step(p.y, 1) * side_ + step(p.x, 0);
  }

  std::array<float, 2> low_{};
  std::array<double, 2> per_unit_{};
  std::size_t side_ = 1;
  std::vector<double> sums_;
  std::vector<std::uint32_t> counts_;
};

// The file's own values, or zeros.
Attribute values_of(const Cloud& cloud, const std::string& name) {
  if (find_info(cloud, name)) return attribute(cloud, name);
  Attribute fresh;
  fresh.name = name;
  fresh.type = ScalarType::uint8;
  fresh.data.resize(cloud.points.size());
  return fresh;
}

// Classes of LAS that thin things have: vegetation, wires and their towers.
bool is_thin(std::byte kind) {
  const auto value = std::to_integer<unsigned>(kind);
  return (value >= 3 && value <= 5) || (value >= 13 && value <= 16);
}

// What to say where more than a tenth of the outliers had such a class before; else empty.
std::string note_on_thin(std::span<const std::uint8_t> reasons, const Cloud& cloud) {
  const std::optional<AttributeInfo> info = find_info(cloud, "classification");
  if (!info || info->type != ScalarType::uint8 || info->components != 1) return {};
  const Attribute kinds = attribute(cloud, "classification");
  std::size_t outliers = 0, thin = 0;
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    if (reasons[i] == 0) continue;
    ++outliers;
    thin += is_thin(kinds.data[i]) ? 1 : 0;
  }
  if (thin * 10 <= outliers) return {};
  return fmt::format(
      "; {} of them had a class of vegetation or wires (3 to 5, 13 to 16), where outliers cannot be told: --ignore "
      "classification=3-5,13-16 leaves these out",
      thin);
}

}  // namespace

OutlierAction take_outlier_action(ParamArguments& params) {
  OutlierAction action;
  for (auto& [info, text] : params.given) {
    if (info->name != "outliers") continue;
    action = {};
    if (text == "withheld") action.kind = Kind::withhold;
    if (text == "remove") action.kind = Kind::remove;
    if (text == kClassify || text.starts_with("classify=")) action.kind = Kind::classify;
    if (text.starts_with("classify=")) action.value = class_in(text);
    if (action.kind != Kind::none) text = "mark";
  }
  return action;
}

void check_outlier_action(const OutlierAction& action, const Cloud& cloud, const std::filesystem::path& output,
                          const WriteOptions& options) {
  if (action.kind == Kind::none) return;
  if (action.kind == Kind::remove) {
    if (!cloud.points.empty())
      check_write(output, without_points(cloud, std::vector<std::uint8_t>(cloud.points.size())), options);
    return;
  }
  const std::string name = attribute_of(action);
  const std::optional<AttributeInfo> info = find_info(cloud, name);
  if (info && (info->type != ScalarType::uint8 || info->components != 1))
    throw Error(ErrorKind::usage,
                fmt::format("--outliers: the attribute '{}' of this cloud is not one byte a point, so "
                            "it can hold no class; use --outliers mark",
                            name));
  if (!info) check_new_attribute(cloud, "--outliers", name, options);
  const std::optional<Format> own = file_info(cloud).format;
  if (options.format && options.format != own && *options.format != Format::e57 && !takes_attributes(*options.format))
    throw Error(ErrorKind::usage,
                "--outliers: files of this format hold no classes and no flags; write LAS, LAZ, PLY, PCD "
                "or text");
}

std::string act_on_outliers(const OutlierAction& action, std::span<const std::uint8_t> reasons,
                            std::span<const Point> before, Cloud& cloud) {
  const std::string thin = note_on_thin(reasons, cloud);
  if (action.kind == Kind::remove) {
    std::array<std::size_t, 4> of_reason{};
    for (const std::uint8_t reason : reasons) ++of_reason[std::min<std::size_t>(reason, 3)];
    return fmt::format(
               "{} points are removed as outliers ({} isolated, {} off the surface, {} mixed pixels), {} are left",
               reasons.size() - of_reason[0], of_reason[1], of_reason[2], of_reason[3], of_reason[0]) +
           thin;
  }
  const std::string name = attribute_of(action);
  Attribute values = values_of(cloud, name);
  const Ground ground(before, reasons);
  std::array<std::uint64_t, 256> counts{};
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    if (reasons[i] == 0) continue;
    std::uint8_t value = 1;
    if (action.kind == Kind::classify) {
      const bool is_above = !ground.is_empty() && before[i].z > ground.height_at(before[i]);
      value = action.value.value_or(is_above ? kHighNoise : kLowNoise);
    }
    values.data[i] = std::byte{value};
    ++counts[value];
  }
  std::erase_if(cloud.added, [&](const Attribute& other) { return other.name == name; });
  cloud.added.push_back(std::move(values));
  if (action.kind == Kind::withhold) return fmt::format("{} outliers are flagged as withheld", counts[1]) + thin;
  if (action.value) return fmt::format("{} outliers are in class {}", counts[*action.value], *action.value) + thin;
  return fmt::format("{} outliers are in class 7 (low noise), {} in class 18 (high noise)", counts[kLowNoise],
                     counts[kHighNoise]) +
         thin;
}

}  // namespace pointfair::cli
