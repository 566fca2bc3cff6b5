// SPDX-License-Identifier: Apache-2.0
// Large arrays in large pages where the system has them: mapping small ones takes longer than reading a file.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>

namespace pointfair::io {

/// For memory that nobody wrote to yet.
inline void prefer_large_pages([[maybe_unused]] void* from, [[maybe_unused]] std::size_t bytes) {
#ifdef MADV_HUGEPAGE
  constexpr std::uintptr_t kPage = std::uintptr_t{1} << 21;
  const auto at = reinterpret_cast<std::uintptr_t>(from);
  const std::uintptr_t begin = (at + kPage - 1) & ~(kPage - 1), end = (at + bytes) & ~(kPage - 1);
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
#endif
}

}  // namespace pointfair::io
