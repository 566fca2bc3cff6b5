// SPDX-License-Identifier: Apache-2.0
// Flags that several verbs share. Those of the parameters are generated from kParams.
#pragma once

#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pointfair/pointfair.hpp"

namespace pointfair::cli {

/// An option that takes one of the words.
CLI::Option* add_choice(CLI::App& command, const std::string& flag, std::string& value,
                        const std::vector<std::string>& words, const std::string& help);

/// The groups of flags that `--help` leaves to `--help-all`, of verbs that have it.
inline constexpr const char* kExpertGroup = "Expert parameters";
inline constexpr const char* kInputGroup = "Input";
inline constexpr const char* kOutputGroup = "Output";
inline constexpr const char* kMoreGroup = "More";

/// The parameters given, in their order; they come after the preset, wherever that stands.
struct ParamArguments {
  std::string preset;
  std::vector<std::pair<const ParamInfo*, std::string>> given;
};
void add_params(CLI::App& command, ParamArguments& arguments);

/// `defaults` or the preset, then what was given. Throws ErrorKind::usage.
Params make_params(const ParamArguments& arguments, const Params& defaults);

/// The limits given, by name.
struct LimitArguments {
  std::vector<std::pair<std::string_view, std::string>> given;
};
void add_limits(CLI::App& command, LimitArguments& arguments);

/// Throws ErrorKind::usage.
Limits make_limits(const LimitArguments& arguments);

struct DeviceArguments {
  std::string device = "auto";
  unsigned threads = 0;
};
void add_device(CLI::App& command, DeviceArguments& arguments);
/// --viewpoint.
void add_viewpoint(CLI::App& command, std::string& viewpoint);
void add_threads(CLI::App& command, unsigned& threads);

/// Refuses all but whole numbers from `least` on, of which CLI11 would read -1 as 2^64 - 1.
CLI::Validator whole_number_from(std::uint64_t least);
/// Refuses all but numbers in this range, of which CLI11 would let NaN pass.
CLI::Validator number_within(double low, double high);
/// Refuses the empty name, which would count as none given.
CLI::Validator name_of_folder();

/// Keeps this program's own loops to so many threads while it lives; 0: all cores.
std::optional<tbb::global_control> limit_threads(unsigned threads);

/// Throws ErrorKind::usage for a word that names no device.
Device make_device(const DeviceArguments& arguments);

/// The flags that say what an input does not say of itself: its format, its columns, lines to skip.
struct InputArguments {
  std::string format, columns;
  std::uint64_t skip = 0;

  bool any() const { return !format.empty() || !columns.empty() || skip > 0; }
};
void add_input(CLI::App& command, InputArguments& arguments);
/// Throws ErrorKind::usage for columns that do not have x, y and z.
ReadOptions make_read_options(const InputArguments& arguments, unsigned threads);

struct FormatArguments {
  std::string format, encoding;
  bool strict = false;
};
void add_format(CLI::App& command, FormatArguments& arguments);

/// Decides what can be decided before any work is done; the format stays open where the input's will be taken. Throws
/// ErrorKind::file for an unknown extension, ErrorKind::usage for an encoding that the format does not have.
WriteOptions make_write_options(const FormatArguments& arguments, const std::filesystem::path& path);

void add_report(CLI::App& command, std::string& report);

/// The names of the formats, as --format takes them.
std::vector<std::string> format_names();

/// With "-" where /dev/stdout or another of its names stands: opened by such a name, a file that a shell redirects to
/// would be replaced.
std::vector<std::string> with_dashes(std::vector<std::string> words);

/// Adds "=on" to a switch that stands alone, "--constraint", so that it need not be followed by a value.
std::vector<std::string> complete_switches(std::vector<std::string> words);

/// A length as the parameters write it, or 0. `name` appears in errors. Throws ErrorKind::usage.
Length parse_length(std::string_view name, const std::string& text);

/// "1%" or "0.01" as 0.01. Throws ErrorKind::usage outside [0, 1].
double parse_share(std::string_view name, const std::string& text);

}  // namespace pointfair::cli
