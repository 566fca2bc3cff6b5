// SPDX-License-Identifier: Apache-2.0
#include "cuda/stage_clock.cuh"

namespace pointfair::cuda {

StageClock::~StageClock() {
  for (const cudaEvent_t event : events_) cudaEventDestroy(event);
}

cudaEvent_t StageClock::mark(cudaStream_t stream) {
  constexpr std::size_t kMostMarks = 10000;  // nobody asks for the times
  if (used_ == kMostMarks) forget();
  if (used_ == events_.size()) {
    cudaEvent_t event = nullptr;
    check(cudaEventCreate(&event), "making an event");
    events_.push_back(event);
  }
  const cudaEvent_t event = events_[used_++];
  check(cudaEventRecord(event, stream), "timing a stage");
  return event;
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
