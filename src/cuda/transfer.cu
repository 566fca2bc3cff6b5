// SPDX-License-Identifier: Apache-2.0
#include "cuda/transfer.cuh"

namespace pointfair::cuda {
namespace {

constexpr std::size_t kSmall = 1 << 18;  // points; not worth a second part

// As much as can be sorted while the rest arrives, at the 54 GB/s of PCIe 5 and the speed of an H200; on a slower bus
// it only waits less.
constexpr std::size_t first_part_of(std::size_t count) { return count < kSmall ? 0 : count / 5 * 4; }

}  // namespace

Upload::Upload(const Context& context) : side_(context) {
  check(cudaEventCreateWithFlags(&first_, cudaEventDisableTiming), "making an event");
  check(cudaEventCreate(&all_), "making an event");
}

Upload::~Upload() {
  for (const cudaEvent_t event : {first_, all_})
    if (event != nullptr) cudaEventDestroy(event);
}

Arrival Upload::start(std::span<const Point> from, Point* to) {
  side_.fork();
  const std::size_t first_part = first_part_of(from.size());
  const auto copy = [&](std::size_t begin, std::size_t end) {
    if (begin == end) return;
    check(cudaMemcpyAsync(to + begin, from.data() + begin, (end - begin) * sizeof(Point), cudaMemcpyHostToDevice,
                          side_.stream()),
          "uploading points");
  };
  copy(0, first_part);
  check(cudaEventRecord(first_, side_.stream()), "uploading points");
  copy(first_part, from.size());
  check(cudaEventRecord(all_, side_.stream()), "uploading points");
  return {first_part, first_, all_, from};
}

}  // namespace pointfair::cuda
