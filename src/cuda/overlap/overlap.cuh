// SPDX-License-Identifier: Apache-2.0
// Computes on parts of a cloud while others are copied; this file is all that the chain sees of parts. In a cloud in
// spatial order, as scanners and tilings write them, consecutive parts lie apart: each is indexed, searched and faired
// as soon as it and what it needs are there. Results do not depend on it.
#pragma once

#include <vector>

#include "cuda/overlap/part_flow.cuh"

namespace pointfair::cuda {

// Consecutive points in upload order, faired and on the card after an event.
struct FairedPart {
  std::size_t end;
  cudaEvent_t done;
};

class Overlapped {
 public:
  // Builds the index of the whole cloud, too.
  Overlapped(Context& context, DeviceIndex& index) : context_(context), index_(context, index), flow_(context) {}

  // Whether a cloud is to be indexed part by part; `arrival` is null once it is on the card.
  static bool suits(const Arrival* arrival, const std::optional<Frame>& frame) {
    return arrival != nullptr && arrival->parts.count() > 1 && !frame;
  }
  void build(const Point* points, std::size_t count, const Arrival& arrival) { index_.build(points, count, arrival); }

  // Whether lists so made can be found part by part now; all else waits for join().
  bool can_search(const NeighborSettings& settings) const;
  void search(NearestQuery query, Index* lists, bool arriving, const std::stop_token& stop) {
    flow_.search(index_, query, lists, arriving, stop);
  }
  // Whether parts that are searched may be faired now.
  bool can_fair() const { return flow_.is_searched() && !flow_.is_done(); }
  // Starts body(leaves) for each part once it is searched; it is to work on the context's stream.
  template <class Body>
  void fair(const Body& body) {
    flow_.after_search(index_, body);
  }
  // Until join().
  std::vector<FairedPart> faired_parts() const;

  // The stream of the stage started last.
  cudaStream_t stream() const;
  // Work that the context's main stream gets from now on waits for all parts.
  void join();

 private:
  Context& context_;
  PartedIndex index_;
  PartFlow flow_;
};

}  // namespace pointfair::cuda
