// SPDX-License-Identifier: Apache-2.0
// How long work takes on the host.
#pragma once

#include <chrono>

namespace pointfair {

using Clock = std::chrono::steady_clock;

inline double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace pointfair
