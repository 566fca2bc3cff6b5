// SPDX-License-Identifier: Apache-2.0
// The stages of a cloud whose index is in parts: each stage has a stream of its own and takes one part after the other,
// as soon as the stage before has done it. So parts are copied, searched and faired at one time.
#pragma once

#include <optional>
#include <stop_token>

#include "cuda/overlap/parted_index.cuh"
#include "cuda/search/search.cuh"

namespace pointfair::cuda {

class PartFlow {
 public:
  explicit PartFlow(Context& context);
  ~PartFlow();
  PartFlow(const PartFlow&) = delete;
  PartFlow& operator=(const PartFlow&) = delete;

  // Lists of k <= kLargestGroupList. While the cloud is `arriving`, the first parts are searched among those that are
  // there, and again where later ones may change something; otherwise each once. No result depends on it. Waits for
  // parts before the last two if `stop` is possible.
  void search(const PartedIndex& index, NearestQuery query, Index* lists, bool arriving, const std::stop_token& stop);
  // Starts body(leaves), which is to work on the context's stream, for each part once it is searched.
  template <class Body>
  void after_search(const PartedIndex& index, const Body& body) {
    start(after_, Urgency::high);
    const OnStream stream(context_, *after_);
    for (std::size_t part = 0; part < index.parts().count(); ++part) {
      after_->wait_for(searched_[part]);
      body(index.leaves_of(part));
      done_.record(part, after_->stream());
    }
    is_done_ = true;
  }

  bool is_searched() const { return is_searched_; }  // so far as started
  bool is_done() const { return is_done_; }          // and what comes after
  cudaEvent_t done(std::size_t part) const { return done_[part]; }
  // That waits for all that was started.
  cudaStream_t stream() const { return (is_done_ ? after_ : finishing_)->stream(); }
  // The context's main stream waits for all.
  void join();

 private:
  struct Search {
    const PartedIndex& index;
    NearestQuery query;
    Index* lists;
  };
  void start(std::optional<SideStream>& stream, Urgency urgency);
  void search_part(const Search& search, std::size_t part, std::size_t until);
  void search_again(const Search& search, std::size_t part, std::size_t until);
  Tree tree_for(const Search& search, std::size_t part, std::size_t until) const;
  Retries retries_of(LeafRange leaves) const;

  Context& context_;
  // The fast searches; the exact ones that end them, with few warps at work, beside the next fast one; searches again.
  std::optional<SideStream> searching_, finishing_, again_;
  std::optional<SideStream> after_;
  Events looked_, searched_, done_;
  DeviceArray<CloudState> counts_;  // of what is left to the exact searches, a part each
  DeviceArray<Index> retries_;
  bool is_searched_ = false, is_done_ = false;
};

}  // namespace pointfair::cuda
