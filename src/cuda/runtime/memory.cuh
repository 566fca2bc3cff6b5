// SPDX-License-Identifier: Apache-2.0
// Checked CUDA calls, and device arrays from one memory pool and one stream.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cuda/runtime/handles.cuh"

namespace pointfair::cuda {

// One card, a main stream, one pool of device memory. Counts the bytes that its arrays hold.
class Context {
 public:
  // Uses at most `limit` bytes of the card.
  Context(int card, std::uint64_t limit);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // Makes the card current for this thread; every public call of the backend begins with it.
  void enter() const { check(cudaSetDevice(card_), "choosing the card"); }
  // Where work is given to: the main stream, or that of the innermost OnStream. Memory is allocated and released in the
  // order of the main stream, whatever this is.
  cudaStream_t stream() const { return current_; }
  cudaStream_t main_stream() const { return stream_.get(); }
  // Lets another card read and write this card's arrays, if both can, and returns whether it does; else copies between
  // them go through the host.
  bool admit(int card);
  int card() const { return card_; }
  int processors() const { return processors_; }
  bool launches_early() const { return launches_early_; }  // what src/cuda/runtime/launch.cuh needs
  const std::string& name() const { return name_; }
  void finish() const { check(cudaStreamSynchronize(main_stream()), "computing"); }  // the main stream
  // What is given to the main stream from now on waits.
  void wait_for(cudaEvent_t event) const { check(cudaStreamWaitEvent(main_stream(), event), "ordering work"); }

  // Throws Error(memory) if the card has not that much left.
  void* allocate(std::size_t bytes);
  void release(void* memory, std::size_t bytes) noexcept;
  std::uint64_t peak_bytes() const { return peak_bytes_; }
  void reset_peak() { peak_bytes_ = held_bytes_; }

 private:
  friend class OnStream;
  int card_;
  int processors_ = 0;
  bool launches_early_ = false;
  std::string name_;
  Stream stream_;
  cudaStream_t current_ = nullptr;
  std::vector<std::pair<int, bool>> admitted_;  // or refused
  MemoryPool pool_;                             // none where the card has no pools: plain cudaMalloc then
  const std::uint64_t limit_;
  std::uint64_t held_bytes_ = 0, peak_bytes_ = 0;
};

enum class Urgency : bool { usual, high };  // whose work goes first where both have some

// A second stream beside a context's.
class SideStream {
 public:
  explicit SideStream(const Context& context, Urgency urgency = Urgency::usual);
  ~SideStream();
  SideStream(const SideStream&) = delete;
  SideStream& operator=(const SideStream&) = delete;

  cudaStream_t stream() const { return stream_.get(); }
  // What this stream gets from now on waits for what the context's was given before.
  void fork() const {
    event_.record(context_.main_stream());
    wait_for(event_.get());
  }
  void wait_for(cudaEvent_t event) const { check(cudaStreamWaitEvent(stream(), event), "ordering work"); }
  // The other way round.
  void join() const {
    event_.record(stream());
    context_.wait_for(event_.get());
  }

 private:
  const Context& context_;
  Stream stream_;
  Event event_;
};

// Work is given to another stream than the context's as long as this lives.
class OnStream {
 public:
  OnStream(Context& context, const SideStream& side) : context_(context), before_(context.current_) {
    context.current_ = side.stream();
  }
  ~OnStream() { context_.current_ = before_; }
  OnStream(const OnStream&) = delete;
  OnStream& operator=(const OnStream&) = delete;

 private:
  Context& context_;
  cudaStream_t before_;
};

// An array on the card. Contents are not kept when it grows.
template <class T>
class DeviceArray {
 public:
  explicit DeviceArray(Context& context) : context_(&context) {}
  ~DeviceArray() { release(); }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;

  void resize(std::size_t count) {
    if (count > capacity_) {
      release();
      data_ = static_cast<T*>(context_->allocate(count * sizeof(T)));
      capacity_ = count;
    }
    size_ = count;
  }
  void release() noexcept {
    if (data_ != nullptr) context_->release(data_, capacity_ * sizeof(T));
    data_ = nullptr;
    capacity_ = size_ = 0;
  }
  void swap(DeviceArray& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }
  // Start to copy from the host and, of its first values, to the host, in the order of the context's stream.
  void upload(std::span<const T> from, const char* doing) {
    resize(from.size());
    copy(data_, from.data(), from.size(), cudaMemcpyHostToDevice, doing);
  }
  void download(std::span<T> to, const char* doing) const {
    copy(to.data(), data_, to.size(), cudaMemcpyDeviceToHost, doing);
  }
  // Its first value; waits for the main stream.
  T first(const char* doing) const {
    T value{};
    download({&value, 1}, doing);
    context_->finish();
    return value;
  }
  void clear(const char* doing) const {
    if (size_ > 0) check(cudaMemsetAsync(data_, 0, size_ * sizeof(T), context_->stream()), doing);
  }
  T* data() const { return data_; }
  std::size_t size() const { return size_; }

 private:
  void copy(T* to, const T* from, std::size_t count, cudaMemcpyKind kind, const char* doing) const {
    if (count > 0) check(cudaMemcpyAsync(to, from, count * sizeof(T), kind, context_->stream()), doing);
  }

  Context* context_;
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

// Makes a call of CUB, which asks for as many bytes as it wants if it gets no memory.
template <class Call>
void with_scratch(Context& context, const char* doing, const Call& call) {
  std::size_t bytes = 0;
  check(call(nullptr, bytes), doing);
  DeviceArray<std::byte> scratch(context);
  scratch.resize(bytes);
  check(call(scratch.data(), bytes), doing);
}

// Starts a kernel in the order of the context's stream.
template <class... Parameters, class... Arguments>
void launch(const Context& context, const char* doing, void (*kernel)(Parameters...), unsigned blocks, unsigned threads,
            Arguments&&... arguments) {
  kernel<<<blocks, threads, 0, context.stream()>>>(std::forward<Arguments>(arguments)...);
  check(cudaGetLastError(), doing);
}

// Blocks of `per_block` that cover `count`.
inline unsigned blocks_for(std::size_t count, std::size_t per_block) {
  return static_cast<unsigned>(std::max<std::size_t>(1, (count + per_block - 1) / per_block));
}

}  // namespace pointfair::cuda
