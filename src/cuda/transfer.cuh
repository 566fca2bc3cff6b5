// SPDX-License-Identifier: Apache-2.0
// Between host and card: page-locked memory, and an upload that runs beside the work on its first part.
#pragma once

#include <span>

#include "cuda/index.cuh"
#include "cuda/memory.cuh"

namespace pointfair::cuda {

// Page-locked memory of the host for one value, to which the card writes while the host goes on.
template <class T>
class Pinned {
 public:
  Pinned() { check(cudaHostAlloc(&value_, sizeof(T), cudaHostAllocDefault), "allocating page-locked memory"); }
  ~Pinned() { cudaFreeHost(value_); }
  Pinned(const Pinned&) = delete;
  Pinned& operator=(const Pinned&) = delete;
  T* get() const { return value_; }

 private:
  T* value_ = nullptr;
};

class Upload {
 public:
  explicit Upload(const Context& context);
  ~Upload();
  Upload(const Upload&) = delete;
  Upload& operator=(const Upload&) = delete;

  // Starts to copy, after all that the context's stream still has to do. From page-locked memory this returns at once.
  Arrival start(std::span<const Point> from, Point* to);
  // Returns when `from` may be changed.
  void finish() const { check(cudaEventSynchronize(all_), "uploading points"); }

 private:
  SideStream side_;
  cudaEvent_t first_ = nullptr, all_ = nullptr;
};

}  // namespace pointfair::cuda
