// SPDX-License-Identifier: Apache-2.0
#include "platform/aligned_memory.hpp"

#include <cstdlib>

namespace pointfair::platform {

void* allocate_aligned(std::size_t alignment, std::size_t bytes) { return std::aligned_alloc(alignment, bytes); }
void free_aligned(void* from) { std::free(from); }

}  // namespace pointfair::platform
