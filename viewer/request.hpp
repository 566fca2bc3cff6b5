// SPDX-License-Identifier: Apache-2.0
// A run or a save that the page asks for, read from its JSON.
#pragma once

#include <array>
#include <chrono>
#include <optional>
#include <string>

#include "message.hpp"
#include "recipe.hpp"

namespace pointfair::viewer {

struct Request {
  Json id;  ///< returned as it came
  Recipe recipe;
  std::optional<std::array<double, 3>> focus;  ///< where the user looks, file coordinates
  bool held = false;                           ///< the hand still holds the slider: more is likely to come
  std::string output, encoding;                ///< of the file that is written, or that the command writes
  std::chrono::steady_clock::time_point received;

  double milliseconds_since_received() const;
};

/// Throws ErrorKind::usage, with what is wrong.
Request read_request(const Json& message, std::chrono::steady_clock::time_point received);

/// The text under `key`; empty if there is none.
std::string string_in(const Json& json, const char* key);

/// Accepts a name in a folder itself, of a format that can be written: nothing that leads elsewhere, is hidden, or
/// cannot be typed. Throws ErrorKind::usage otherwise.
void check_file_name(const std::string& name);

}  // namespace pointfair::viewer
