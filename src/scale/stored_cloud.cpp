// SPDX-License-Identifier: Apache-2.0
#include "scale/stored_cloud.hpp"

#include <algorithm>
#include <functional>

namespace pointfair::scale {

bool lies_inside(const point::Region& r, const Bounds& b) {
  return b.min.x >= r.min.x && b.max.x <= r.max.x && b.min.y >= r.min.y && b.max.y <= r.max.y && b.min.z >= r.min.z &&
         b.max.z <= r.max.z;
}

bool may_overlap(const point::Region& r, const Bounds& b) {
  return b.valid > 0 && b.min.x <= r.max.x && b.max.x >= r.min.x && b.min.y <= r.max.y && b.max.y >= r.min.y &&
         b.min.z <= r.max.z && b.max.z >= r.min.z;
}

StoredCloud::StoredCloud(const std::vector<std::filesystem::path>& files, std::size_t leaves)
    : leaf_bounds_(leaves, kNoBounds) {
  constexpr std::size_t kMostOpen = 256;
  for (const std::filesystem::path& path : files) {
    Part part{std::make_unique<PointsFile>(path), {}, {0}};
    for (const Section& section : part.file->sections()) {
      if (section.count == 0) continue;
      part.leaves.push_back(section.key);
      part.begins.push_back(part.begins.back() + section.count);
      unite(leaf_bounds_[section.key], {section.min, section.max, section.count});
    }
    for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += part.file->header().counts[i];
    files_.push_back(path);
    if (files.size() > kMostOpen) part.file.reset();
    parts_.push_back(std::move(part));
  }
  for (const Bounds& leaf : leaf_bounds_) unite(bounds_, leaf);
  if (bounds_.valid == 0) bounds_ = {};
}

std::uint64_t StoredCloud::count_of(const LeafRange& range) const { return bounds_of(range).valid; }

Bounds StoredCloud::bounds_of(const LeafRange& range) const {
  Bounds all = kNoBounds;
  for (std::uint32_t leaf = range.begin; leaf < range.end; ++leaf) unite(all, leaf_bounds_[leaf]);
  return all;
}

namespace {

// Opened for as long as it is used, where too many files would stay open.
class Opened {
 public:
  Opened(const std::unique_ptr<PointsFile>& open, const std::filesystem::path& path)
      : own_(open ? nullptr : std::make_unique<PointsFile>(path)), file_(open ? *open : *own_) {}
  const PointsFile* operator->() const { return &file_; }

 private:
  std::unique_ptr<PointsFile> own_;
  const PointsFile& file_;
};

}  // namespace

void StoredCloud::read(const LeafRange& range, std::vector<Point>* points, std::vector<std::uint64_t>* indices) const {
  std::vector<std::uint64_t> next(range.end - range.begin + 1, 0);
  for (std::uint32_t leaf = range.begin; leaf < range.end; ++leaf)
    next[leaf - range.begin + 1] = next[leaf - range.begin] + leaf_bounds_[leaf].valid;
  if (points) points->resize(next.back());
  if (indices) indices->resize(next.back());
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const Part& part = parts_[p];
    const auto first = std::lower_bound(part.leaves.begin(), part.leaves.end(), range.begin);
    if (first == part.leaves.end() || !range.holds(*first)) continue;
    const Opened file(part.file, files_[p]);
    for (auto at = first; at != part.leaves.end() && range.holds(*at); ++at) {
      const auto i = static_cast<std::size_t>(at - part.leaves.begin());
      const std::size_t count = part.begins[i + 1] - part.begins[i];
      std::uint64_t& to = next[*at - range.begin];
      if (points) file->positions(part.begins[i], std::span(*points).subspan(to, count));
      if (indices) file->indices(part.begins[i], std::span(*indices).subspan(to, count));
      to += count;
    }
  }
}

bool StoredCloud::append(const point::Region& region, const LeafRange& except, std::size_t most,
                         std::vector<Point>& points) const {
  std::vector<std::uint8_t> wanted(leaf_bounds_.size(), 0);  // 2: all of it
  std::size_t certain = points.size();
  for (std::uint32_t leaf = 0; leaf < leaf_bounds_.size(); ++leaf) {
    const Bounds& b = leaf_bounds_[leaf];
    if (except.holds(leaf) || !may_overlap(region, b)) continue;
    wanted[leaf] = lies_inside(region, b) ? 2 : 1;
    if (wanted[leaf] == 2) certain += b.valid;
  }
  if (certain > most) return false;
  points.reserve(certain + certain / 4);
  std::vector<Point> some;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const Part& part = parts_[p];
    if (std::none_of(part.leaves.begin(), part.leaves.end(), [&](std::uint32_t leaf) { return wanted[leaf] != 0; }))
      continue;
    const Opened file(part.file, files_[p]);
    for (std::size_t i = 0; i < part.leaves.size(); ++i) {
      const std::uint8_t want = wanted[part.leaves[i]];
      if (want == 0) continue;
      some.resize(part.begins[i + 1] - part.begins[i]);
      file->positions(part.begins[i], some);
      if (want == 2) {
        points.insert(points.end(), some.begin(), some.end());
      } else {
        for (const Point& q : some)
          if (point::is_inside(region, to_vec3(q))) points.push_back(q);
      }
      if (points.size() > most) return false;
    }
  }
  return true;
}

void StoredCloud::for_all(const std::function<void(std::span<const Point>)>& visit) const {
  constexpr std::uint64_t kSome = 1 << 20;
  std::vector<Point> some;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const Opened file(parts_[p].file, files_[p]);
    for (std::uint64_t first = 0; first < parts_[p].begins.back(); first += kSome) {
      some.resize(std::min(kSome, parts_[p].begins.back() - first));
      file->positions(first, some);
      visit(some);
    }
  }
}

}  // namespace pointfair::scale
