// SPDX-License-Identifier: Apache-2.0
#include "cpu/mesh_lists.h"

#include <algorithm>
#include <array>
#include <limits>

#include "cpu/parallel.h"

namespace pointfair::cpu {
namespace {

using Key = unsigned long long;  // point::neighbor_key

constexpr std::size_t kLeavesABlock = 32;
// Of one vertex. Neighbourhoods do not lead through vertices of more: the hub of a fan is everybody's neighbour.
constexpr std::size_t kMostEdges = kMaxNeighbors;

// A set of numbers that is emptied in no time.
class NumberSet {
 public:
  void clear() {
    ++round_;
    count_ = 0;
    if (round_ == 0) grow_to(slots_.size());  // the rounds begin again
  }
  // False if it was there.
  bool insert(std::uint32_t number) {
    if (2 * (count_ + 1) > slots_.size()) grow_to(2 * slots_.size());
    const std::uint64_t entry = std::uint64_t(round_) << 32 | number;
    std::uint64_t& slot = slot_of(entry);
    if (slot == entry) return false;
    slot = entry;
    ++count_;
    return true;
  }

 private:
  std::uint64_t& slot_of(std::uint64_t entry) {
    const std::size_t mask = slots_.size() - 1;
    std::size_t at = std::uint32_t(entry) * 0x9E3779B9u & mask;
    while (slots_[at] >> 32 == round_ && slots_[at] != entry) at = (at + 1) & mask;
    return slots_[at];
  }
  void grow_to(std::size_t size) {
    const std::vector<std::uint64_t> before = std::exchange(slots_, std::vector<std::uint64_t>(size));
    const std::uint32_t round = std::exchange(round_, 1);
    if (round == 0) return;
    for (const std::uint64_t entry : before)
      if (entry >> 32 == round)
        slot_of(std::uint64_t(round_) << 32 | std::uint32_t(entry)) =
            std::uint64_t(round_) << 32 | std::uint32_t(entry);
  }

  std::vector<std::uint64_t> slots_ = std::vector<std::uint64_t>(1024);
  std::uint32_t round_ = 1;
  std::size_t count_ = 0;
};

// The vertices around one, found along edges.
class MeshSearch {
 public:
  MeshSearch(const IndexView& index, const MeshEdges& mesh, std::span<const Index> places)
      : index_(index), mesh_(mesh), places_(places) {}

  // Those up to `rings` edges away that lie within `squared_limit`.
  void find_rings(Index at, int rings, float squared_limit) {
    begin(at);
    std::size_t ring_begin = 0;
    for (int ring = 0; ring < rings; ++ring) {
      const std::size_t ring_end = reached_.size();
      for (std::size_t i = ring_begin; i < ring_end; ++i) step(i, [](float) { return true; });
      ring_begin = ring_end;
    }
    keep([&](float squared, Index) { return squared <= squared_limit; });
  }
  // Those that paths reach which stay within `squared_limit`, of which points with a hash below `share` are listed.
  void find_ball(Index at, float squared_limit, float share) {
    begin(at);
    for (std::size_t i = 0; i < reached_.size(); ++i) step(i, [&](float squared) { return squared <= squared_limit; });
    keep([&](float, Index there) { return !(share < 1) || index_.share[there] < share; });
  }

  // Nearest first, at most kMaxNeighbors.
  std::span<const Key> found() const { return found_; }

 private:
  void begin(Index at) {
    const std::uint32_t vertex = mesh_.vertex[index_.original[at]];
    here_ = position_of(index_, at);
    seen_.clear();
    seen_.insert(vertex);
    reached_.assign(1, {vertex, point::neighbor_key(0, at)});
  }

  template <class MayEnter>
  void step(std::size_t from, const MayEnter& may_enter) {
    const std::span<const std::uint32_t> around = mesh_.neighbors_of(reached_[from].vertex);
    if (from > 0 && around.size() > kMostEdges) return;
    for (const std::uint32_t vertex : around) {
      const Index there = places_[vertex];
      if (there == point::kNoNeighbor) continue;  // not valid, or lost as an outlier
      const float squared = point::squared_length(position_of(index_, there) - here_);
      if (may_enter(squared) && seen_.insert(vertex)) reached_.push_back({vertex, point::neighbor_key(squared, there)});
    }
  }

  template <class IsKept>
  void keep(const IsKept& is_kept) {
    found_.clear();
    for (std::size_t i = 1; i < reached_.size(); ++i)
      if (is_kept(point::key_squared_distance(reached_[i].key), point::key_index(reached_[i].key)))
        found_.push_back(reached_[i].key);
    const auto precedes = [&](Key a, Key b) {
      return point::precedes(a, b, [&](Index there) { return position_of(index_, there); });
    };
    const std::size_t count = std::min(found_.size(), std::size_t(kMaxNeighbors));
    std::partial_sort(found_.begin(), found_.begin() + std::ptrdiff_t(count), found_.end(), precedes);
    found_.resize(count);
  }

  struct Reached {
    std::uint32_t vertex;
    Key key;
  };

  const IndexView& index_;
  const MeshEdges& mesh_;
  std::span<const Index> places_;
  point::Vec3<float> here_{};
  NumberSet seen_;
  std::vector<Reached> reached_;
  std::vector<Key> found_;
};

// Where each uploaded point lies in the index.
std::vector<Index> places_of(const IndexView& index, std::size_t uploaded) {
  std::vector<Index> places(uploaded, point::kNoNeighbor);
  for (Index i = 0; i < index.points; ++i) places[index.original[i]] = i;
  return places;
}

// What a point looks for without rings.
struct Ball {
  float squared_limit, share;
};
Ball ball_of(const point::Radii& radii, Index at, float growth) {
  const float own = radii.squared_radius[at], widest = own * (growth * growth);
  if (radii.min_neighbors == 0) return {widest, 1};
  const float level = radii.squared_level == nullptr ? 1.0f : radii.squared_level[at];
  return {widest, point::kept_share(radii, level, own, widest)};
}

}  // namespace

void MeshLists::clear() noexcept {
  blocks_.clear();
  leaves_.clear();
  meter_->remove(std::exchange(bytes_, 0));
}

void MeshLists::find(const IndexView& index, const NeighborSettings& settings, const point::Radii& radii,
                     const std::stop_token& stop) {
  clear();
  const std::vector<Index> places = places_of(index, settings.mesh->vertex.size());
  const float limit = settings.radius > 0 ? settings.radius * settings.radius : std::numeric_limits<float>::infinity();
  std::vector<LeafLists> leaves(index.leaves);
  std::vector<std::vector<Index>> blocks((index.leaves + kLeavesABlock - 1) / kLeavesABlock);
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
    MeshSearch search(index, *settings.mesh, places);
    std::array<std::vector<Key>, kLeafSize> found;
    std::vector<std::size_t> begins;
    std::vector<Index>& lists = blocks[block];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      std::size_t longest = 0;
      for (Index lane = 0; lane < kLeafSize; ++lane) {
        const Index at = Index(leaf) * kLeafSize + lane;
        found[lane].clear();
        if (at >= index.points) continue;
        if (settings.k > 0) {
          search.find_rings(at, settings.rings, limit);
        } else {
          const Ball ball = ball_of(radii, at, settings.mesh_growth);
          search.find_ball(at, ball.squared_limit, ball.share);
        }
        found[lane].assign(search.found().begin(), search.found().end());
        longest = std::max(longest, found[lane].size());
      }
      begins.push_back(lists.size());
      leaves[leaf].k = int(longest);
      lists.resize(lists.size() + longest * kLeafSize, point::kNoNeighbor);
      Index* const rows = lists.data() + begins.back();
      for (Index lane = 0; lane < kLeafSize; ++lane)
        for (std::size_t slot = 0; slot < found[lane].size(); ++slot)
          rows[slot * kLeafSize + lane] = point::key_index(found[lane][slot]);
    }
    lists.shrink_to_fit();
    for (std::size_t leaf = first; leaf < last; ++leaf) leaves[leaf].list = lists.data() + begins[leaf - first];
  });
  blocks_ = std::move(blocks);
  leaves_ = std::move(leaves);
  for (const std::vector<Index>& lists : blocks_) bytes_ += lists.size() * sizeof(Index);
  meter_->add(bytes_);
}

}  // namespace pointfair::cpu
