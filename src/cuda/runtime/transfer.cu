// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/transfer.cuh"

namespace pointfair::cuda {

Upload::Upload(const Context& context) : side_(context) {}

Arrival Upload::start(std::span<const Point> from, Parts parts, Point* to) {
  side_.fork();
  parts_ = parts.count();
  there_.clear();
  events_.record(0, side_.stream());
  for (std::size_t part = 0; part < parts_; ++part) {
    const std::size_t begin = parts.begin(part), size = parts.size(part);
    if (size > 0)
      check(cudaMemcpyAsync(to + begin, from.data() + begin, size * sizeof(Point), cudaMemcpyHostToDevice,
                            side_.stream()),
            "uploading points");
    events_.record(part + 1, side_.stream());
    there_.push_back(events_[part + 1]);
  }
  return {std::move(parts), there_, events_[0]};
}

void Upload::finish() const {
  if (parts_ > 0) check(cudaEventSynchronize(events_[parts_]), "uploading points");
}

}  // namespace pointfair::cuda
