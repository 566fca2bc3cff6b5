// SPDX-License-Identifier: Apache-2.0
// One coordinate as a float relative to the cloud's origin, and back.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

namespace pointfair::io {

inline float to_offset(double value, double origin) { return static_cast<float>(value - origin); }

/// Any NaN is like any other: on its way through a double a signalling one becomes quiet.
inline bool same_bits(float a, float b) {
  return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b) || (std::isnan(a) && std::isnan(b));
}

/// The coordinate that was `value`, with the offset `before` from the origin it was read with, and is `now` away from
/// `origin`, which lies `shift` beyond that one. The value keeps what a float cannot hold of it.
inline double moved_value(double value, float before, float now, double origin, double shift) {
  return std::isfinite(before) ? value + (static_cast<double>(now) - before + shift) : origin + now;
}

}  // namespace pointfair::io
