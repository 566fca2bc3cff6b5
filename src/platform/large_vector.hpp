// SPDX-License-Identifier: Apache-2.0
// Vectors for loops on many threads. Memory that nobody wrote to yet is mapped page by page as it is first met, which
// takes as long as a sort of what it holds; large pages, first met by all threads, take a tenth of it.
#pragma once

#include <cstddef>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

#include "platform/aligned_memory.hpp"
#include "platform/large_pages.hpp"

namespace pointfair::platform {

// An allocator in large pages that leaves elements undefined which no value is given for.
template <class T>
struct LargePages {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);
  using value_type = T;

  LargePages() = default;
  template <class U>
  LargePages(const LargePages<U>&) {}

  T* allocate(std::size_t count) {
    constexpr std::size_t kPage = std::size_t(2) << 20, kLine = 64;
    if (count > (std::size_t(-1) - kPage) / sizeof(T)) throw std::bad_alloc();
    const std::size_t wanted = count * sizeof(T), alignment = wanted >= kPage ? kPage : kLine,
                      bytes = (wanted + alignment - 1) / alignment * alignment;
    void* const made = allocate_aligned(alignment, bytes);
    if (made == nullptr) throw std::bad_alloc();
    if (alignment == kPage) prefer_large_pages(made, bytes);
    return static_cast<T*>(made);
  }
  void deallocate(T* from, std::size_t) { free_aligned(from); }

  template <class U>
  void construct(U* at) {
    ::new (static_cast<void*>(at)) U;
  }
  template <class U, class... Values>
  void construct(U* at, Values&&... values) {
    ::new (static_cast<void*>(at)) U(std::forward<Values>(values)...);
  }
  bool operator==(const LargePages&) const { return true; }
};

// Elements are undefined after LargeVector<T>(count) and resize(count), until they are written.
template <class T>
using LargeVector = std::vector<T, LargePages<T>>;

}  // namespace pointfair::platform
