// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "cuda/overlap/part_flow.cuh"
#include "seam/stop.hpp"

namespace pointfair::cuda {
namespace {

constexpr std::size_t kRetriesOfLeaf = kLeafSize + sizeof(HardLeaf) / sizeof(Index);

}  // namespace

PartFlow::PartFlow(Context& context) : context_(context), counts_(context), retries_(context) {}

PartFlow::~PartFlow() {  // the streams wait; then memory may be released
  for (auto* stream : {&searching_, &finishing_, &again_, &after_}) stream->reset();
}

void PartFlow::start(std::optional<SideStream>& stream, Urgency urgency) {
  if (!stream) stream.emplace(context_, urgency);
  stream->fork();
}

void PartFlow::search(const PartedIndex& index, NearestQuery query, Index* lists, bool arriving,
                      const std::stop_token& stop) {
  const Search search{index, query, lists};
  const std::size_t parts = index.parts().count();
  counts_.resize(parts);
  retries_.resize(index.leaves() * kRetriesOfLeaf);
  check(cudaMemsetAsync(counts_.data(), 0, parts * sizeof(CloudState), context_.stream()), "clearing counts");
  is_searched_ = true;
  start(searching_, Urgency::usual);
  start(finishing_, Urgency::high);
  start(again_, Urgency::high);
  // Copied and computed part by part, the n-th search begins when 1.5 n parts and more are there: a card computes
  // longer than the bus copies.
  const auto until = [&](std::size_t part) { return arriving ? std::min(part + part / 2, parts - 1) : parts - 1; };
  const auto is_early = [&](std::size_t part) { return until(part) + 1 < parts; };
  for (std::size_t part = 0; part < parts; ++part) {
    if (stop.stop_possible() && part >= 2) check(cudaEventSynchronize(looked_[part - 2]), "computing");
    throw_if_stopped(stop);
    search_part(search, part, until(part));
  }
  for (std::size_t part = 0; is_early(part); ++part) search_again(search, part, until(part));
  for (std::size_t part = 0; is_early(part); ++part) finishing_->wait_for(searched_[part]);
}

Tree PartFlow::tree_for(const Search& search, std::size_t part, std::size_t until) const {
  Tree tree = search.index.tree_until(until);
  tree.state = counts_.data() + part;
  return tree;
}
Retries PartFlow::retries_of(LeafRange leaves) const {
  Index* const all = retries_.data() + std::size_t(leaves.begin) * kRetriesOfLeaf;
  return {reinterpret_cast<HardLeaf*>(all), all + std::size_t(leaves.count()) * (kRetriesOfLeaf - kLeafSize)};
}

void PartFlow::search_part(const Search& search, std::size_t part, std::size_t until) {
  const Tree tree = tree_for(search, part, until);
  const LeafRange leaves = search.index.leaves_of(part);
  {
    const OnStream stream(context_, *searching_);
    searching_->wait_for(search.index.ready(until));
    find_nearest_of(context_, tree, counts_.data() + part, leaves, search.query, search.lists, retries_of(leaves));
    looked_.record(part, searching_->stream());
  }
  const OnStream stream(context_, *finishing_);
  finishing_->wait_for(looked_[part]);
  find_nearest_of_left(context_, tree, leaves, search.query, search.lists, retries_of(leaves));
  searched_.record(part, finishing_->stream());
}

void PartFlow::search_again(const Search& search, std::size_t part, std::size_t until) {
  const Tree tree = tree_for(search, part, search.index.parts().count() - 1);
  const LeafRange leaves = search.index.leaves_of(part);
  CloudState* const counts = counts_.data() + part;
  const OnStream stream(context_, *again_);
  again_->wait_for(searched_[part]);
  again_->wait_for(search.index.ready_after());
  check(cudaMemsetAsync(counts, 0, sizeof(CloudState), again_->stream()), "clearing counts");
  find_nearest_again(context_, tree, search.index.tree_after(until), counts, leaves, search.query, search.lists,
                     retries_of(leaves));
  find_nearest_of_left(context_, tree, leaves, search.query, search.lists, retries_of(leaves));
  searched_.record(part, again_->stream());
}

void PartFlow::join() {
  if (!is_searched_) return;
  for (const auto* stream : {&searching_, &finishing_, &again_, &after_})
    if (*stream) (*stream)->join();
  retries_.release();
  is_searched_ = is_done_ = false;
}

}  // namespace pointfair::cuda
