// SPDX-License-Identifier: Apache-2.0
#include "recipe.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace pointfair::viewer {
namespace {

constexpr std::string_view kStageNames[] = {"index", "neighbors", "normals", "fairing", "iterations"};

std::string text_of(const Json& json, std::string_view name) {
  if (!json.is_string()) throw Error(ErrorKind::usage, fmt::format("{}: the value must be a string", name));
  return json.get<std::string>();
}

const Json& object_in(const Json& json, const char* key) {
  static const Json empty = Json::object();
  const auto found = json.find(key);
  if (found == json.end()) return empty;
  if (!found->is_object()) throw Error(ErrorKind::usage, fmt::format("\"{}\" must be an object", key));
  return *found;
}

std::string kind_of(const ParamInfo& info) {
  if (std::holds_alternative<int Params::*>(info.field)) return "int";
  if (std::holds_alternative<bool Params::*>(info.field)) return "switch";
  if (std::holds_alternative<Length Params::*>(info.field)) return "length";
  if (std::holds_alternative<std::optional<double> Params::*>(info.field)) return "number";
  return "word";
}

Json words_json(std::string_view values) {
  Json words = Json::array();
  for (std::size_t first = 0; first < values.size();) {
    const std::size_t end = std::min(values.find('|', first), values.size());
    words.push_back(values.substr(first, end - first));
    first = end + 1;
  }
  return words;
}

// As one word of a POSIX shell.
std::string shell_word(std::string_view text) {
  constexpr std::string_view kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,%@";
  if (!text.empty() && text.find_first_not_of(kPlain) == text.npos) return std::string(text);
  std::string word = "'";
  for (const char c : text) {
    if (c == '\'') word += "'\\'";  // ends the quotes, an escaped quote, begins them again
    word += c;
  }
  return word + "'";
}

// A path that begins with '-' would be taken for a flag.
std::string path_word(const std::string& path) { return shell_word(path.starts_with('-') ? "./" + path : path); }

// As a C++ string literal. Octal, since a hexadecimal escape has no end.
std::string literal(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      result += {'\\', c};
    } else if (byte < 0x20 || byte == 0x7f) {
      result += fmt::format("\\{:03o}", byte);
    } else {
      result += c;
    }
  }
  return result + "\"";
}

// Calls `use(info, text)` for each parameter that is not as it is by default.
template <class Use>
void for_each_set(const Params& params, Use use) {
  const Params defaults;
  for (const ParamInfo& info : kParams) {
    const std::string text = param_text(params, info);
    if (text != param_text(defaults, info)) use(info, text);
  }
}

std::string length_literal(const Length& length) {
  constexpr const char* kUnits[] = {"automatic", "file", "percent", "spacing", "radius", "metre"};
  if (length.is_automatic()) return "{}";
  if (length.unit == Length::Unit::file) return fmt::format("{}", length.value);
  return fmt::format("{{{}, pointfair::Length::Unit::{}}}", length.value, kUnits[static_cast<int>(length.unit)]);
}

std::string assignment(const Params& params, const ParamInfo& info, const std::string& text) {
  if (const auto* number = std::get_if<int Params::*>(&info.field))
    return fmt::format("  params.{} = {};\n", info.name, params.*(*number));
  if (const auto* factor = std::get_if<std::optional<double> Params::*>(&info.field))
    return fmt::format("  params.{} = {};\n", info.name, (params.*(*factor)).value());
  if (const auto* flag = std::get_if<bool Params::*>(&info.field))
    return fmt::format("  params.{} = {};\n", info.name, params.*(*flag));
  if (const auto* length = std::get_if<Length Params::*>(&info.field))
    return fmt::format("  params.{} = {};\n", info.name, length_literal(params.*(*length)));
  return fmt::format("  set_param(params, *pointfair::find_param({}), {});\n", literal(info.name), literal(text));
}

std::string_view format_word(Format format) {
  constexpr std::string_view kWords[] = {"ply", "pcd", "xyz", "txt", "csv", "pts", "off",   "obj",      "las",
                                         "laz", "e57", "ptx", "stl", "npy", "glb", "kitti", "nuscenes", "copc"};
  static_assert(std::size(kWords) == static_cast<std::size_t>(Format::copc) + 1);
  return kWords[static_cast<std::size_t>(format)];
}

// What reading is told beside the file's name, as C++; empty: nothing.
std::string reading_literal(const ReadOptions& reading) {
  std::vector<std::string> options;
  if (reading.format) options.push_back(fmt::format(".format = pointfair::Format::{}", format_word(*reading.format)));
  std::vector<std::string> names;
  for (const std::string& name : reading.columns) names.push_back(literal(name));
  if (!names.empty()) options.push_back(fmt::format(".columns = {{{}}}", fmt::join(names, ", ")));
  if (reading.skip_lines > 0) options.push_back(fmt::format(".skip_lines = {}", reading.skip_lines));
  return options.empty() ? "" : fmt::format(", {{{}}}", fmt::join(options, ", "));
}

std::string_view device_word(Device::Kind kind) { return kind == Device::cuda ? "cuda" : "cpu"; }

}  // namespace

Recipe read_recipe(const Json& json) {
  Recipe recipe;
  for (const auto& [name, value] : object_in(json, "params").items()) {
    const ParamInfo* info = find_param(name);
    if (!info) throw Error(ErrorKind::usage, fmt::format("there is no parameter '{}'", name));
    set_param(recipe.params, *info, text_of(value, name));
  }
  for (const auto& [name, value] : object_in(json, "limits").items())
    set_limit(recipe.limits, name, text_of(value, name));
  check_params(recipe.params);
  return recipe;
}

Json describe_params() {
  Json rows = Json::array();
  const Params defaults;
  for (const ParamInfo& info : kParams) {
    rows.push_back({{"name", info.name},
                    {"flag", flag_of(info.name)},
                    {"stage", kStageNames[static_cast<std::size_t>(info.stage)]},
                    {"kind", kind_of(info)},
                    {"min", info.min},
                    {"max", info.max},
                    {"automatic", info.automatic},
                    {"in_radii", info.in_radii},
                    {"values", words_json(info.values)},
                    {"default", param_text(defaults, info)},
                    {"help", info.help},
                    {"expert", info.expert},
                    {"needs_faces", needs_faces(info)}});
  }
  return rows;
}

Json params_texts(const Params& params) {
  Json texts = Json::object();
  for (const ParamInfo& info : kParams) texts[std::string(info.name)] = param_text(params, info);
  return texts;
}

std::string as_command(const Recipe& recipe, const Errand& errand) {
  std::string line = fmt::format("pointfair run {} {}", path_word(errand.input), path_word(errand.output));
  const auto add = [&](std::string_view name, const std::string& text) {
    line += fmt::format(" {}={}", flag_of(name), shell_word(text));
  };
  for_each_set(recipe.params, [&](const ParamInfo& info, const std::string& text) { add(info.name, text); });
  for (const std::string_view name : kLimitNames)
    if (const std::string text = limit_text(recipe.limits, name); !text.empty()) add(name, text);
  const ReadOptions& reading = errand.reading;
  if (reading.format) add("in-format", std::string(format_word(*reading.format)));
  if (!reading.columns.empty()) add("columns", fmt::format("{}", fmt::join(reading.columns, ",")));
  if (reading.skip_lines > 0) add("skip", std::to_string(reading.skip_lines));
  if (!errand.viewpoint.empty()) add("viewpoint", errand.viewpoint);
  if (!errand.encoding.empty()) add("encoding", errand.encoding);
  return line + fmt::format(" --device={}", device_word(errand.device));
}

std::string as_cpp(const Recipe& recipe, const Errand& errand) {
  std::string text = "#include <pointfair/pointfair.hpp>\n\nint main() {\n";
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "  const pointfair::Cloud cloud = pointfair::read({}{});\n", literal(errand.input),
                 reading_literal(errand.reading));
  fmt::format_to(out, "  pointfair::Pipeline pipeline(pointfair::Device::{});\n", device_word(errand.device));
  if (recipe.limits != Limits{}) {
    text += "  pointfair::Limits limits;\n";
    for (const std::string_view name : kLimitNames) {
      const std::string value = limit_text(recipe.limits, name);
      if (!value.empty()) fmt::format_to(out, "  set_limit(limits, {}, {});\n", literal(name), literal(value));
    }
  }
  text +=
      recipe.limits.ignore.empty() ? "  pipeline.load(cloud);\n" : "  pipeline.load(without_ignored(limits, cloud));\n";
  if (!errand.viewpoint.empty())
    fmt::format_to(out, "  pipeline.set_viewpoint(pointfair::parse_viewpoints({}, cloud));\n",
                   literal(errand.viewpoint));
  text += "\n  pointfair::Params params;\n";
  for_each_set(recipe.params, [&](const ParamInfo& info, const std::string& value) {
    text += assignment(recipe.params, info, value);
  });
  text += "  pointfair::Cloud denoised = pipeline.run(params);\n";
  if (recipe.limits != Limits{}) text += "  apply_limits(limits, cloud, denoised);\n";
  text += "\n  pointfair::WriteOptions options;\n";
  if (!errand.encoding.empty()) {
    std::string word = errand.encoding;
    std::ranges::replace(word, '-', '_');
    fmt::format_to(out, "  options.encoding = pointfair::Encoding::{};\n", word);
  }
  fmt::format_to(out, "  pointfair::write({}, denoised, options);\n}}\n", literal(errand.output));
  return text;
}

std::optional<Encoding> encoding_of(std::string_view word) {
  if (word.empty()) return std::nullopt;
  for (const auto& [name, encoding] : kEncodings)
    if (name == word) return encoding;
  throw Error(ErrorKind::usage, fmt::format("there is no encoding '{}'", word));
}

}  // namespace pointfair::viewer
