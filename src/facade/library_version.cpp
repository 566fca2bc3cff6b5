// SPDX-License-Identifier: Apache-2.0
#include "pointfair/version.hpp"

namespace pointfair {

const char* version() noexcept { return POINTFAIR_VERSION; }

}  // namespace pointfair
