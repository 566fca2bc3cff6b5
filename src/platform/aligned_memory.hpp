// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace pointfair::platform {

// Memory that nobody wrote to; `bytes` is a multiple of the alignment, which is a power of two. Null where there is
// none.
void* allocate_aligned(std::size_t alignment, std::size_t bytes);
void free_aligned(void* from);

}  // namespace pointfair::platform
