// SPDX-License-Identifier: Apache-2.0
// What the page asks for: parameters and limits, read from its JSON, and written out as a command or as C++ that gives
// the same file.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "message.hpp"
#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

struct Recipe {
  Params params;
  Limits limits;
  friend bool operator==(const Recipe&, const Recipe&) = default;
};

/// From {"params": {name: text}, "limits": {name: text}}; what is not named keeps its default. Throws ErrorKind::usage.
Recipe read_recipe(const Json& json);

/// Whether the row says something only of clouds with faces.
constexpr bool needs_faces(const ParamInfo& info) { return info.name == "connectivity" || is_of_meshes(info); }

/// The rows of kParams, as the page builds its controls from.
Json describe_params();

/// {name: text} of every parameter.
Json params_texts(const Params& params);

/// Where a recipe's cloud comes from, where it goes, and on which kind of device.
struct Errand {
  std::string input, output;
  std::string encoding;  ///< as --encoding takes it, or empty
  Device::Kind device = Device::cpu;
  std::string viewpoint{};  ///< as --viewpoint takes it, or empty
  ReadOptions reading{};    ///< of the input, but for its threads
};

/// A line for a POSIX shell.
std::string as_command(const Recipe& recipe, const Errand& errand);

/// A whole program.
std::string as_cpp(const Recipe& recipe, const Errand& errand);

/// The names that --encoding takes, and what they mean.
inline constexpr std::pair<std::string_view, Encoding> kEncodings[] = {
    {"ascii", Encoding::ascii},
    {"binary", Encoding::binary},
    {"binary-big-endian", Encoding::binary_big_endian},
    {"binary-compressed", Encoding::binary_compressed}};

/// Throws ErrorKind::usage for an unknown word; "" is none.
std::optional<Encoding> encoding_of(std::string_view word);

}  // namespace pointfair::viewer
