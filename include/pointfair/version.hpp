// SPDX-License-Identifier: Apache-2.0
// The version that this header belongs to; CMake reads it from here.
#pragma once

#include "pointfair/export.hpp"

#define POINTFAIR_VERSION "0.1.0"

namespace pointfair {

/// The version of the compiled library, "major.minor.patch".
POINTFAIR_EXPORT const char* version() noexcept;

}  // namespace pointfair
