// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/stage_clock.cuh"

namespace pointfair::cuda {

cudaEvent_t StageClock::mark(cudaStream_t stream) {
  constexpr std::size_t kMostMarks = 10000;  // nobody asks for the times
  if (used_ == kMostMarks) forget();
  const Event& event = events_.at(used_++);
  event.record(stream);
  return event.get();
}

void StageClock::read() {
  for (const Interval& interval : intervals_) {
    check(cudaEventSynchronize(interval.to), "computing");
    float milliseconds = 0;
    check(cudaEventElapsedTime(&milliseconds, interval.from, interval.to), "timing a stage");
    times_.push_back({interval.name, milliseconds});
  }
  intervals_.clear();
}

std::vector<StageTime> StageClock::take() {
  read();
  std::vector<StageTime> times = std::move(times_);
  forget();
  return times;
}

}  // namespace pointfair::cuda
