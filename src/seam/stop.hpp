// SPDX-License-Identifier: Apache-2.0
// How work hears that it was stopped.
#pragma once

#include <stop_token>

#include "pointfair/cloud.hpp"

namespace pointfair {

// Throws Error(interrupted) once a stop was requested.
inline void throw_if_stopped(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
}

}  // namespace pointfair
