// SPDX-License-Identifier: Apache-2.0
#include "cuda/index/boxes.cuh"
#include "cuda/index/sort_keys.cuh"
#include "cuda/overlap/parted_index.cuh"

namespace pointfair::cuda {

// Room to sort the largest part; each has a grid of its own for its keys, so that 10 bits an axis suffice.
class PartSort {
 public:
  using Keys = KeySort<CoarseKey, 10>;
  static constexpr float kSteps = 1 << 10;

  PartSort(Context& context, const Point* points, const Parts& parts, CloudState* state)
      : keys(context, points, parts.size(0), state), grids(context) {
    keys.reserve(parts.size(0));
    grids.resize(parts.count());
  }

  Keys keys;
  DeviceArray<KeyGrid> grids;
};

PartedIndex::PartedIndex(Context& context, DeviceIndex& index) : context_(context), index_(index) {}
PartedIndex::~PartedIndex() { side_.reset(); }  // waits; then memory may be released

LeafRange PartedIndex::leaves_of(std::size_t part) const {
  return {static_cast<Index>(parts_.begin(part) / kLeafSize),
          static_cast<Index>((parts_.ends[part] + kLeafSize - 1) / kLeafSize)};
}
Tree PartedIndex::tree_until(std::size_t part) const {
  Tree tree = index_.tree_with_top(part);
  tree.leaves_there = leaves_of(part).end;
  return tree;
}
Tree PartedIndex::tree_after(std::size_t part) const { return index_.tree_with_top(parts_.count() + part); }

void PartedIndex::join() {
  if (!is_building()) return;
  side_->join();
  sort_.reset();
}

void PartedIndex::build(const Point* points, std::size_t count, const Arrival& arrival) {
  index_.make_room(count);
  parts_ = arrival.parts;
  const std::size_t each = parts_.size(0);
  int own_levels = 1;
  for (std::size_t whole = kGroupPoints * kLeafSize; each % whole == 0; whole *= kLeafSize) ++own_levels;
  index_.lay_out_levels(own_levels, 2 * parts_.count() - 1, parts_.count() - 1);
  const Levels& levels = index_.levels();
  sort_ = std::make_unique<PartSort>(context_, points, parts_, index_.state());
  if (!side_) side_.emplace(context_, Urgency::high);
  side_->fork();
  const OnStream side(context_, *side_);
  for (std::size_t part = 0; part < parts_.count(); ++part) {
    side_->wait_for(arrival.there[part]);
    build_part(points, part);
    ready_.record(part, side_->stream());
  }
  const Index subtrees_each = leaves_of(0).count() >> (5 * levels.own);
  build_tops_after(context_, tree_after(0), levels.own - 1, levels.groups[levels.own - 1], subtrees_each,
                   levels.groups_of_top, parts_.count() - 1);
  ready_.record(parts_.count(), side_->stream());
}

void PartedIndex::build_part(const Point* points, std::size_t part) {
  const std::size_t begin = parts_.begin(part), end = parts_.ends[part];
  const Levels& levels = index_.levels();
  KeyGrid* const grid = sort_->grids.data() + part;
  lay_grid(context_, points + begin, end - begin, PartSort::kSteps, grid, part == 0 ? index_.state() : nullptr);
  sort_->keys.find_keys(begin, end, grid);
  const bool refines = end - begin < kFewPoints;
  sort_->keys.sort(end - begin, refines ? kRefinedBits : 0);
  const Index first = static_cast<Index>(begin / kGroupPoints), last = blocks_for(end, kGroupPoints);
  gather_points(context_, points, begin, end, sort_->keys.order(), refines ? sort_->keys.keys() : nullptr,
                index_.without_top(), index_.sorted_points());
  if (levels.own > 1) build_upper_levels(context_, index_.without_top(), first, last);
  Index until = blocks_for(leaves_of(part).end, kLeafSize);
  for (int level = 1; level < levels.own; ++level) until = blocks_for(until, kLeafSize);
  build_top(context_, index_.tree_with_top(part), levels.own - 1, levels.groups[levels.own - 1], until);
}

}  // namespace pointfair::cuda
