// SPDX-License-Identifier: Apache-2.0
#include "outlier_action.hpp"

#include <fmt/format.h>

#include <charconv>
#include <optional>
#include <vector>

#include "point_noise.hpp"

namespace pointfair::cli {
namespace {

using Kind = OutlierAction::Kind;
constexpr std::string_view kClassify = "classify";

std::uint8_t class_in(const std::string& text) {
  unsigned value = 256;
  const char* const first = text.data() + kClassify.size() + 1;
  const auto [end, error] = std::from_chars(first, text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value > 255)
    throw Error(ErrorKind::usage,
                fmt::format("--outliers {}: a class is a whole number from 0 to 255, as in classify=7", text));
  return static_cast<std::uint8_t>(value);
}

// In the table of classes for point formats 0 to 5 (LAS 1.4 R15).
bool is_reserved(std::uint8_t value) { return value == 10 || value == 11 || value > 12; }

// Refuses a word that is no value of the parameter, and none of those that this file adds.
void check_word(const ParamInfo& info, const std::string& text) {
  Params params;
  try {
    set_param(params, info, text);
  } catch (const Error&) {
    throw Error(ErrorKind::usage, fmt::format("--outliers cannot be '{}': give one of {}|{} or auto", text, info.values,
                                              kOutlierActions));
  }
}

// Refuses what the file cannot hold before the run, by a cloud of outliers.
void check_values(const OutlierAction& action, const std::string& name, Cloud cloud,
                  const std::filesystem::path& output, const WriteOptions& options) {
  std::erase_if(cloud.added, [&](const Attribute& other) { return other.name == name; });
  Attribute& values = cloud.added.emplace_back();
  values.name = name;
  values.type = ScalarType::uint8;
  values.data.assign(cloud.points.size(), std::byte{action.value.value_or(1)});
  check_write(output, cloud, options);
}

// Other files without a place for marks are written without them, and a note says so.
void check_marks(Outliers outliers, const Cloud& cloud, const WriteOptions& options) {
  const std::optional<Format> own = file_info(cloud).format;
  if (outliers == Outliers::mark && own == Format::e57 && options.format.value_or(*own) == Format::e57)
    throw Error(ErrorKind::usage,
                "--outliers mark: a copy of an E57 file takes no further attributes, so no marks; write PLY, PCD or "
                "LAZ, or use --outliers keep");
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
    if (action.kind == Kind::none) check_word(*info, text);
    if (action.kind != Kind::none) text = "mark";
  }
  return action;
}

void check_outlier_action(const OutlierAction& action, Outliers outliers, const Cloud& cloud,
                          const std::filesystem::path& output, const WriteOptions& options) {
  if (action.kind == Kind::none) return check_marks(outliers, cloud, options);
  if (action.kind == Kind::remove) {
    if (!cloud.points.empty())
      check_write(output, without_points(cloud, std::vector<std::uint8_t>(cloud.points.size())), options);
    return;
  }
  const std::string name = outlier_attribute(action, attributes(cloud));
  const std::optional<AttributeInfo> info = attribute_info(cloud, name);
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
  if (!cloud.points.empty()) check_values(action, name, cloud, output, options);
}

std::string outcome_text(const OutlierAction& action, const OutlierOutcome& outcome) {
  const std::uint64_t outliers = outcome.outliers();
  std::string text;
  if (action.kind == Kind::remove) {
    const auto& of_reason = outcome.of_reason;
    text =
        fmt::format("{} points are removed as outliers ({} isolated, {} off the surface, {} mixed pixels), {} are left",
                    outliers, of_reason[1], of_reason[2], of_reason[3], of_reason[0]);
  } else if (action.kind == Kind::withhold) {
    text = fmt::format("{} outliers are flagged as withheld", outliers);
  } else if (action.value) {
    text = fmt::format("{} outliers are in class {}", outliers, *action.value);
    if (outcome.in_old_classes > 0 && is_reserved(*action.value))
      text += ", which LAS reserves in point formats 0 to 5; noise is class 7 there";
  } else if (outcome.in_old_classes > 0) {
    text = fmt::format("{} outliers are in class 7 (noise)", outcome.low);
    if (outcome.high > 0) text += fmt::format(", {} in class 18 (high noise)", outcome.high);
    text += "; point formats 0 to 5 of LAS have no class for high noise";
  } else {
    text =
        fmt::format("{} outliers are in class 7 (low noise), {} in class 18 (high noise)", outcome.low, outcome.high);
  }
  if (outcome.thin * 10 > outliers)
    text += fmt::format(
        "; {} of them had a class of vegetation or wires (3 to 5, 13 to 16), where outliers cannot be told: --ignore "
        "classification=3-5,13-16 leaves these out",
        outcome.thin);
  return text;
}

}  // namespace pointfair::cli
