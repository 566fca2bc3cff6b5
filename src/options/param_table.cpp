// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/params.hpp"

namespace pointfair {
namespace {

char joined(char c) { return c == '-' ? '_' : c; }

std::vector<std::string_view> words_of(std::string_view values) {
  std::vector<std::string_view> words;
  for (std::size_t first = 0; first <= values.size();) {
    const std::size_t end = std::min(values.find('|', first), values.size());
    words.push_back(values.substr(first, end - first));
    first = end + 1;
  }
  return words;
}

[[noreturn]] void refuse(const ParamInfo& info, std::string_view text, const std::string& wanted) {
  const std::string point = text.find(',') == std::string_view::npos ? "" : ", with a decimal point";
  throw Error(ErrorKind::usage, flag_of(info.name) + " cannot be '" + std::string(text) + "': give " + wanted + point);
}

std::string number_text(double value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return std::string(text, end);
}

std::optional<double> number_of(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::string wanted_values(const ParamInfo& info) {
  const std::string automatic = info.automatic ? " or auto" : "";
  if (!info.values.empty()) return "one of " + std::string(info.values) + automatic;
  if (std::holds_alternative<int Params::*>(info.field))
    return "a whole number from " + number_text(info.min) + " to " + number_text(info.max) + automatic;
  if (std::holds_alternative<std::optional<double> Params::*>(info.field))
    return "a number from " + number_text(info.min) + " to " + number_text(info.max) + automatic;
  const std::string of_radius = info.in_radii ? ", 0.6r (radii of the neighbourhood)" : "";
  return "a positive length: 0.02 (file units), 0.5% (of the diagonal), 2s (mean spacings)" + of_radius + automatic;
}

// What ends a length in each unit, the longer of two ends first.
struct LengthEnd {
  std::string_view text;
  Length::Unit unit;
  double factor = 1;
};
constexpr LengthEnd kLengthEnds[] = {{"%", Length::Unit::percent},     {"s", Length::Unit::spacing},
                                     {"r", Length::Unit::radius},      {"mm", Length::Unit::metre, .001},
                                     {"cm", Length::Unit::metre, .01}, {"ft", Length::Unit::metre, .3048},
                                     {"m", Length::Unit::metre},       {"", Length::Unit::file}};

Length length_of(const ParamInfo& info, std::string_view text) {
  if (text == "auto") return {};
  const auto& end = *std::ranges::find_if(kLengthEnds, [&](const LengthEnd& its) {
    return text.ends_with(its.text) && (its.unit != Length::Unit::radius || info.in_radii);
  });
  const std::optional<double> value = number_of(text.substr(0, text.size() - end.text.size()));
  if (!value || !(*value > 0) || *value > info.max) refuse(info, text, wanted_values(info));
  return {*value * end.factor, end.unit};
}

std::string length_text(const Length& length) {
  if (length.is_automatic()) return "auto";
  const auto& end = *std::ranges::find_if(
      kLengthEnds, [&](const LengthEnd& its) { return its.unit == length.unit && its.factor == 1; });
  return number_text(length.value).append(end.text);
}

std::size_t word_index(const ParamInfo& info, std::string_view text) {
  const auto words = words_of(info.values);
  const auto found = std::ranges::find(words, text);
  if (found == words.end()) refuse(info, text, wanted_values(info));
  return std::size_t(found - words.begin());
}

// How one kind of field is read, printed and checked.
struct ReadField {
  Params& params;
  const ParamInfo& info;
  std::string_view text;

  void operator()(int Params::*field) const {
    if (info.automatic && text == "auto") {
      params.*field = kAutomatic;
      return;
    }
    const std::optional<double> value = number_of(text);
    if (!value || *value != std::floor(*value) || *value < info.min || *value > info.max)
      refuse(info, text, wanted_values(info));
    params.*field = int(*value);
  }
  void operator()(std::optional<double> Params::*field) const {
    if (info.automatic && text == "auto") {
      params.*field = std::nullopt;
      return;
    }
    const std::optional<double> value = number_of(text);
    if (!value || *value < info.min || *value > info.max) refuse(info, text, wanted_values(info));
    params.*field = value;
  }
  void operator()(bool Params::*field) const { params.*field = word_index(info, text) == 0; }
  void operator()(Length Params::*field) const { params.*field = length_of(info, text); }
  template <class Enum>
  void operator()(Enum Params::*field) const {
    const bool is_automatic = info.automatic && text == "auto";  // such an enumeration begins with it
    params.*field = is_automatic ? Enum{} : static_cast<Enum>(word_index(info, text) + (info.automatic ? 1 : 0));
  }
};

struct PrintField {
  const Params& params;
  const ParamInfo& info;

  std::string operator()(int Params::*field) const {
    return params.*field == kAutomatic ? "auto" : std::to_string(params.*field);
  }
  std::string operator()(std::optional<double> Params::*field) const {
    return params.*field ? number_text(*(params.*field)) : "auto";
  }
  std::string operator()(bool Params::*field) const { return params.*field ? "on" : "off"; }
  std::string operator()(Length Params::*field) const { return length_text(params.*field); }
  template <class Enum>
  std::string operator()(Enum Params::*field) const {
    if (info.automatic && params.*field == Enum{}) return "auto";
    return std::string(words_of(info.values).at(std::size_t(params.*field) - (info.automatic ? 1 : 0)));
  }
};

struct CheckField {
  const Params& params;
  const ParamInfo& info;

  void operator()(int Params::*field) const {
    const int value = params.*field;
    if (value != kAutomatic && (value < info.min || value > info.max))
      refuse(info, std::to_string(value), wanted_values(info));
  }
  void operator()(std::optional<double> Params::*field) const {
    const std::optional<double> value = params.*field;
    if (value && !(*value >= info.min && *value <= info.max)) refuse(info, number_text(*value), wanted_values(info));
  }
  void operator()(Length Params::*field) const {
    const Length length = params.*field;
    if (length.is_automatic()) return;
    if (!(length.value > 0) || !(length.value <= info.max) || (length.unit == Length::Unit::radius && !info.in_radii))
      refuse(info, length_text(length), wanted_values(info));
  }
  template <class Other>
  void operator()(Other Params::*) const {}
};

}  // namespace

Params paper_preset() {
  return {.k = 8,
          .constraint = true,
          .normal_filter = NormalFilter::off,
          .area_weight = AreaWeight::squared,
          .offset = Offset::point,
          .relaxation = 1,
          .outliers = Outliers::off,
          .iterations = 1};
}

const ParamInfo* find_param(std::string_view name) {
  const auto same = [&](const ParamInfo& info) {
    return std::ranges::equal(info.name, name, [](char a, char b) { return joined(a) == joined(b); });
  };
  const auto found = std::ranges::find_if(kParams, same);
  return found == kParams.end() ? nullptr : &*found;
}

std::string flag_of(std::string_view name) {
  std::string flag = "--" + std::string(name);
  std::ranges::replace(flag, '_', '-');
  return flag;
}

void set_param(Params& params, const ParamInfo& info, std::string_view text) {
  std::visit(ReadField{params, info, text}, info.field);
}

std::string param_text(const Params& params, const ParamInfo& info) {
  return std::visit(PrintField{params, info}, info.field);
}

void check_params(const Params& params) {
  for (const ParamInfo& info : kParams) std::visit(CheckField{params, info}, info.field);
  if (params.constraint && params.k == kAutomatic && !params.radius.is_automatic())
    throw Error(ErrorKind::usage, "--constraint with --radius needs --k; give the number of neighbours too");
  if (params.connectivity == Connectivity::mesh) {
    if (params.k != kAutomatic || params.constraint)
      throw Error(ErrorKind::usage, "--connectivity mesh takes --rings or --radius, not --k or --constraint");
    if (params.method == Method::implicit && params.rings > 1)
      throw Error(ErrorKind::usage, "--method implicit joins the first ring of a mesh; leave out --rings");
    if (params.method == Method::learned)
      throw Error(ErrorKind::usage,
                  "--method learned knows points alone; choose another method for "
                  "--connectivity mesh");
  } else if (params.rings != kAutomatic) {
    throw Error(ErrorKind::usage, "--rings are of a mesh; add --connectivity mesh");
  } else if (is_of_faces(params.method)) {
    throw Error(ErrorKind::usage,
                params.method == Method::jones
                    ? "--method jones reads faces: add --connectivity mesh; on a cloud, --method "
                      "mollified takes planes of points"
                    : "--method fleishman reads faces: add --connectivity mesh; on a cloud, --k 8 with "
                      "--offset point is its step");
  }
  if (is_of_faces(params.method) && params.closeness_sigma.unit == Length::Unit::radius)
    throw Error(ErrorKind::usage,
                "--method " + param_text(params, *find_param("method")) +
                    " has a radius of twice --closeness-sigma; give that sigma in a unit other than r");
  if (params.along == Along::ray && !moves_along_normal(params.method))
    throw Error(ErrorKind::usage, "--along ray needs a method that moves along the normal: bilateral, mls or wiener");
}

Params in_file_units(const Params& params, std::optional<double> metres_per_unit) {
  Params result = params;
  for (const ParamInfo& info : kParams) {
    const auto* const field = std::get_if<Length Params::*>(&info.field);
    if (field == nullptr || (params.*(*field)).unit != Length::Unit::metre) continue;
    if (!metres_per_unit)
      throw Error(ErrorKind::usage, flag_of(info.name) +
                                        ": the cloud's file does not say how long its unit is; give the length in "
                                        "file units, without mm, cm, m or ft");
    result.*(*field) = (params.*(*field)).value / *metres_per_unit;
  }
  return result;
}

}  // namespace pointfair
