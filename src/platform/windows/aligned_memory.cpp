// SPDX-License-Identifier: Apache-2.0
#include "platform/aligned_memory.hpp"

#include <malloc.h>

namespace pointfair::platform {

void* allocate_aligned(std::size_t alignment, std::size_t bytes) { return ::_aligned_malloc(bytes, alignment); }
void free_aligned(void* from) { ::_aligned_free(from); }

}  // namespace pointfair::platform
