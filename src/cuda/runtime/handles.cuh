// SPDX-License-Identifier: Apache-2.0
// Owners of CUDA's handles, so that none leaks where a constructor ends half way.
#pragma once

#include <cuda_runtime_api.h>

#include <utility>
#include <vector>

namespace pointfair::cuda {

// Throws Error(device) naming what failed and what to do; a lost card cannot be used again by this process.
void check(cudaError_t status, const char* doing);

// `destroy` is CUDA's function for that kind of handle.
template <class T, cudaError_t (*destroy)(T)>
class Handle {
 public:
  Handle() = default;
  ~Handle() { reset(); }
  Handle(Handle&& other) noexcept : value_(std::exchange(other.value_, nullptr)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(value_, other.value_);
    return *this;
  }
  T get() const { return value_; }
  T* place() {  // for a call that makes one
    reset();
    return &value_;
  }
  void reset() {
    if (value_ != nullptr) destroy(std::exchange(value_, nullptr));
  }

 private:
  T value_ = nullptr;
};

using Stream = Handle<cudaStream_t, cudaStreamDestroy>;
using MemoryPool = Handle<cudaMemPool_t, cudaMemPoolDestroy>;

// A mark in a stream, for order alone or for time too.
class Event {
 public:
  enum class Kind : unsigned { order = cudaEventDisableTiming, time = cudaEventDefault };
  explicit Event(Kind kind = Kind::order) {
    check(cudaEventCreateWithFlags(handle_.place(), static_cast<unsigned>(kind)), "making an event");
  }
  void record(cudaStream_t stream) const { check(cudaEventRecord(handle_.get(), stream), "ordering work"); }
  cudaEvent_t get() const { return handle_.get(); }

 private:
  Handle<cudaEvent_t, cudaEventDestroy> handle_;
};

// Events made as they are needed.
class Events {
 public:
  explicit Events(Event::Kind kind = Event::Kind::order) : kind_(kind) {}
  const Event& at(std::size_t number) {
    while (events_.size() <= number) events_.emplace_back(kind_);
    return events_[number];
  }
  void record(std::size_t number, cudaStream_t stream) { at(number).record(stream); }
  cudaEvent_t operator[](std::size_t number) const { return events_[number].get(); }

 private:
  Event::Kind kind_;
  std::vector<Event> events_;
};

}  // namespace pointfair::cuda
