// SPDX-License-Identifier: Apache-2.0
#include "scale/emit.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/parallel.hpp"
#include "point/outliers.h"
#include "scale/given.hpp"
#include "scale/points_file.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/noise_levels.hpp"
#include "seam/stop.hpp"

namespace pointfair::scale {
namespace {

Position moved_position(const Position& own, const Point& before, const Point& now) {
  const auto along = [](double p, float from, float to) { return p + (double{to} - from); };
  return {along(own[0], before.x, now.x), along(own[1], before.y, now.y), along(own[2], before.z, now.z)};
}

}  // namespace

TileResults::TileResults(const std::vector<std::filesystem::path>& tiles, const Plan& plan, std::size_t file,
                         std::shared_ptr<const Source> source, const DisplacementLimits& limits, std::stop_token stop)
    : plan_(plan),
      first_point_(plan.files[file].first_point),
      source_(std::move(source)),
      limits_(limits.or_endless()),
      may_hold_back_(limits.farthest > 0 || plan.iterations > 1),
      stop_(std::move(stop)) {
  for (const std::filesystem::path& path : tiles) {
    TileFile its{path, std::vector<std::uint64_t>(plan.chunks.size() + 1, 0)};
    for (const Section& section : PointsFile(path).sections()) its.begins[section.key + 1] = section.count;
    for (std::size_t c = 0; c < plan.chunks.size(); ++c) its.begins[c + 1] += its.begins[c];
    tiles_.push_back(std::move(its));
  }
}

std::shared_ptr<const TileResults::Held> TileResults::hold(std::size_t chunk) const {
  const std::lock_guard lock(mutex_);
  for (const auto& held : held_)
    if (held->chunk == chunk) return held;
  if (held_.size() > 1) held_.erase(held_.begin());
  auto held = std::make_shared<Held>();
  held->chunk = chunk;
  held->points.assign(plan_.chunks[chunk].points, Point{kNan, kNan, kNan});
  constexpr std::uint64_t kSome = 1 << 20;
  std::vector<Point> points;
  std::vector<std::uint32_t> indices;
  for (const TileFile& tile : tiles_) {
    if (tile.begins[chunk] == tile.begins[chunk + 1]) continue;
    const PointsFile file(tile.path);
    for (std::uint64_t at = tile.begins[chunk]; at < tile.begins[chunk + 1]; at += points.size()) {
      points.resize(std::min(kSome, tile.begins[chunk + 1] - at));
      indices.resize(points.size());
      file.positions(at, points);
      file.short_indices(at, indices);
      for (std::size_t i = 0; i < points.size(); ++i) held->points[indices[i]] = points[i];
    }
  }
  held_.push_back(held);
  return held;
}

Position TileResults::origin_at(const Position& own, const Position& of_file) const {
  const Zones& zones = plan_.zones;
  return zones.are_several() ? zones.middle_of(zones.zone_of(own)) : of_file;
}

std::vector<Point> TileResults::offsets(std::span<const Position> own, bool in_zones) const {
  std::vector<Point> points;
  points.reserve(own.size());
  for (const Position& p : own)
    points.push_back(offset(p, in_zones ? origin_at(p, plan_.zones.origin) : plan_.zones.origin));
  return points;
}

// Ignored points go as invalid ones, as they did into the tiles.
void TileResults::take(std::uint64_t first, std::span<const Position> own, std::span<const Point> before,
                       std::span<Point> now) const {
  const Limits& limits = plan_.limits;
  const bool are_some_ignored = !limits.ignore.empty();
  std::vector<Point> in_cloud;
  if (plan_.zones.are_several()) in_cloud = offsets(own, false);
  const std::span<const Point> around_origin = in_cloud.empty() ? before : std::span<const Point>(in_cloud);
  std::vector<point::Outlier> outliers(now.size(), point::Outlier::none);
  std::vector<std::uint8_t> held;
  if (limits == Limits{}) {
    limit(first, {before, around_origin}, now, outliers);
  } else {
    const Cloud here = part_of(source_, first, around_origin);
    const std::vector<std::uint8_t> ignored = held_by_any(limits.ignore, here);
    std::vector<Point> seen(before.begin(), before.end());
    for (std::size_t i = 0; are_some_ignored && i < seen.size(); ++i)
      if (ignored[i]) seen[i] = {kNan, kNan, kNan};
    limit(first, {seen, around_origin}, now, outliers);
    const std::vector<std::uint8_t> movable = movable_points(limits, here);
    if (plan_.zones.are_several())  // as of a cloud in memory, whose limits see positions
      for (std::size_t i = 0; i < now.size(); ++i)
        if (is_indexed(before[i])) now[i] = moved_offset(before[i], own[i], moved_position(own[i], before[i], now[i]));
    apply_limits(limits, movable, before, now);
    held.resize(movable.size());
    for (std::size_t i = 0; i < movable.size(); ++i)
      held[i] = !movable[i] && is_finite(before[i]) && !(are_some_ignored && ignored[i]) &&
                outliers[i] == point::Outlier::none;  // which are counted by themselves
  }
  for (const Range& range : counted_.take({first, first + now.size()})) {
    const auto from = static_cast<std::size_t>(range.begin - first), count = std::size_t(range.end - range.begin);
    tally(before.subspan(from, count), now.subspan(from, count), std::span(outliers).subspan(from, count));
    if (!held.empty()) held_by_limits_ += std::uint64_t(std::count(&held[from], &held[from] + count, 1));
  }
}

void TileResults::tally(std::span<const Point> before, std::span<const Point> now,
                        std::span<const point::Outlier> outliers) const {
  OutlierCounts counts;
  for (const point::Outlier outlier : outliers) count(outlier, counts);
  held_back_.add(counts);
  std::vector<float> lengths;
  lengths.reserve(now.size());
  for (std::size_t i = 0; i < now.size(); ++i) {
    const double x = double{now[i].x} - before[i].x, y = double{now[i].y} - before[i].y,
                 z = double{now[i].z} - before[i].z;
    const auto length = static_cast<float>(std::sqrt(x * x + y * y + z * z));
    if (std::isfinite(length)) lengths.push_back(length);
  }
  moves_.add(lengths);
}

void TileResults::visit_outliers(unsigned threads, const std::function<void(const SomeOutliers&)>& visit) const {
  io::with_threads(threads, [&] {
    io::for_each_block(source_->block_count(), [&](std::size_t block) {
      std::vector<Point> points(source_->block_size(block)), now(points.size());
      io::OriginSample unused(points.size());
      place_seen(source_, block, plan_.limits, points, unused);
      const std::uint64_t first = source_->block_begin(block);
      std::vector<Point> in_zones = points;
      if (plan_.zones.are_several()) {
        std::vector<Position> own(points.size());
        source_->positions(block, own);
        in_zones = offsets(own, true);
        for (std::size_t i = 0; i < points.size(); ++i)
          if (!is_indexed(points[i])) in_zones[i] = points[i];
      }
      std::vector<point::Outlier> found(points.size(), point::Outlier::none);
      limit(first, {in_zones, points}, now, found);
      std::vector<std::uint8_t> marks(found.size()), movable;
      std::ranges::transform(found, marks.begin(), [](point::Outlier its) { return static_cast<std::uint8_t>(its); });
      if (plan_.limits != Limits{}) movable = movable_points(plan_.limits, part_of(source_, first, points));
      std::vector<std::uint8_t> reasons = marks;
      for (std::size_t i = 0; i < movable.size(); ++i)
        if (!movable[i]) reasons[i] = 0;
      visit({first, points, marks, reasons});
    });
  });
}

void TileResults::limit(std::uint64_t first, const Before& before, std::span<Point> now,
                        std::span<point::Outlier> outliers) const {
  throw_if_stopped(stop_);
  const point::NodeField field = field_of(limits_.levels.get());
  std::shared_ptr<const Held> held;
  std::size_t at = 0;  // among its points
  for (std::size_t i = 0; i < now.size(); ++i, ++at) {
    if (!held || at == held->points.size()) {
      const std::uint64_t index = first_point_ + first + i;
      held = hold(chunk_of(plan_.chunks, index));
      at = std::size_t(index - plan_.chunks[held->chunk].first_point);
    }
    const Point &from = before.in_zones[i], &to = held->points[at];
    now[i] = is_indexed(from) ? to : from;
    if (!may_hold_back_ || !is_indexed(from)) continue;
    const float level = point::node_value(field, to_vec3(before.in_cloud[i]));
    const auto limited = point::limited(to_vec3(from), to_vec3(to), limits_, level);
    now[i] = {limited.place.x, limited.place.y, limited.place.z};
    outliers[i] = limited.outlier;
  }
}

}  // namespace pointfair::scale
