// SPDX-License-Identifier: Apache-2.0
// The points of one iteration's input, in the files that the tasks before left: which leaves there are, and all points
// of a region. In a cloud of several zones, a leaf of the tree counts as one for each zone that has some of its points.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "point/region.h"
#include "scale/points_file.hpp"
#include "scale/zones.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair::scale {

/// Leaves that follow each other.
struct LeafRange {
  std::uint32_t begin = 0, end = 0;
  bool holds(std::uint32_t leaf) const { return leaf >= begin && leaf < end; }
};

/// Points that a zone needs to be computed around its own middle.
inline constexpr std::uint64_t kFewestOfZone = 64;

class StoredCloud {
 public:
  /// `leaves`: of the tree. Points are told as offsets from the origin of the zones.
  StoredCloud(const std::vector<std::filesystem::path>& files, std::size_t leaves, const Zones& zones = {});
  /// The same points as offsets from another origin. O(leaves).
  StoredCloud seen_from(const Position& origin) const;

  const Zones& zones() const { return zones_; }
  const Bounds& bounds() const { return bounds_; }
  const std::vector<Bounds>& leaves() const { return leaf_bounds_; }
  const Zone& zone_of(std::uint32_t leaf) const { return stored_->leaves[leaf].zone; }
  /// What the points of a leaf are computed relative to: the middle of their zone. A zone with fewer than kFewestOfZone
  /// points is computed with the fullest of those beside it, and if all of them have as few, its points are strays,
  /// which are computed around the cloud's origin.
  const Position& origin_for(std::uint32_t leaf) const { return stored_->leaves[leaf].origin; }
  std::uint32_t tree_leaf(std::uint32_t leaf) const { return stored_->leaves[leaf].of_tree; }
  /// Those of some leaves of the tree.
  LeafRange leaves_of(const LeafRange& of_tree) const;
  /// Finite points that are left out.
  std::uint64_t ignored() const { return stored_->ignored; }
  std::uint64_t count_of(const LeafRange& range) const;
  /// So many of the last points of a leaf are copies, as the iteration before found.
  std::uint64_t copies_of(std::uint32_t leaf) const { return stored_->leaves[leaf].copies; }

  /// The points of the leaves, leaf after leaf, relative to the middles of their zones, and in the same order their
  /// indices in the input; of both, what is given.
  void read_stored(const LeafRange& range, std::vector<Point>* points, std::vector<std::uint64_t>* indices) const;
  /// Such points of a leaf as offsets from the origin; and all of some leaves so.
  void bring(std::uint32_t leaf, std::span<Point> points) const;
  void read(const LeafRange& range, std::vector<Point>& points) const;
  /// Appends the points of the region; of the leaves in `except`, only those that are computed around another origin.
  /// At most `most` of all are wanted: false as soon as there are more. Copies are left out where they surely lie where
  /// their firsts do. In several zones a first may be rounded around another origin: there copies come with the points,
  /// and their numbers in `copies`.
  bool append(const point::Region& region, const LeafRange& except, std::size_t most, std::vector<Point>& points,
              std::vector<std::uint32_t>& copies) const;
  /// Appends likewise the points of the leaves nearest to a place, so many leaves as have at most `most` points.
  /// Returns the distance up to which these are all.
  double append_nearest(const Point& to, std::size_t most, std::vector<Point>& points,
                        std::vector<std::uint32_t>& copies) const;
  /// Calls visit(points) for all points, a few at a time.
  void for_all(const std::function<void(std::span<const Point>)>& visit) const;

 private:
  // Where the points of the leaves are in a file: `begin[i]` of the i-th leaf that it has, and past the last.
  struct Part {
    std::unique_ptr<PointsFile> file;
    std::vector<std::uint32_t> leaves;
    std::vector<std::uint64_t> begins, copies;
  };
  // What a part has of a leaf.
  struct Piece {
    const PointsFile& file;
    std::uint32_t leaf;
    std::uint64_t first, count, copies;
  };

  struct Leaf {
    std::uint32_t of_tree;
    Zone zone;
    Bounds bounds;    // relative to the middle of the zone
    Position origin;  // as origin_for() has it
    std::uint64_t copies = 0;
  };
  struct Stored {
    std::vector<std::filesystem::path> files;
    std::vector<Part> parts;
    std::vector<Leaf> leaves;  // by their numbers in the tree, then by zone
    std::uint64_t ignored = 0;
  };
  StoredCloud(std::shared_ptr<const Stored> stored, const Zones& zones, const Position& origin);
  static std::shared_ptr<const Stored> open(const std::vector<std::filesystem::path>& files, std::size_t leaves,
                                            const Zones& zones);
  static void choose_origins(std::vector<Leaf>& leaves, const Zones& zones);
  Position shift_of(std::uint32_t leaf) const;
  // Calls visit(piece) for what the files have of the wanted leaves of the range, until it is false.
  template <class IsWanted, class Visit>
  void for_pieces(const LeafRange& range, const IsWanted& is_wanted, const Visit& visit) const;
  std::uint64_t appended_of(std::uint32_t leaf) const;  // at most
  // Appends those points of a piece for which take(point).
  template <class Take>
  void append_piece(const Piece& piece, std::vector<Point>& points, std::vector<std::uint32_t>& copies,
                    const Take& take) const;

  std::shared_ptr<const Stored> stored_;
  Zones zones_;
  Position origin_{};
  std::vector<Bounds> leaf_bounds_;
  Bounds bounds_ = kNoBounds;
};

}  // namespace pointfair::scale
