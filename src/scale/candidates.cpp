// SPDX-License-Identifier: Apache-2.0
#include "scale/candidates.hpp"

#include <algorithm>
#include <iterator>

namespace pointfair::scale {

std::vector<SampleCandidate> CandidatesAhead::collect(Candidates wanted) {
  const auto holds = [&](const Held& held) {
    return held.asked.refinement == wanted.refinement && held.asked.limit >= wanted.limit;
  };
  auto held = std::ranges::find_if(held_, holds);
  if (held == held_.end()) {
    const Candidates more = with_more(wanted);
    held_ = {{more, {}}, {refined(more), {}}};
    for_all_([&](std::span<const Point> points) {
      for (Held& its : held_) add(points, its);
    });
    held = held_.begin();
  }
  std::vector<SampleCandidate> found;
  std::ranges::copy_if(held->found, std::back_inserter(found),
                       [&](const SampleCandidate& candidate) { return candidate.hash <= wanted.limit; });
  return found;
}

void CandidatesAhead::add(std::span<const Point> points, Held& held) const {
  constexpr std::size_t kBlock = 1 << 14, kMostUnordered = 1 << 18;
  const double cells = point::cells_per_unit(to_vec3(bounds_.min), to_vec3(bounds_.max), held.asked.refinement);
  std::vector<std::vector<SampleCandidate>> found((points.size() + kBlock - 1) / kBlock);
  for_each_(found.size(), [&](std::size_t block) {
    const std::size_t begin = block * kBlock;
    for (const Point& p : points.subspan(begin, std::min(kBlock, points.size() - begin))) {
      const std::uint32_t hash = point::cell_hash(to_vec3(p), to_vec3(bounds_.min), cells);
      if (hash <= held.asked.limit) found[block].push_back({hash, 0, p});
    }
    order_candidates(found[block]);  // of many points in one cell, one
  });
  for (const auto& some : found) held.found.insert(held.found.end(), some.begin(), some.end());
  if (held.found.size() > kMostUnordered) order_candidates(held.found);
}

}  // namespace pointfair::scale
