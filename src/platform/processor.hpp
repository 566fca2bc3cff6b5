// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace pointfair::platform {

// As its maker calls it; "CPU" where the system does not say.
std::string processor_name();

}  // namespace pointfair::platform
