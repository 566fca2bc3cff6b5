// SPDX-License-Identifier: Apache-2.0
#include "cpu/mesh_lists.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <numeric>

#include "cpu/parallel.h"
#include "platform/large_vector.hpp"
#include "point/mesh_ball.h"

namespace pointfair::cpu {
namespace {

using Key = unsigned long long;  // point::neighbor_key

constexpr std::size_t kLeavesABlock = 32;

// The edges of a mesh between sorted positions, of valid points that are not lost.
class SortedEdges {
 public:
  SortedEdges(const IndexView& index, const MeshEdges& mesh, const std::stop_token& stop)
      : begin_(std::size_t(index.points) + 1), vertex_(index.points) {
    platform::LargeVector<Index> places(mesh.vertices(), kLost);
    for_all(index, stop, [&](Index at) {
      const std::uint32_t point = index.original[at];
      if (mesh.first[mesh.vertex[point]] == point) places[mesh.vertex[point]] = at;
    });
    const bool all_are_there = std::ranges::find(places, kLost) == places.end();
    for_all(index, stop, [&](Index at) {
      vertex_[at] = places[mesh.vertex[index.original[at]]];
      const std::span<const std::uint32_t> around = neighbors_of(index, mesh, at);
      const auto is_there = [&](std::uint32_t there) { return places[there] != kLost; };
      begin_[at + 1] = std::uint64_t(all_are_there ? around.size() : std::ranges::count_if(around, is_there));
    });
    begin_[0] = 0;
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    neighbors_.resize(begin_.back());
    for_all(index, stop, [&](Index at) {
      std::uint64_t next = begin_[at];
      for (const std::uint32_t there : neighbors_of(index, mesh, at))
        if (places[there] != kLost) neighbors_[next++] = places[there];
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
    for_items(index.points, kLeavesABlock * kLeafSize, stop, [&](std::size_t at) { body(Index(at)); });
  }
  static std::span<const std::uint32_t> neighbors_of(const IndexView& index, const MeshEdges& mesh, Index at) {
    return mesh.neighbors_of(mesh.vertex[index.original[at]]);
  }

  platform::LargeVector<std::uint64_t> begin_;
  platform::LargeVector<Index> neighbors_, vertex_;
};

// Points that are neighbours of none but lanes of one leaf, at most kMaxNeighbors of each.
void keep_nearest(const IndexView& index, std::vector<Key>& keys) {
  std::ranges::sort(keys, [&](Key a, Key b) {
    return point::precedes(a, b, [&](Index there) { return position_of(index, there); });
  });
  keys.resize(std::min(keys.size(), std::size_t(kMaxNeighbors)));
}

// The vertices around one, found along edges. Memory: 4 bytes a point.
class RingSearch {
 public:
  RingSearch(const IndexView& index, const SortedEdges& edges, int rings)
      : index_(index), edges_(edges), seen_(rings == 1 ? 0 : index.points, 0) {}

  // Those up to `rings` edges away that lie within `squared_limit`, or with 0 rings those that paths reach which stay
  // within it: at most kMaxNeighbors, nearest first.
  const std::vector<Key>& find(Index at, int rings, float squared_limit) {
    if (rings == 1) return find_ring(at, squared_limit);
    begin(at);
    std::size_t ring_begin = 0;
    for (int ring = 0; ring < rings; ++ring) {
      const std::size_t ring_end = reached_.size();
      for (std::size_t i = ring_begin; i < ring_end; ++i) step(i, std::numeric_limits<float>::infinity());
      ring_begin = ring_end;
    }
    for (std::size_t i = 0; rings == 0 && i < reached_.size(); ++i) step(i, squared_limit);
    reached_.erase(reached_.begin());
    std::erase_if(reached_, [&](Key key) { return !(point::key_squared_distance(key) <= squared_limit); });
    keep_nearest(index_, reached_);
    return reached_;
  }

 private:
  // No vertex is met twice.
  const std::vector<Key>& find_ring(Index at, float squared_limit) {
    here_ = position_of(index_, at);
    reached_.clear();
    for (const Index there : edges_.of(at)) {
      const float squared = point::squared_length(position_of(index_, there) - here_);
      if (squared <= squared_limit) reached_.push_back(point::neighbor_key(squared, there));
    }
    keep_nearest(index_, reached_);
    return reached_;
  }

  void begin(Index at) {
    here_ = position_of(index_, at);
    if (++round_ == 0) {  // the rounds begin again
      std::ranges::fill(seen_, 0u);
      round_ = 1;
    }
    if (edges_.vertex_of(at) != point::kNoNeighbor) seen_[edges_.vertex_of(at)] = round_;
    reached_.assign(1, point::neighbor_key(0, at));
  }

  void step(std::size_t from, float squared_limit) {
    const std::span<const Index> around = edges_.of(point::key_index(reached_[from]));
    if (from > 0 && around.size() > point::kMostMeshEdges) return;
    for (const Index there : around) {
      if (seen_[there] == round_) continue;
      const float squared = point::squared_length(position_of(index_, there) - here_);
      if (!(squared <= squared_limit)) continue;
      seen_[there] = round_;
      reached_.push_back(point::neighbor_key(squared, there));
    }
  }

  const IndexView& index_;
  const SortedEdges& edges_;
  point::Vec3<float> here_{};
  platform::LargeVector<std::uint32_t> seen_;  // the round in which a position was reached last
  std::uint32_t round_ = 0;
  std::vector<Key> reached_;
};

// The balls of the points of a leaf at once, since they hold mostly the same vertices: from each vertex, the lanes that
// reached it go on to those of its neighbours that lie within their limits. Which lanes reach a vertex does not depend
// on the order of the visits, and that order follows from the index's alone. Memory: 8 bytes a point.
class BallSearch {
 public:
  BallSearch(const IndexView& index, const SortedEdges& edges)
      : index_(index), edges_(edges), marks_(index.points, Mark{}) {}

  struct Reached {
    Index at;
    std::uint16_t lanes = 0;      // that reached it
    std::uint16_t within = 0;     // whose limit holds it
    std::uint16_t in_radius = 0;  // whose radius holds it, before it grows
    std::uint16_t unchanged = 0;  // those of `lanes` that have gone on from here
    std::uint16_t own = 0;        // whose vertex it is
  };

  // What the leaf's points reach, in sorted order.
  const std::vector<Reached>& find(Index leaf, const point::Radii& radii, float growth) {
    begin(leaf, radii, growth);
    for (Index lane = 0; lane < kLeafSize; ++lane)
      if (const Index at = leaf * kLeafSize + lane; at < index_.points)
        for (const Index there : edges_.of(at)) enter(there, std::uint16_t(1u << lane));
    for (std::size_t next = 0; next < waiting_.size(); ++next) go_on(waiting_[next]);
    for (Reached& its : reached_) its.lanes &= std::uint16_t(~its.own);
    thin();
    if (reached_.size() > std::size_t(kMaxNeighbors)) keep_nearest_of_lanes();
    std::erase_if(reached_, [](const Reached& its) { return its.lanes == 0; });
    std::ranges::sort(reached_, {}, &Reached::at);
    return reached_;
  }

 private:
  static constexpr unsigned kBit[kLeafSize] = {1,      1 << 1, 1 << 2,  1 << 3,  1 << 4,  1 << 5,  1 << 6,  1 << 7,
                                               1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 12, 1 << 13, 1 << 14, 1 << 15};
  struct Mark {
    std::uint32_t round = 0, place = 0;  // in `reached_`
  };

  void begin(Index leaf, const point::Radii& radii, float growth) {
    if (++round_ == 0) {  // the rounds begin again
      std::ranges::fill(marks_, Mark{});
      round_ = 1;
    }
    reached_.clear();
    waiting_.clear();
    share_.fill(1);
    squared_near_.fill(-1);
    squared_limit_.fill(-1);
    for (Index lane = 0; lane < kLeafSize; ++lane) {
      const Index at = leaf * kLeafSize + lane;
      x_[lane] = index_.x[at], y_[lane] = index_.y[at], z_[lane] = index_.z[at];  // NaN beyond the last point
      if (at >= index_.points) continue;
      const point::MeshBall ball = point::mesh_ball_of(radii, at, growth);
      squared_near_[lane] = ball.squared_near, squared_limit_[lane] = ball.squared_limit, share_[lane] = ball.share;
    }
    for (Index lane = 0; lane < kLeafSize; ++lane) {
      const Index at = leaf * kLeafSize + lane;
      if (at >= index_.points || edges_.vertex_of(at) == point::kNoNeighbor) continue;
      Reached& its = reached_[place_of(edges_.vertex_of(at))];
      its.own = std::uint16_t(its.own | 1u << lane);
      its.lanes = its.unchanged = its.own;  // not to be reached again
    }
  }

  std::uint32_t place_of(Index at) {
    Mark& mark = marks_[at];
    if (mark.round == round_) return mark.place;
    mark = {round_, std::uint32_t(reached_.size())};
    Reached its{at};
    const float x = index_.x[at], y = index_.y[at], z = index_.z[at];
    unsigned within = 0, in_radius = 0;
    for (int lane = 0; lane < kLeafSize; ++lane) {  // without a branch, so that compilers make vectors of it
      const float squared = point::squared_length(point::Vec3<float>{x - x_[lane], y - y_[lane], z - z_[lane]});
      within |= squared <= squared_limit_[lane] ? kBit[lane] : 0;
      in_radius |= squared <= squared_near_[lane] ? kBit[lane] : 0;
    }
    its.within = std::uint16_t(within);
    its.in_radius = std::uint16_t(in_radius);
    reached_.push_back(its);
    return mark.place;
  }

  void enter(Index there, std::uint16_t lanes) {
    const std::uint32_t place = place_of(there);
    Reached& its = reached_[place];
    const unsigned fresh = lanes & its.within & ~unsigned(its.lanes);
    if (fresh == 0) return;
    if (its.lanes == its.unchanged) waiting_.push_back(place);
    its.lanes = std::uint16_t(its.lanes | fresh);
  }

  void go_on(std::uint32_t place) {
    const Index at = reached_[place].at;
    const std::uint16_t lanes = std::uint16_t(reached_[place].lanes & ~reached_[place].unchanged);
    reached_[place].unchanged = reached_[place].lanes;
    const std::span<const Index> around = edges_.of(at);
    if (around.size() > point::kMostMeshEdges) return;
    for (const Index there : around) enter(there, lanes);
  }

  void thin() {
    for (Index lane = 0; lane < kLeafSize; ++lane) {
      const float share = share_[lane];
      if (!(share < 1)) continue;
      for (Reached& its : reached_)
        if (!(index_.share[its.at] < share)) its.lanes &= std::uint16_t(~(1u << lane));
    }
  }

  void keep_nearest_of_lanes() {
    for (Index lane = 0; lane < kLeafSize; ++lane) {
      std::vector<Key> keys;
      for (const Reached& its : reached_) {
        if ((its.lanes >> lane & 1) == 0) continue;
        const point::Vec3<float> offset{index_.x[its.at] - x_[lane], index_.y[its.at] - y_[lane],
                                        index_.z[its.at] - z_[lane]};
        keys.push_back(point::neighbor_key(point::squared_length(offset), its.at));
      }
      if (keys.size() <= std::size_t(kMaxNeighbors)) continue;
      keep_nearest(index_, keys);
      for (Reached& its : reached_) its.lanes &= std::uint16_t(~(1u << lane));
      for (const Key key : keys) {
        Reached& its = reached_[marks_[point::key_index(key)].place];
        its.lanes = std::uint16_t(its.lanes | 1u << lane);
      }
    }
  }

  const IndexView& index_;
  const SortedEdges& edges_;
  std::array<float, kLeafSize> x_{}, y_{}, z_{};
  std::array<float, kLeafSize> squared_near_{}, squared_limit_{}, share_{};
  platform::LargeVector<Mark> marks_;
  std::uint32_t round_ = 0;
  std::vector<Reached> reached_;
  std::vector<std::uint32_t> waiting_;
};

std::vector<LeafLists> find_rings(const IndexView& index, const NeighborSettings& settings, const SortedEdges& edges,
                                  std::vector<MeshBlock>& blocks, const std::stop_token& stop) {
  tbb::enumerable_thread_specific<RingSearch> searches([&] { return RingSearch(index, edges, settings.rings); });
  tbb::enumerable_thread_specific<std::vector<Index>> rooms;
  const float limit = settings.radius > 0 ? settings.radius * settings.radius : std::numeric_limits<float>::infinity();
  std::vector<LeafLists> leaves(index.leaves);
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
    RingSearch& search = searches.local();
    std::vector<Index>& lists = rooms.local();
    lists.clear();
    std::vector<std::size_t> begins;
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      begins.push_back(lists.size());
      for (Index lane = 0; lane < kLeafSize; ++lane) {
        const Index at = Index(leaf) * kLeafSize + lane;
        if (at >= index.points) break;
        const std::vector<Key>& found = search.find(at, settings.rings, limit);
        const std::size_t room = begins.back() + found.size() * kLeafSize;
        if (lists.size() < room) lists.resize(room, point::kNoNeighbor);
        Index* const list = lists.data() + begins.back() + lane;
        for (std::size_t slot = 0; slot < found.size(); ++slot) list[slot * kLeafSize] = point::key_index(found[slot]);
      }
      leaves[leaf].k = int((lists.size() - begins.back()) / kLeafSize);
    }
    const std::vector<Index>& kept = blocks[block].at = lists;
    for (std::size_t leaf = first; leaf < last; ++leaf) leaves[leaf].list = kept.data() + begins[leaf - first];
  });
  return leaves;
}

std::vector<LeafBalls> find_balls(const IndexView& index, const NeighborSettings& settings, const SortedEdges& edges,
                                  const point::Radii& radii, std::vector<MeshBlock>& blocks,
                                  const std::stop_token& stop) {
  tbb::enumerable_thread_specific<BallSearch> searches([&] { return BallSearch(index, edges); });
  tbb::enumerable_thread_specific<MeshBlock> rooms;
  std::vector<LeafBalls> leaves(index.leaves);
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
    BallSearch& search = searches.local();
    MeshBlock& room = rooms.local();
    room.at.clear(), room.lanes.clear(), room.in_radius.clear();
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      const std::vector<BallSearch::Reached>& found = search.find(Index(leaf), radii, settings.mesh_growth);
      leaves[leaf].count = int(found.size());
      for (const BallSearch::Reached& its : found) {
        room.at.push_back(its.at);
        room.lanes.push_back(its.lanes);
        room.in_radius.push_back(its.lanes & its.in_radius);
      }
    }
    const auto& [at, lanes, in_radius] = blocks[block] = room;
    std::size_t begin = 0;
    for (std::size_t leaf = first; leaf < last; begin += std::size_t(leaves[leaf++].count)) {
      leaves[leaf].at = at.data() + begin;
      leaves[leaf].lanes = lanes.data() + begin;
      leaves[leaf].in_radius = in_radius.data() + begin;
    }
  });
  return leaves;
}

}  // namespace

void MeshLists::clear() noexcept {
  blocks_.clear();
  rings_.clear();
  balls_.clear();
  meter_->remove(std::exchange(bytes_, 0));
}

void MeshLists::find(const IndexView& index, const NeighborSettings& settings, const point::Radii& radii,
                     const std::stop_token& stop) {
  clear();
  const SortedEdges edges(index, *settings.mesh, stop);
  blocks_.resize((index.leaves + kLeavesABlock - 1) / kLeavesABlock);
  if (settings.k > 0) {
    rings_ = find_rings(index, settings, edges, blocks_, stop);
  } else {
    balls_ = find_balls(index, settings, edges, radii, blocks_, stop);
  }
  for (const MeshBlock& its : blocks_)
    bytes_ += its.at.size() * sizeof(Index) + its.lanes.size() * 2 * sizeof(std::uint16_t);
  meter_->add(bytes_);
}

}  // namespace pointfair::cpu
