// SPDX-License-Identifier: Apache-2.0
// The fast way to read coordinates from a line: each character is looked at once.
#pragma once

#include <fast_float/fast_float.h>

#include <string_view>

#include "io/text.hpp"
#include "pointfair/positions.hpp"

namespace pointfair::io {

/// Reads the three numbers that a line begins with. False where one is not plain, such as "+1" or a word: who then
/// goes from word to word knows whether it is a number, and what to say if not.
inline bool read_three_numbers(std::string_view line, Position& to) {
  const char* at = line.data();
  const char* const end = at + line.size();
  for (double& value : to) {
    while (at != end && is_blank(*at)) ++at;
    const auto [stop, error] = fast_float::from_chars(at, end, value);
    if (error != std::errc() || (stop != end && !is_blank(*stop))) return false;
    at = stop;
  }
  return true;
}

}  // namespace pointfair::io
