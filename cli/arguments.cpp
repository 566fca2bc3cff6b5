// SPDX-License-Identifier: Apache-2.0
#include "arguments.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>

namespace pointfair::cli {
namespace {

constexpr std::pair<std::string_view, Format> kFormats[] = {
    {"ply", Format::ply},           {"pcd", Format::pcd}, {"las", Format::las},   {"laz", Format::laz},
    {"e57", Format::e57},           {"xyz", Format::xyz}, {"txt", Format::txt},   {"csv", Format::csv},
    {"pts", Format::pts},           {"off", Format::off}, {"obj", Format::obj},   {"ptx", Format::ptx},
    {"stl", Format::stl},           {"npy", Format::npy}, {"copc", Format::copc}, {"kitti", Format::kitti},
    {"nuscenes", Format::nuscenes}, {"glb", Format::glb}};

constexpr std::pair<std::string_view, Encoding> kEncodings[] = {{"ascii", Encoding::ascii},
                                                                {"binary", Encoding::binary},
                                                                {"binary-big-endian", Encoding::binary_big_endian},
                                                                {"binary-compressed", Encoding::binary_compressed}};

template <class Table>
std::vector<std::string> names(const Table& table) {
  std::vector<std::string> result;
  for (const auto& row : table) result.emplace_back(row.first);
  return result;
}

template <class Table>
auto find_value(const Table& table, std::string_view name) {
  const auto row = std::ranges::find_if(table, [&](const auto& r) { return r.first == name; });
  using Value = decltype(row->second);
  return row == std::end(table) ? std::optional<std::remove_const_t<Value>>() : row->second;
}

constexpr const char* kParamGroup = "Parameters";

std::string value_hint(const ParamInfo& info) {
  if (!info.values.empty()) return std::string(info.values) + (info.automatic ? "|auto" : "");
  std::string hint = "LENGTH";
  if (std::holds_alternative<int Params::*>(info.field) ||
      std::holds_alternative<std::optional<double> Params::*>(info.field))
    hint = fmt::format("{}..{}", info.min, info.max);
  return info.automatic ? hint + "|auto" : hint;
}

void add_param(CLI::App& command, const ParamInfo& info, ParamArguments& arguments) {
  const auto store = [&arguments, &info](const std::string& text) { arguments.given.emplace_back(&info, text); };
  CLI::Option* option = command.add_option_function<std::string>(flag_of(info.name), store, std::string(info.help));
  option->type_name(value_hint(info))
      ->group(info.expert ? kExpertGroup : kParamGroup)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
}

}  // namespace

CLI::Option* add_choice(CLI::App& command, const std::string& flag, std::string& value,
                        const std::vector<std::string>& words, const std::string& help) {
  return command.add_option(flag, value, help)
      ->check(CLI::IsMember(words).description(""))  // type_name() below lists the words
      ->type_name(fmt::format("{}", fmt::join(words, "|")));
}

void add_params(CLI::App& command, ParamArguments& arguments) {
  add_choice(command, "--preset", arguments.preset, {"paper"},
             "the paper: k 8, one iteration, constraint on, squared area weight")
      ->group(kParamGroup);
  for (const ParamInfo& info : kParams) add_param(command, info, arguments);
  command.set_help_all_flag("--help-all", "print this help with all flags");
  command.footer(
      "A LENGTH is a number in the file's unit, 5mm (or cm, m, ft) where the file says its unit, 0.5% of the diagonal "
      "of\n"
      "the bounding box, 2s mean spacings, or auto.\n"
      "--closeness-sigma and --normal-sigma also take 0.6r, radii of the neighbourhood. auto, the default, chooses a\n"
      "value from the data; pointfair info prints it.");
}

Params make_params(const ParamArguments& arguments, const Params& defaults) {
  Params params = arguments.preset == "paper" ? paper_preset() : defaults;
  for (const auto& [info, text] : arguments.given) set_param(params, *info, text);
  check_params(params);
  return params;
}

void add_limits(CLI::App& command, LimitArguments& arguments) {
  constexpr std::array<std::array<const char*, 2>, kLimitNames.size()> kHelp{{
      {"0..1", "how much to denoise: 0 keeps the input, 1 gives the full result, 0.5 the mean of both"},
      {"X,Y,Z,X,Y,Z", "move only the points in this box: lower corner, upper corner"},
      {"MATRIX:POLYGON", "move only the points that a view shows inside a polygon; the viewer writes it"},
      {"ATTRIBUTE=VALUES",
       "move only the points whose attribute has one of these integers, as in classification=2,6,64-255"},
      {"ATTRIBUTE=VALUES",
       "ignore the points whose attribute has one of these integers: such points keep their place and are nobody's "
       "neighbours"},
  }};
  for (std::size_t i = 0; i < kLimitNames.size(); ++i) {
    const auto store = [&arguments, i](const std::string& text) { arguments.given.emplace_back(kLimitNames[i], text); };
    CLI::Option* const option =
        command.add_option_function<std::string>("--" + std::string(kLimitNames[i]), store, kHelp[i][1]);
    option->type_name(kHelp[i][0])->group("Limits")->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
    // These are drawn in the viewer, which writes the words.
    const bool is_drawn = kLimitNames[i] == "box" || kLimitNames[i] == "lasso";
    if (is_drawn) option->group(kMoreGroup);
    const bool several = kLimitNames[i] == "where" || kLimitNames[i] == "ignore";
    if (several) option->multi_option_policy(CLI::MultiOptionPolicy::Join)->delimiter(';');
  }
}

Limits make_limits(const LimitArguments& arguments) {
  Limits limits;
  for (const auto& [name, text] : arguments.given) set_limit(limits, name, text);
  return limits;
}

void add_viewpoint(CLI::App& command, std::string& viewpoint) {
  command
      .add_option(
          "--viewpoint", viewpoint,
          "where the sensor stood, in file coordinates; or the attributes that hold it for each point; or none; "
          "default: from a PCD, E57 or PTX file, else by the distances between points, to mark mixed pixels")
      ->type_name("X,Y,Z|NAMES")
      ->group(kInputGroup);
}

void add_threads(CLI::App& command, unsigned& threads) {
  command.add_option("--threads", threads, "CPU threads; 0: all cores")
      ->check(CLI::Range(0, 4096).description(""))
      ->type_name("N");
}

CLI::Validator whole_number_from(std::uint64_t least) {
  const auto check = [least](const std::string& text) {
    std::uint64_t value = 0;
    const char* const last = text.data() + text.size();
    const auto [end, error] = std::from_chars(text.data(), last, value);
    if (error == std::errc() && end == last && value >= least) return std::string();
    return fmt::format("'{}' is no whole number from {} on, in digits alone", text, least);
  };
  return CLI::Validator(check, "");
}

CLI::Validator number_within(double low, double high) {
  const auto check = [low, high](const std::string& text) {
    double value = 0;
    const char* const last = text.data() + text.size();
    const auto [end, error] = std::from_chars(text.data(), last, value);
    if (error == std::errc() && end == last && value >= low && value <= high) return std::string();
    return fmt::format("'{}' is no number from {} to {}", text, low, high);
  };
  return CLI::Validator(check, "");
}

CLI::Validator name_of_folder() {
  const auto check = [](const std::string& text) {
    return text.empty() ? std::string("an empty name is no folder; is a variable of the shell unset?") : std::string();
  };
  return CLI::Validator(check, "");
}

std::optional<tbb::global_control> limit_threads(unsigned threads) {
  if (threads == 0) return std::nullopt;
  return std::make_optional<tbb::global_control>(tbb::global_control::max_allowed_parallelism, threads);
}

void add_device(CLI::App& command, DeviceArguments& arguments) {
  command
      .add_option(
          "--device", arguments.device,
          "auto: CUDA if there is a card, else the CPU; several cards, cuda:0,2 or cuda:all, share large clouds")
      ->type_name("auto|cpu|cuda[:N]");
  add_threads(command, arguments.threads);
}

Device make_device(const DeviceArguments& arguments) { return parse_device(arguments.device, arguments.threads); }

void add_input(CLI::App& command, InputArguments& arguments) {
  add_choice(command, "--in-format", arguments.format, names(kFormats),
             "format of the input; default: by its content and its extension")
      ->group(kInputGroup);
  command
      .add_option("--columns", arguments.columns,
                  "names of the columns of a text, from left to right, with x, y and z: x,y,z,intensity for instance")
      ->type_name("NAMES")
      ->group(kInputGroup);
  command.add_option("--skip", arguments.skip, "skip the first N lines of a text; a copy keeps them")
      ->check(whole_number_from(0))
      ->type_name("N")
      ->group(kInputGroup);
}

ReadOptions make_read_options(const InputArguments& arguments, unsigned threads) {
  ReadOptions options{
      .format = find_value(kFormats, arguments.format), .threads = threads, .skip_lines = arguments.skip};
  std::string_view rest = arguments.columns;
  while (!rest.empty()) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    options.columns.emplace_back(rest.substr(0, comma));
    rest.remove_prefix(std::min(comma + 1, rest.size()));
  }
  for (const char* axis : {"x", "y", "z"}) {
    if (!options.columns.empty() && std::ranges::count(options.columns, axis) != 1)
      throw Error(ErrorKind::usage,
                  fmt::format("--columns {}: x, y and z must be there, once each", arguments.columns));
  }
  return options;
}

void add_format(CLI::App& command, FormatArguments& arguments) {
  add_choice(command, "--format", arguments.format, names(kFormats),
             "format of the output; default: by its extension, that of the input for -")
      ->group(kOutputGroup);
  add_choice(command, "--encoding", arguments.encoding, names(kEncodings),
             "encoding of the output; default: that of the input, else binary")
      ->group(kOutputGroup);
  command.add_flag("--strict", arguments.strict, "make it an error if the output cannot hold all that the input holds")
      ->group(kOutputGroup);
}

WriteOptions make_write_options(const FormatArguments& arguments, const std::filesystem::path& path) {
  WriteOptions options{.format = find_value(kFormats, arguments.format)};
  const bool is_bin = path.extension() == ".bin";  // several formats share .bin: the output takes that of the input
  if (!options.format && path.has_extension() && !is_bin) options.format = format_to_write(path);
  options.encoding = find_value(kEncodings, arguments.encoding);
  options.strict = arguments.strict;
  if (options.format && options.encoding && options.format != Format::stl) {  // STL needs faces, which a point has not
    const Cloud one_point = {.origin = {}, .points = {{0, 0, 0}}, .added = {}, .source = nullptr};
    write_bytes(one_point, *options.format, options.encoding);  // refuses what the format does not have
  }
  return options;
}

void add_report(CLI::App& command, std::string& report) {
  command.add_option("--report", report, "write a JSON report; - is standard output")->type_name("FILE|-");
}

std::vector<std::string> format_names() { return names(kFormats); }

std::vector<std::string> with_dashes(std::vector<std::string> words) {
  for (std::string& word : words) {
    const std::size_t value = word.starts_with("--") ? word.find('=') + 1 : 0;  // 0 where there is no "="
    for (const char* name : {"/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"})
      if (word.compare(value, std::string::npos, name) == 0) word.replace(value, std::string::npos, "-");
  }
  return words;
}

std::vector<std::string> complete_switches(std::vector<std::string> words) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    const bool bare = std::ranges::any_of(kParams, [&](const ParamInfo& info) {
      return std::holds_alternative<bool Params::*>(info.field) && words[i] == flag_of(info.name);
    });
    const bool valued = i + 1 < words.size() && (words[i + 1] == "on" || words[i + 1] == "off");
    if (bare && !valued) words[i] += "=on";
  }
  return words;
}

Length parse_length(std::string_view name, const std::string& text) {
  if (text == "0") return 0.0;  // set_param() takes positive lengths only
  const ParamInfo row = {name, Stage::index, &Params::radius, 0, 1e30, false, "",
                         ""};  // set_param() needs a field of Params
  Params params;
  set_param(params, row, text);
  if (params.radius.is_automatic())
    throw Error(ErrorKind::usage, fmt::format("--{} cannot be auto; give a length", name));
  return params.radius;
}

double parse_share(std::string_view name, const std::string& text) {
  std::string_view digits = text;
  const bool percent = digits.ends_with('%');
  if (percent) digits.remove_suffix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (percent) value /= 100;
  if (error != std::errc() || end != digits.data() + digits.size() || !(value >= 0 && value <= 1))
    throw Error(ErrorKind::usage, fmt::format("--{} {}: use a share from 0% to 100%", name, text));
  return value;
}

}  // namespace pointfair::cli
