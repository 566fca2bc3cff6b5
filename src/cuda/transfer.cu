// SPDX-License-Identifier: Apache-2.0
#include "cuda/transfer.cuh"

namespace pointfair::cuda {

Upload::Upload(const Context& context) : side_(context) {}

Upload::~Upload() {
  for (const cudaEvent_t event : events_) cudaEventDestroy(event);
}

cudaEvent_t Upload::event(std::size_t number) {
  while (events_.size() <= number) {
    cudaEvent_t made = nullptr;
    check(cudaEventCreate(&made), "making an event");
    events_.push_back(made);
  }
  return events_[number];
}

Arrival Upload::start(std::span<const Point> from, Parts parts, Point* to) {
  side_.fork();
  parts_ = parts.count();
  event(parts_);  // makes all
  check(cudaEventRecord(events_[0], side_.stream()), "uploading points");
  for (std::size_t part = 0; part < parts_; ++part) {
    const std::size_t begin = parts.begin(part), size = parts.size(part);
    if (size > 0)
      check(cudaMemcpyAsync(to + begin, from.data() + begin, size * sizeof(Point), cudaMemcpyHostToDevice,
                            side_.stream()),
            "uploading points");
    check(cudaEventRecord(events_[part + 1], side_.stream()), "uploading points");
  }
  return {std::move(parts), std::span(events_).subspan(1, parts_), events_[0], from};
}

void Upload::finish() const {
  if (parts_ > 0) check(cudaEventSynchronize(events_[parts_]), "uploading points");
}

}  // namespace pointfair::cuda
