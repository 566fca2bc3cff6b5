// SPDX-License-Identifier: Apache-2.0
// Times work on a stream by events, so that nothing has to wait while it runs.
#pragma once

#include <string>
#include <vector>

#include "cuda/runtime/memory.cuh"
#include "pointfair/report.hpp"

namespace pointfair::cuda {

class StageClock {
 public:
  explicit StageClock(Context& context) : context_(context) {}

  // The moment at which the context's stream has done all that it was given before. A stage that follows another at
  // once starts where that ends: marks cost the card a microsecond or two each.
  cudaEvent_t start() { return last_ != nullptr ? last_ : mark(context_.stream()); }
  // `name` took the time from `from` until `stream` has done all that it was given before.
  void note(const char* name, cudaEvent_t from, cudaStream_t stream) {
    last_ = mark(stream);
    intervals_.push_back({name, from, last_});
  }
  void note(const char* name, cudaEvent_t from) { note(name, from, context_.stream()); }
  void note_between(const char* name, cudaEvent_t from, cudaEvent_t to) { intervals_.push_back({name, from, to}); }
  // The host has waited, so the card is idle until the next stage starts.
  void pause() { last_ = nullptr; }
  // Waits for what was noted, one after the other, so that the last is all that is left to read when the card is done.
  void read();
  // What was noted since the last call; waits for it. All marks are used up.
  std::vector<StageTime> take();
  void forget() {
    times_.clear();
    intervals_.clear();
    used_ = 0;
    last_ = nullptr;
  }

 private:
  struct Interval {
    const char* name;
    cudaEvent_t from, to;
  };
  cudaEvent_t mark(cudaStream_t stream);

  Context& context_;
  cudaEvent_t last_ = nullptr;
  Events events_{Event::Kind::time};
  std::size_t used_ = 0;             // of events_
  std::vector<Interval> intervals_;  // not yet read
  std::vector<StageTime> times_;
};

}  // namespace pointfair::cuda
