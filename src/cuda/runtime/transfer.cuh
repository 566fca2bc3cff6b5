// SPDX-License-Identifier: Apache-2.0
// Between host and card: page-locked memory, and an upload that runs beside the work on what has arrived.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/parts.hpp"

namespace pointfair::cuda {

// Page-locked memory of the host for some values, which the card reads and writes while the host goes on.
template <class T>
class Pinned {
 public:
  explicit Pinned(std::size_t count = 1) { resize(count); }
  // Contents are not kept when it grows.
  void resize(std::size_t count) {
    if (count <= capacity_) return;
    values_.reset();
    capacity_ = 0;
    void* memory = nullptr;
    check(cudaHostAlloc(&memory, count * sizeof(T), cudaHostAllocDefault), "allocating page-locked memory");
    values_.reset(static_cast<T*>(memory));
    capacity_ = count;
  }
  T* get() const { return values_.get(); }

 private:
  struct Release {
    void operator()(T* values) const { cudaFreeHost(values); }
  };
  std::unique_ptr<T, Release> values_;
  std::size_t capacity_ = 0;
};

// A cloud on its way to the card: each of its parts is there after an event, all of it after the last.
struct Arrival {
  Parts parts;
  std::span<const cudaEvent_t> there;
  cudaEvent_t begun;
  cudaEvent_t all() const { return there.back(); }
};

// Copies of points. The driver brings pageable memory into page-locked pieces with one thread, at 7 to 14 GB/s; here
// all threads do, while the card copies the pieces before.
class Staging {
 public:
  Staging() : pieces_(0) {}

  // Start to copy on `stream`. Where the host's memory is pageable, uploads return once `from` may be changed, and
  // downloads of many points once all are there.
  void upload(std::span<const Point> from, Point* to, cudaStream_t stream);
  void download(const Point* from, std::span<Point> to, cudaStream_t stream);

 private:
  bool stages(const Point* host, std::size_t points);
  void wait_for(std::size_t number);  // what was copied last by way of a piece

  Pinned<Point> pieces_;
  Events done_;  // of each piece
};

class Upload {
 public:
  Upload(const Context& context, Staging& staging);

  // Starts to copy, after all that the context's stream still has to do. From page-locked memory this returns at once.
  Arrival start(std::span<const Point> from, Parts parts, Point* to);
  // Returns when `from` may be changed.
  void finish() const;

 private:
  Staging& staging_;
  SideStream side_;
  Events events_{Event::Kind::time};  // the start, then the parts
  std::vector<cudaEvent_t> there_;    // of the parts
  std::size_t parts_ = 0;
};

}  // namespace pointfair::cuda
