// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {
namespace {

// In GB, or in MB below one.
std::string size_of(std::uint64_t bytes) {
  const bool is_large = bytes >= 1'000'000'000;
  const std::uint64_t tenth = is_large ? 100'000'000 : 100'000, tenths = (bytes + tenth / 2) / tenth;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + (is_large ? " GB" : " MB");
}

}  // namespace

void check(cudaError_t status, const char* doing) {
  if (status == cudaSuccess) return;
  const std::string reason = std::string(cudaGetErrorName(status)) + ", " + cudaGetErrorString(status);
  cudaGetLastError();  // an error that did not hurt the card must not be met again by the next launch
  if (status == cudaErrorMemoryAllocation)
    throw Error(ErrorKind::memory, std::string("CUDA: out of device memory while ") + doing +
                                       "; free the card, take fewer points, or run on the CPU");
  throw Error(ErrorKind::device, std::string("CUDA failed while ") + doing + " (" + reason +
                                     "); if this repeats, restart the program or run on the CPU");
}

Context::Context(int card, std::uint64_t limit) : card_(card), limit_(limit) {
  enter();
  cudaDeviceProp properties{};
  check(cudaGetDeviceProperties(&properties, card), "asking for the card's properties");
  name_ = properties.name;
  processors_ = properties.multiProcessorCount;
  launches_early_ = properties.major >= 9;
  check(cudaStreamCreateWithFlags(stream_.place(), cudaStreamNonBlocking), "making a stream");
  current_ = main_stream();
  int has_pools = 0;
  check(cudaDeviceGetAttribute(&has_pools, cudaDevAttrMemoryPoolsSupported, card), "asking for memory pools");
  if (has_pools == 0) return;
  cudaMemPoolProps wanted{};
  wanted.allocType = cudaMemAllocationTypePinned;
  wanted.location = {cudaMemLocationTypeDevice, card};
  check(cudaMemPoolCreate(pool_.place(), &wanted), "making a memory pool");
  std::uint64_t keep_all = UINT64_MAX;
  check(cudaMemPoolSetAttribute(pool_.get(), cudaMemPoolAttrReleaseThreshold, &keep_all), "setting up a memory pool");
}

Context::~Context() {
  cudaSetDevice(card_);
  cudaStreamSynchronize(main_stream());  // the handles go after it
}

bool Context::admit(int card) {
  if (card == card_) return true;
  if (pool_.get() == nullptr) return false;
  for (const auto& [known, can] : admitted_)
    if (known == card) return can;
  int can = 0;
  check(cudaDeviceCanAccessPeer(&can, card, card_), "asking for access between cards");
  if (can != 0) {
    cudaMemAccessDesc access{};
    access.location = {cudaMemLocationTypeDevice, card};
    access.flags = cudaMemAccessFlagsProtReadWrite;
    check(cudaMemPoolSetAccess(pool_.get(), &access, 1), "giving access between cards");
  }
  admitted_.emplace_back(card, can != 0);
  return can != 0;
}

SideStream::SideStream(const Context& context, Urgency urgency) : context_(context) {
  int least = 0, greatest = 0;
  check(cudaDeviceGetStreamPriorityRange(&least, &greatest), "asking for priorities");
  check(
      cudaStreamCreateWithPriority(stream_.place(), cudaStreamNonBlocking, urgency == Urgency::high ? greatest : least),
      "making a stream");
}

SideStream::~SideStream() { cudaStreamSynchronize(stream()); }

void* Context::allocate(std::size_t bytes) {
  void* memory = nullptr;
  const cudaError_t status = held_bytes_ + bytes > limit_ ? cudaErrorMemoryAllocation
                             : pool_.get() != nullptr
                                 ? cudaMallocFromPoolAsync(&memory, bytes, pool_.get(), main_stream())
                                 : cudaMalloc(&memory, bytes);
  if (status == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    std::size_t free_bytes = 0, all_bytes = 0;
    cudaMemGetInfo(&free_bytes, &all_bytes);
    throw Error(ErrorKind::memory, name_ + ": " + size_of(bytes) + " more are needed, " + size_of(held_bytes_) +
                                       " are held, " + size_of(free_bytes) + " of " + size_of(all_bytes) +
                                       " are free; take fewer neighbours, or run on the CPU");
  }
  check(status, "allocating device memory");
  held_bytes_ += bytes;
  peak_bytes_ = std::max(peak_bytes_, held_bytes_);
  return memory;
}

void Context::release(void* memory, std::size_t bytes) noexcept {
  held_bytes_ -= bytes;
  if (pool_.get() != nullptr) {
    cudaFreeAsync(memory, main_stream());
  } else {
    cudaFree(memory);
  }
}

}  // namespace pointfair::cuda
