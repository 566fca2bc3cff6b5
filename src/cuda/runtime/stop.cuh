// SPDX-License-Identifier: Apache-2.0
// How kernels that take long hear of a stop that is requested while they run. They look now and then, give up, and
// leave results that are valid to read but wrong.
#pragma once

#include <cuda/atomic>
#include <optional>
#include <stop_token>

#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/transfer.cuh"
#include "cuda/runtime/warp.cuh"

namespace pointfair::cuda {

// Shared by threads of the host and kernels. Nothing else is handed over with it, so its order does not matter.
using Asked = ::cuda::atomic_ref<unsigned, ::cuda::thread_scope_system>;
using Heard = ::cuda::atomic_ref<unsigned, ::cuda::thread_scope_device>;

// What a kernel looks at; empty if its work is never stopped.
struct Stop {
  unsigned* asked = nullptr;  // in memory of the host: not 0 from the moment of the request
  unsigned* heard = nullptr;  // on the card: the first call whose kernels gave up, 0 if none did
  unsigned call = 0;          // the number of that which the kernel works for, not 0
  static constexpr unsigned kTurns = 1024;

  // Called by whole warps, of which one lane looks: those of all warps look at the same places, and looks at a place
  // wait for each other. One of kTurns `turn`s looks at the host's memory; the others see what it has seen.
  __device__ __forceinline__ bool is_heard(unsigned turn) const {
    if (heard == nullptr) return false;
    bool result = false;
    if (lane_number() == 0) {
      result = Heard(*heard).load(::cuda::std::memory_order_relaxed) != 0;
      if (turn % kTurns == 0 && !result && Asked(*asked).load(::cuda::std::memory_order_relaxed) != 0) {
        atomicCAS(heard, 0u, call);
        result = true;
      }
    }
    return __any_sync(kAllLanes, result);
  }
};

// Brings the stops of one backend to its kernels.
class StopLine {
 public:
  explicit StopLine(Context& context) : context_(context), heard_(context) { set_asked(0); }

  // For the kernels of the call of that number, which are to end when `stop` is requested.
  Stop listen(const std::stop_token& stop, unsigned call);
  // The first call whose kernels gave up, 0 if none did. Waits for the card if a stop was requested.
  unsigned given_up();
  // As if no stop had been requested. Waits as given_up().
  void clear();

 private:
  struct Ask {
    unsigned* asked;
    void operator()() const noexcept { Asked(*asked).store(1, ::cuda::std::memory_order_relaxed); }
  };
  bool is_asked() const { return Asked(*asked_.get()).load(::cuda::std::memory_order_relaxed) != 0; }
  void set_asked(unsigned value) const { Asked(*asked_.get()).store(value, ::cuda::std::memory_order_relaxed); }

  Context& context_;
  Pinned<unsigned> asked_;
  DeviceArray<unsigned> heard_;
  std::stop_token token_;
  std::optional<std::stop_callback<Ask>> callback_;
};

}  // namespace pointfair::cuda
