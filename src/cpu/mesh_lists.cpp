// SPDX-License-Identifier: Apache-2.0
#include "cpu/mesh_lists.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "cpu/parallel.h"

namespace pointfair::cpu {
namespace {

using Key = unsigned long long;  // point::neighbor_key

constexpr std::size_t kLeavesABlock = 32;
// Of one vertex. Neighbourhoods do not lead through vertices of more: the hub of a fan is everybody's neighbour.
constexpr std::size_t kMostEdges = kMaxNeighbors;

// The edges of a mesh between sorted positions, of valid points that are not lost; each point's neighbours ascend.
class SortedEdges {
 public:
  SortedEdges(const IndexView& index, const MeshEdges& mesh, const std::stop_token& stop)
      : begin_(std::size_t(index.points) + 1), vertex_(index.points) {
    std::vector<Index> places(mesh.vertex.size(), point::kNoNeighbor);  // of each uploaded point
    for_all(index, stop, [&](Index at) { places[index.original[at]] = at; });
    for_all(index, stop, [&](Index at) {
      vertex_[at] = places[mesh.vertex[index.original[at]]];
      for (const std::uint32_t there : neighbors_of(index, mesh, at)) begin_[at + 1] += places[there] != kLost;
    });
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    neighbors_.resize(begin_.back());
    for_all(index, stop, [&](Index at) {
      std::uint64_t next = begin_[at];
      for (const std::uint32_t there : neighbors_of(index, mesh, at))
        if (places[there] != kLost) neighbors_[next++] = places[there];
      std::sort(neighbors_.begin() + std::ptrdiff_t(begin_[at]), neighbors_.begin() + std::ptrdiff_t(next));
    });
  }

  // Of the vertex at a sorted position, and of every other point at its place.
  std::span<const Index> of(Index at) const {
    return {neighbors_.data() + begin_[at], neighbors_.data() + begin_[at + 1]};
  }
  // Where the vertex of a point is; kNoNeighbor if it is lost.
  Index vertex_of(Index at) const { return vertex_[at]; }

 private:
  static constexpr Index kLost = point::kNoNeighbor;

  template <class Body>
  static void for_all(const IndexView& index, const std::stop_token& stop, const Body& body) {
    for_blocks(index.points, kLeavesABlock * kLeafSize, stop, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t at = first; at < last; ++at) body(Index(at));
    });
  }
  static std::span<const std::uint32_t> neighbors_of(const IndexView& index, const MeshEdges& mesh, Index at) {
    return mesh.neighbors_of(mesh.vertex[index.original[at]]);
  }

  std::vector<std::uint64_t> begin_;
  std::vector<Index> neighbors_, vertex_;
};

// The vertices around one, found along edges. Memory: 4 bytes a point.
class MeshSearch {
 public:
  MeshSearch(const IndexView& index, const SortedEdges& edges) : index_(index), edges_(edges), seen_(index.points) {}

  // Those up to `rings` edges away that lie within `squared_limit`.
  void find_rings(Index at, int rings, float squared_limit) {
    begin(at);
    std::size_t ring_begin = 0;
    for (int ring = 0; ring < rings; ++ring) {
      const std::size_t ring_end = reached_.size();
      for (std::size_t i = ring_begin; i < ring_end; ++i) step(i, [](float) { return true; });
      ring_begin = ring_end;
    }
    reached_.erase(reached_.begin());
    std::erase_if(reached_, [&](Key key) { return !(point::key_squared_distance(key) <= squared_limit); });
    keep_nearest();
  }
  // Those that paths reach which stay within `squared_limit`, of which points with a hash below `share` are listed.
  // First come those within `squared_near`, which are counted. Their order follows from the index's alone.
  std::size_t find_ball(Index at, float squared_near, float squared_limit, float share) {
    begin(at);
    for (std::size_t i = 0; i < reached_.size(); ++i) step(i, [&](float squared) { return squared <= squared_limit; });
    reached_.erase(reached_.begin());
    if (share < 1) std::erase_if(reached_, [&](Key key) { return !(index_.share[point::key_index(key)] < share); });
    if (reached_.size() > std::size_t(kMaxNeighbors)) keep_nearest();
    const auto is_near = [&](Key key) { return point::key_squared_distance(key) <= squared_near; };
    return std::size_t(std::stable_partition(reached_.begin(), reached_.end(), is_near) - reached_.begin());
  }

  // At most kMaxNeighbors; in rings nearest first.
  std::span<const Key> found() const { return reached_; }

 private:
  void begin(Index at) {
    here_ = position_of(index_, at);
    if (++round_ == 0) {  // the rounds begin again
      std::fill(seen_.begin(), seen_.end(), 0u);
      round_ = 1;
    }
    if (edges_.vertex_of(at) != point::kNoNeighbor) seen_[edges_.vertex_of(at)] = round_;
    reached_.assign(1, point::neighbor_key(0, at));
  }

  template <class MayEnter>
  void step(std::size_t from, const MayEnter& may_enter) {
    const std::span<const Index> around = edges_.of(point::key_index(reached_[from]));
    if (from > 0 && around.size() > kMostEdges) return;
    for (const Index there : around) {
      if (seen_[there] == round_) continue;
      const float squared = point::squared_length(position_of(index_, there) - here_);
      if (!may_enter(squared)) continue;
      seen_[there] = round_;
      reached_.push_back(point::neighbor_key(squared, there));
    }
  }

  void keep_nearest() {
    std::sort(reached_.begin(), reached_.end(), [&](Key a, Key b) {
      return point::precedes(a, b, [&](Index there) { return position_of(index_, there); });
    });
    reached_.resize(std::min(reached_.size(), std::size_t(kMaxNeighbors)));
  }

  const IndexView& index_;
  const SortedEdges& edges_;
  point::Vec3<float> here_{};
  std::vector<std::uint32_t> seen_;  // the round in which a position was reached last
  std::uint32_t round_ = 0;
  std::vector<Key> reached_;
};

// What a point looks for without rings.
struct Ball {
  float squared_near, squared_limit, share;
};
Ball ball_of(const point::Radii& radii, Index at, float growth) {
  const float own = radii.squared_radius[at], widest = own * (growth * growth);
  if (radii.min_neighbors == 0) return {own, widest, 1};
  const float level = radii.squared_level == nullptr ? 1.0f : radii.squared_level[at];
  return {own, widest, point::kept_share(radii, level, own, widest)};
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
  const SortedEdges edges(index, *settings.mesh, stop);
  tbb::enumerable_thread_specific<MeshSearch> searches([&] { return MeshSearch(index, edges); });
  const float limit = settings.radius > 0 ? settings.radius * settings.radius : std::numeric_limits<float>::infinity();
  std::vector<LeafLists> leaves(index.leaves);
  std::vector<std::vector<Index>> blocks((index.leaves + kLeavesABlock - 1) / kLeavesABlock);
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
    MeshSearch& search = searches.local();
    std::array<std::vector<Key>, kLeafSize> found;
    std::vector<std::size_t> begins;
    std::vector<Index>& lists = blocks[block];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      std::size_t longest = 0, nearest = 0;
      for (Index lane = 0; lane < kLeafSize; ++lane) {
        const Index at = Index(leaf) * kLeafSize + lane;
        found[lane].clear();
        if (at >= index.points) continue;
        if (settings.k > 0) {
          search.find_rings(at, settings.rings, limit);
        } else {
          const Ball ball = ball_of(radii, at, settings.mesh_growth);
          nearest = std::max(nearest, search.find_ball(at, ball.squared_near, ball.squared_limit, ball.share));
        }
        found[lane].assign(search.found().begin(), search.found().end());
        longest = std::max(longest, found[lane].size());
      }
      begins.push_back(lists.size());
      leaves[leaf].k = int(longest);
      leaves[leaf].in_radius = int(nearest);
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
