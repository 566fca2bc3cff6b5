// SPDX-License-Identifier: Apache-2.0
// Large arrays in large pages where the system has them: mapping small ones takes longer than reading a file.
#pragma once

#include <cstddef>

namespace pointfair::platform {

// For memory that nobody wrote to yet. A hint: where it fails, time is lost only.
void prefer_large_pages(void* from, std::size_t bytes);

}  // namespace pointfair::platform
