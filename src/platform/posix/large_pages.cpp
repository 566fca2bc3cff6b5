// SPDX-License-Identifier: Apache-2.0
#include "platform/large_pages.hpp"

#include <sys/mman.h>

#include <cstdint>

namespace pointfair::platform {

#ifdef MADV_HUGEPAGE

void prefer_large_pages(void* from, std::size_t bytes) {
  constexpr std::uintptr_t kPage = std::uintptr_t{1} << 21;
  const auto at = reinterpret_cast<std::uintptr_t>(from);
  const std::uintptr_t begin = (at + kPage - 1) & ~(kPage - 1), end = (at + bytes) & ~(kPage - 1);
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
}

#else

void prefer_large_pages(void*, std::size_t) {}

#endif

}  // namespace pointfair::platform
