// SPDX-License-Identifier: Apache-2.0
#include "scale/emit.hpp"

#include <algorithm>
#include <limits>

#include "point/outliers.h"
#include "scale/points_file.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/noise_levels.hpp"

namespace pointfair::scale {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

}  // namespace

TileResults::TileResults(const std::vector<std::filesystem::path>& tiles, const Plan& plan, std::size_t file,
                         const Settling& settling, std::stop_token stop)
    : plan_(plan), first_point_(plan.files[file].first_point), settling_(settling), stop_(std::move(stop)) {
  if (!(settling_.limits.farthest > 0)) settling_.limits = {kUnbounded, kUnbounded};
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

Point TileResults::settle(const Point& before, const Point& faired) const {
  if (!is_indexed(before)) return before;
  if (!settling_.may_hold_back) return faired;
  const point::NoiseField field = field_of(settling_.limits.levels.get());
  const auto [farthest, outlier_distance] =
      point::limits_at(limit_rule(settling_.limits), point::noise_level(field, to_vec3(before)));
  const auto settled = point::settled(to_vec3(before), to_vec3(faired), farthest, outlier_distance);
  if (settled.outlier != point::Outlier::none) {
    OutlierCounts one;
    count(settled.outlier, one);
    held_back_.add(one);
  }
  return {settled.place.x, settled.place.y, settled.place.z};
}

void TileResults::take(std::uint64_t first, std::span<const Point> before, std::span<Point> now) const {
  const std::vector<InputChunk>& chunks = plan_.chunks;
  if (stop_.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
  std::uint64_t index = first_point_ + first;
  for (std::size_t done = 0; done < before.size();) {
    const auto after = std::upper_bound(chunks.begin(), chunks.end(), index,
                                        [](std::uint64_t i, const InputChunk& c) { return i < c.first_point; });
    const auto chunk = std::size_t(after - chunks.begin()) - 1;
    const auto held = hold(chunk);
    const std::size_t from = index - chunks[chunk].first_point;
    const std::size_t count = std::min(before.size() - done, held->points.size() - from);
    for (std::size_t i = 0; i < count; ++i) now[done + i] = settle(before[done + i], held->points[from + i]);
    done += count;
    index += count;
  }
}

}  // namespace pointfair::scale
