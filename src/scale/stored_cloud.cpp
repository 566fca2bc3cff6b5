// SPDX-License-Identifier: Apache-2.0
#include "scale/stored_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

namespace pointfair::scale {
namespace {

constexpr LeafRange kAll{0, std::numeric_limits<std::uint32_t>::max()};

// From the box of some points.
double distance(const Bounds& from, const Point& to) {
  const auto outside = [](double low, double high, double value) { return std::max({low - value, value - high, 0.0}); };
  const double x = outside(from.min.x, from.max.x, to.x), y = outside(from.min.y, from.max.y, to.y),
               z = outside(from.min.z, from.max.z, to.z);
  return std::sqrt(x * x + y * y + z * z);
}

}  // namespace

std::shared_ptr<const StoredCloud::Stored> StoredCloud::open(const std::vector<std::filesystem::path>& files,
                                                             std::size_t leaves, const Zones& zones) {
  constexpr std::size_t kMostOpen = 100;  // macOS lets a process have 256
  const auto stored = std::make_shared<Stored>();
  const auto place_of = [](const Leaf& leaf) { return std::tuple(leaf.of_tree, leaf.zone); };
  if (zones.are_several()) {
    for (const std::filesystem::path& path : files)
      for (const Section& section : PointsFile(path).sections())
        stored->leaves.push_back({section.key, section.zone, kNoBounds, {}});
    std::ranges::sort(stored->leaves, {}, place_of);
    const auto more_of_same = std::ranges::unique(stored->leaves, {}, place_of);
    stored->leaves.erase(more_of_same.begin(), more_of_same.end());
  } else {
    for (std::uint32_t leaf = 0; leaf < leaves; ++leaf) stored->leaves.push_back({leaf, {}, kNoBounds, {}});
  }
  for (const std::filesystem::path& path : files) {
    Part part{std::make_unique<PointsFile>(path), {}, {0}, {}};
    for (const Section& section : part.file->sections()) {
      const auto its = std::ranges::lower_bound(stored->leaves, std::tuple(section.key, section.zone), {}, place_of);
      part.leaves.push_back(static_cast<std::uint32_t>(its - stored->leaves.begin()));
      part.begins.push_back(part.begins.back() + section.count);
      part.copies.push_back(section.copies);
      its->copies += section.copies;
      unite(its->bounds, {section.min, section.max, section.count});
    }
    stored->ignored += part.file->header().counts.ignored;
    stored->files.push_back(path);
    if (files.size() > kMostOpen) part.file.reset();
    stored->parts.push_back(std::move(part));
  }
  choose_origins(stored->leaves, zones);
  return stored;
}

void StoredCloud::choose_origins(std::vector<Leaf>& leaves, const Zones& zones) {
  std::map<Zone, std::uint64_t> counts;
  for (const Leaf& leaf : leaves) counts[leaf.zone] += leaf.bounds.valid;
  std::map<Zone, Position> origins;
  for (const auto& [zone, count] : counts) {
    Position& origin = origins[zone] = zones.middle_of(zone);
    if (count >= kFewestOfZone || !zones.are_several()) continue;
    origin = zones.origin;
    std::uint64_t most = kFewestOfZone - 1;
    for (std::int32_t i = 0; i < 27; ++i) {
      const Zone beside{zone[0] + i % 3 - 1, zone[1] + i / 3 % 3 - 1, zone[2] + i / 9 - 1};
      const auto its = counts.find(beside);
      if (its == counts.end() || its->second <= most) continue;
      most = its->second;
      origin = zones.middle_of(beside);
    }
  }
  for (Leaf& leaf : leaves) leaf.origin = origins[leaf.zone];
}

StoredCloud::StoredCloud(const std::vector<std::filesystem::path>& files, std::size_t leaves, const Zones& zones)
    : StoredCloud(open(files, leaves, zones), zones, zones.origin) {}

StoredCloud::StoredCloud(std::shared_ptr<const Stored> stored, const Zones& zones, const Position& origin)
    : stored_(std::move(stored)), zones_(zones), origin_(origin) {
  for (std::uint32_t leaf = 0; leaf < stored_->leaves.size(); ++leaf) {
    Bounds bounds = stored_->leaves[leaf].bounds;
    if (const Position shift = shift_of(leaf); shift != Position{})
      bounds = {shifted(bounds.min, shift), shifted(bounds.max, shift), bounds.valid};
    leaf_bounds_.push_back(bounds);
    unite(bounds_, bounds);
  }
  if (bounds_.valid == 0) bounds_ = {};
}

StoredCloud StoredCloud::seen_from(const Position& origin) const { return {stored_, zones_, origin}; }

Position StoredCloud::shift_of(std::uint32_t leaf) const {
  return difference(zones_.middle_of(stored_->leaves[leaf].zone), origin_);
}

LeafRange StoredCloud::leaves_of(const LeafRange& of_tree) const {
  const auto first = [&](std::uint32_t leaf) {
    const auto its = std::ranges::lower_bound(stored_->leaves, leaf, {}, &Leaf::of_tree);
    return static_cast<std::uint32_t>(its - stored_->leaves.begin());
  };
  return {first(of_tree.begin), first(of_tree.end)};
}

void StoredCloud::bring(std::uint32_t leaf, std::span<Point> points) const {
  const Position shift = shift_of(leaf);
  if (shift == Position{}) return;  // bits stay, also those of outliers
  for (Point& p : points) p = shifted(p, shift);
}

std::uint64_t StoredCloud::count_of(const LeafRange& range) const {
  std::uint64_t count = 0;
  for (std::uint32_t leaf = range.begin; leaf < range.end; ++leaf) count += leaf_bounds_[leaf].valid;
  return count;
}

template <class IsWanted, class Visit>
void StoredCloud::for_pieces(const LeafRange& range, const IsWanted& is_wanted, const Visit& visit) const {
  for (std::size_t p = 0; p < stored_->parts.size(); ++p) {
    const auto& [open, leaves, begins, copies] = stored_->parts[p];
    std::unique_ptr<PointsFile> opened;  // for as long as it is used, where too many files would stay open
    const auto first = std::ranges::lower_bound(leaves, range.begin);
    for (auto leaf = first; leaf != leaves.end() && range.holds(*leaf); ++leaf) {
      if (!is_wanted(*leaf)) continue;
      if (!open && !opened) opened = std::make_unique<PointsFile>(stored_->files[p]);
      const auto i = static_cast<std::size_t>(leaf - leaves.begin());
      if (!visit(Piece{open ? *open : *opened, *leaf, begins[i], begins[i + 1] - begins[i], copies[i]})) return;
    }
  }
}

void StoredCloud::read(const LeafRange& range, std::vector<Point>& points) const {
  read_stored(range, &points, nullptr);
  std::uint64_t at = 0;
  for (std::uint32_t leaf = range.begin; leaf < range.end; at += leaf_bounds_[leaf++].valid)
    bring(leaf, std::span(points).subspan(at, leaf_bounds_[leaf].valid));
}

void StoredCloud::read_stored(const LeafRange& range, std::vector<Point>* points,
                              std::vector<std::uint64_t>* indices) const {
  std::vector<std::uint64_t> next(range.end - range.begin + 1, 0);
  for (std::uint32_t leaf = range.begin; leaf < range.end; ++leaf)
    next[leaf - range.begin + 1] = next[leaf - range.begin] + leaf_bounds_[leaf].valid;
  if (points) points->resize(next.back());
  if (indices) indices->resize(next.back());
  const auto all = [](std::uint32_t) { return true; };
  for_pieces(range, all, [&](const Piece& piece) {
    std::uint64_t& to = next[piece.leaf - range.begin];
    if (points) piece.file.positions(piece.first, std::span(*points).subspan(to, piece.count));
    if (indices) piece.file.indices(piece.first, std::span(*indices).subspan(to, piece.count));
    to += piece.count;
    return true;
  });
}

std::uint64_t StoredCloud::appended_of(std::uint32_t leaf) const {
  return leaf_bounds_[leaf].valid - (zones_.are_several() ? 0 : copies_of(leaf));
}

template <class Take>
void StoredCloud::append_piece(const Piece& piece, std::vector<Point>& points, std::vector<std::uint32_t>& copies,
                               const Take& take) const {
  const std::uint64_t firsts = piece.count - piece.copies;
  std::vector<Point> some(zones_.are_several() ? piece.count : firsts);
  piece.file.positions(piece.first, some);
  bring(piece.leaf, some);
  for (std::size_t i = 0; i < some.size(); ++i) {
    if (!take(some[i])) continue;
    if (i >= firsts) copies.push_back(std::uint32_t(points.size()));
    points.push_back(some[i]);
  }
}

bool StoredCloud::append(const point::Region& region, const LeafRange& except, std::size_t most,
                         std::vector<Point>& points, std::vector<std::uint32_t>& copies) const {
  std::vector<std::uint8_t> wanted(leaf_bounds_.size(), 0);  // 2: all of it
  std::size_t certain = points.size();
  for (std::uint32_t leaf = 0; leaf < leaf_bounds_.size(); ++leaf) {
    const Bounds& b = leaf_bounds_[leaf];
    if (!may_overlap(region, b) || (except.holds(leaf) && origin_for(leaf) == origin_)) continue;
    wanted[leaf] = lies_inside(region, b) ? 2 : 1;
    if (wanted[leaf] == 2) certain += appended_of(leaf);
  }
  if (certain > most) return false;
  points.reserve(certain + certain / 4);
  const auto is_wanted = [&](std::uint32_t leaf) { return wanted[leaf] != 0; };
  for_pieces(kAll, is_wanted, [&](const Piece& piece) {
    append_piece(piece, points, copies,
                 [&](const Point& p) { return wanted[piece.leaf] == 2 || point::is_inside(region, to_vec3(p)); });
    return points.size() <= most;
  });
  return points.size() <= most;
}

double StoredCloud::append_nearest(const Point& to, std::size_t most, std::vector<Point>& points,
                                   std::vector<std::uint32_t>& copies) const {
  constexpr std::size_t kEnough = 32;  // leaves: more of them bring hardly any that are as near
  std::vector<std::pair<double, std::uint32_t>> by_distance;
  for (std::uint32_t leaf = 0; leaf < leaf_bounds_.size(); ++leaf)
    if (const Bounds& its = leaf_bounds_[leaf]; its.valid > 0) by_distance.emplace_back(distance(its, to), leaf);
  std::ranges::sort(by_distance);
  std::vector<bool> is_wanted(leaf_bounds_.size());
  std::size_t taken = 0, count = 0;
  for (; taken < std::min(kEnough, by_distance.size()); ++taken) {
    const std::uint32_t leaf = by_distance[taken].second;
    count += appended_of(leaf);
    if (count > most) break;
    is_wanted[leaf] = true;
  }
  for_pieces(
      kAll, [&](std::uint32_t leaf) { return is_wanted[leaf]; },
      [&](const Piece& piece) {
        append_piece(piece, points, copies, is_indexed);
        return true;
      });
  return taken < by_distance.size() ? by_distance[taken].first : double(kUnbounded);
}

void StoredCloud::for_all(const std::function<void(std::span<const Point>)>& visit) const {
  constexpr std::size_t kSome = 1 << 20;
  std::vector<Point> some;
  some.reserve(std::min<std::uint64_t>(kSome, bounds_.valid));
  const auto all = [](std::uint32_t) { return true; };
  for_pieces(kAll, all, [&](const Piece& piece) {
    if (!some.empty() && some.size() + piece.count > kSome) {
      visit(some);
      some.clear();
    }
    const std::size_t at = some.size();
    some.resize(at + piece.count);
    const std::span<Point> its = std::span(some).subspan(at);
    piece.file.positions(piece.first, its);
    bring(piece.leaf, its);
    return true;
  });
  if (!some.empty()) visit(some);
}

}  // namespace pointfair::scale
