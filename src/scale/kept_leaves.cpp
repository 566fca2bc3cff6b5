// SPDX-License-Identifier: Apache-2.0
#include "scale/kept_leaves.hpp"

#include <algorithm>

namespace pointfair::scale {

void KeptLeaves::forget() {
  leaves_.assign(leaves_.size(), {});
  blocks_.clear();
  most_ = kept_ = 0;
}

// The first that are read stay: leaves are looked at in the same order each time, so that of more than there is room
// for the one that was not needed for longest would always be needed next.
std::span<const Point> KeptLeaves::leaf(std::uint32_t number) {
  if (!leaves_[number].empty()) return leaves_[number];
  cloud_.read_stored({number, number + 1}, &passing_, nullptr);
  if (kept_ + passing_.size() > most_) return passing_;
  constexpr std::size_t kBlock = 1 << 18;
  if (blocks_.empty() || blocks_.back().capacity() - blocks_.back().size() < passing_.size())
    blocks_.emplace_back().reserve(std::max(kBlock, passing_.size()));
  std::vector<Point>& block = blocks_.back();
  const std::size_t at = block.size();
  block.insert(block.end(), passing_.begin(), passing_.end());
  kept_ += passing_.size();
  return leaves_[number] = std::span(block).subspan(at);
}

bool KeptLeaves::load(const StoredCloud& seen, const point::Region& region, std::uint64_t most,
                      std::vector<Point>& points) {
  points.clear();
  for (std::uint32_t number = 0; number < leaves_.size(); ++number) {
    const Bounds& bounds = seen.leaves()[number];
    if (!may_overlap(region, bounds)) continue;
    const std::span<const Point> all = leaf(number);
    const std::size_t before = points.size();
    points.insert(points.end(), all.begin(), all.end());
    const std::span<Point> its = std::span(points).subspan(before);
    seen.bring(number, its);
    if (!lies_inside(region, bounds)) {
      const auto outside = [&](const Point& p) { return !point::is_inside(region, to_vec3(p)); };
      points.erase(std::remove_if(points.begin() + std::ptrdiff_t(before), points.end(), outside), points.end());
    }
    if (points.size() <= most) continue;
    forget();
    return false;
  }
  return true;
}

// All of a cloud that can be kept is. Of a larger one the files are read from their beginning to their end, which
// leaves in random order are not.
void KeptLeaves::for_all(const std::function<void(std::span<const Point>)>& visit) {
  if (cloud_.bounds().valid > most_) return cloud_.for_all(visit);
  for (std::uint32_t number = 0; number < leaves_.size(); ++number)
    if (cloud_.leaves()[number].valid > 0) {
      std::span<const Point> its = leaf(number);
      if (cloud_.zones().are_several()) {
        brought_.assign(its.begin(), its.end());
        cloud_.bring(number, brought_);
        its = brought_;
      }
      visit(its);
    }
}

}  // namespace pointfair::scale
