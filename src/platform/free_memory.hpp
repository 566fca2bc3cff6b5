// SPDX-License-Identifier: Apache-2.0
// The memory that this process can have: of the machine, of its control group, of its own limits.
#pragma once

#include <cstdint>

namespace pointfair::platform {

// Bytes; 8 GB where the system does not say.
std::uint64_t free_memory();

}  // namespace pointfair::platform
