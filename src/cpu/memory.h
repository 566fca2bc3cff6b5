// SPDX-License-Identifier: Apache-2.0
// Large arrays of the CPU backend: uninitialised, aligned to huge pages where that helps, and metered.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "platform/aligned_memory.hpp"
#include "platform/large_pages.hpp"
#include "pointfair/cloud.hpp"

namespace pointfair::cpu {

// Bytes held now and at most since reset.
struct MemoryMeter {
  std::uint64_t held = 0, peak = 0;
  void add(std::uint64_t bytes) { peak = std::max(peak, held += bytes); }
  void remove(std::uint64_t bytes) { held -= bytes; }
  void reset_peak() { peak = held; }
};

// So many elements before they are needed, a loop over places that lie scattered in memory prefetches them.
inline constexpr std::size_t kPrefetchedAhead = 64;

// An array of trivial T whose elements start undefined. Growing drops the contents; shrinking keeps the allocation, so
// that a pipeline that is loaded again does not fault its pages in again.
template <class T>
class Buffer {
 public:
  explicit Buffer(MemoryMeter& meter) : meter_(&meter) {}
  Buffer(Buffer&& other) noexcept
      : meter_(other.meter_),
        data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(meter_, other.meter_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ~Buffer() { release(); }

  void resize(std::size_t size) {
    if (size > capacity_) {
      release();
      allocate(size);
    }
    size_ = size;
  }
  void release() {
    if (!data_) return;
    platform::free_aligned(data_);
    meter_->remove(capacity_ * sizeof(T));
    data_ = nullptr;
    size_ = capacity_ = 0;
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  std::size_t size() const { return size_; }
  T& operator[](std::size_t i) { return data_[i]; }
  const T& operator[](std::size_t i) const { return data_[i]; }

 private:
  void allocate(std::size_t size) {
    constexpr std::size_t kHugePage = std::size_t(2) << 20;
    const std::size_t wanted = size * sizeof(T);
    const std::size_t alignment = wanted >= kHugePage ? kHugePage : 64;
    const std::size_t bytes = (wanted + alignment - 1) / alignment * alignment;
    data_ = static_cast<T*>(platform::allocate_aligned(alignment, bytes));
    if (!data_)
      throw Error(ErrorKind::memory, "out of memory: cannot allocate " + std::to_string(wanted >> 20) +
                                         " MiB beside the " + std::to_string(meter_->held >> 20) +
                                         " MiB held; use a smaller k, or cut the cloud");
    if (alignment == kHugePage) platform::prefer_large_pages(data_, bytes);
    capacity_ = size;
    meter_->add(capacity_ * sizeof(T));
  }

  MemoryMeter* meter_;
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace pointfair::cpu
