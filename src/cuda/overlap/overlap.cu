// SPDX-License-Identifier: Apache-2.0
#include "cuda/overlap/overlap.cuh"

namespace pointfair::cuda {

bool Overlapped::can_search(const NeighborSettings& settings) const {
  return index_.is_building() && !flow_.is_searched() && settings.k > 0 && settings.k <= kLargestGroupList &&
         !settings.constraint;
}

std::vector<FairedPart> Overlapped::faired_parts() const {
  std::vector<FairedPart> parts;
  for (std::size_t part = 0; flow_.is_done() && part < index_.parts().count(); ++part)
    parts.push_back({index_.parts().ends[part], flow_.done(part)});
  return parts;
}

cudaStream_t Overlapped::stream() const {
  return flow_.is_searched() ? flow_.stream() : index_.is_building() ? index_.stream() : context_.stream();
}

void Overlapped::join() {
  index_.join();
  flow_.join();
}

}  // namespace pointfair::cuda
