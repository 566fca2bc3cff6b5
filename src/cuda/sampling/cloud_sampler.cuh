// SPDX-License-Identifier: Apache-2.0
// Draws the sample of a cloud on the card (src/seam/cloud_sample.hpp), mostly in one wait.
#pragma once

#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/transfer.cuh"
#include "seam/cloud_sample.hpp"

namespace pointfair::cuda {

// What is known of a cloud before its candidates are looked at.
struct SampleState {
  unsigned min[3], max[3];  // ordered() floats
  unsigned valid, candidates;
};

class CloudSampler {
 public:
  explicit CloudSampler(Context& context) : context_(context), state_(context), candidates_(context) {}

  // Of `points` on the card, in upload order. Waits for the card.
  CloudSample draw(const Point* points, std::size_t count, std::size_t wanted);

 private:
  // Brings the candidates and the state to the host. Waits.
  void collect(const Point* points, std::size_t count, Candidates wanted);
  std::vector<SampleCandidate> fetched(std::uint32_t limit) const;

  Context& context_;
  DeviceArray<SampleState> state_;
  DeviceArray<SampleCandidate> candidates_;
  Pinned<SampleState> fetched_state_;
  Pinned<SampleCandidate> fetched_;
};

}  // namespace pointfair::cuda
