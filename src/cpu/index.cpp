// SPDX-License-Identifier: Apache-2.0
#include "cpu/index.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cpu/parallel.h"
#include "cpu/sort.h"

namespace pointfair::cpu {
namespace {

constexpr std::size_t kBlock = 1 << 13;  // points; a multiple of the leaf and of a group of leaves
constexpr std::size_t kGroupsOfBlock = kBlock / kLeafSize / kLeafSize;
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// The box of most points: between the 2 % and the 98 % quantile of a sample on each axis, widened by a quarter. A stray
// point far away must not stretch the curve.
Box core_box(std::span<const Point> points, std::span<const std::uint64_t> elements, const Bounds& bounds) {
  constexpr std::size_t kSample = 2048;
  const std::size_t count = std::min(kSample, elements.size());
  std::array<std::vector<float>, 3> axis;
  for (std::size_t i = 0; i < count; ++i) {
    const Point& p = points[std::uint32_t(elements[i * elements.size() / count])];
    axis[0].push_back(p.x);
    axis[1].push_back(p.y);
    axis[2].push_back(p.z);
  }
  std::array<float, 3> low{}, high{};
  for (int a = 0; a < 3; ++a) {
    const std::size_t cut = count / 50;
    std::nth_element(axis[a].begin(), axis[a].begin() + cut, axis[a].end());
    low[a] = axis[a][cut];
    std::nth_element(axis[a].begin(), axis[a].end() - 1 - cut, axis[a].end());
    high[a] = *(axis[a].end() - 1 - cut);
    const float margin = (high[a] - low[a]) / 4;
    low[a] -= margin;
    high[a] += margin;
  }
  const Box box{std::max(low[0], bounds.min.x),  std::max(low[1], bounds.min.y),  std::max(low[2], bounds.min.z),
                std::min(high[0], bounds.max.x), std::min(high[1], bounds.max.y), std::min(high[2], bounds.max.z)};
  const bool flat = !(box.max_x > box.min_x || box.max_y > box.min_y || box.max_z > box.min_z);
  return flat ? Box{bounds.min.x, bounds.min.y, bounds.min.z, bounds.max.x, bounds.max.y, bounds.max.z} : box;
}

template <class Size>
Size groups_of(Size children) {
  return (children + kLeafSize - 1) / kLeafSize;
}

constexpr Box kNoChild{kNan, kNan, kNan, kNan, kNan, kNan};
constexpr Box kEmptyBox{kInf, kInf, kInf, -kInf, -kInf, -kInf};

Box unite(const Box& a, const Box& b) {
  return {std::min(a.min_x, b.min_x), std::min(a.min_y, b.min_y), std::min(a.min_z, b.min_z),
          std::max(a.max_x, b.max_x), std::max(a.max_y, b.max_y), std::max(a.max_z, b.max_z)};
}

Box child_of(const BoxGroup& g, std::size_t c) {
  return {g.min_x[c], g.min_y[c], g.min_z[c], g.max_x[c], g.max_y[c], g.max_z[c]};
}

void set_child(BoxGroup& g, std::size_t c, const Box& child) {
  g.min_x[c] = child.min_x;
  g.min_y[c] = child.min_y;
  g.min_z[c] = child.min_z;
  g.max_x[c] = child.max_x;
  g.max_y[c] = child.max_y;
  g.max_z[c] = child.max_z;
}

// Children fill a group from the front.
Box united(const BoxGroup& group) {
  Box result = kEmptyBox;
  for (std::size_t c = 0; c < kLeafSize && !std::isnan(group.min_x[c]); ++c) result = unite(result, child_of(group, c));
  return result;
}

}  // namespace

SpatialIndex::SpatialIndex(MemoryMeter& meter)
    : x_(meter), y_(meter), z_(meter), original_(meter), share_(meter), meter_(&meter) {}

void SpatialIndex::build(std::span<const Point> points, std::span<const Index> originals,
                         const std::optional<Frame>& frame, SortSpace& space, const Kernels& kernels,
                         const std::stop_token& stop) {
  if (points.size() > kMaxPoints)
    throw Error(ErrorKind::usage, "the CPU backend holds at most 2147483632 points at once; cut the cloud");
  collect_valid(points, originals, space, stop);
  space.scratch.resize(points_);
  const std::span<std::uint64_t> elements{space.elements.data(), points_}, scratch{space.scratch.data(), points_};
  if (points_ > 0 && frame) {
    const point::CurveCube cube = point::curve_cube(to_vec3(frame->reference), frame->side);
    sort_along_curve(points, elements, scratch, cube, kernels, stop);
  } else if (points_ > 0) {
    sort_along_curve(points, elements, scratch, core_box(points, elements, bounds_), kernels, stop);
  }
  gather(points, originals, space, stop);
  if (frame) {
    hash_positions(to_vec3(frame->corner), stop);
  } else {
    share_.release();
  }
  build_boxes(stop);
}

IndexView SpatialIndex::view() const {
  IndexView view{x_.data(), y_.data(),           z_.data(), original_.data(), points_,
                 leaves_,   int(levels_.size()), {},        share_.data()};
  for (std::size_t level = 0; level < levels_.size(); ++level) view.level[level] = levels_[level].data();
  return view;
}

void SpatialIndex::collect_valid(std::span<const Point> points, std::span<const Index> originals, SortSpace& space,
                                 const std::stop_token& stop) {
  const std::size_t blocks = (points.size() + kBlock - 1) / kBlock;
  std::vector<Bounds> of_block(blocks, kNoBounds);
  for_blocks(points.size(), kBlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
    Bounds bounds = kNoBounds;
    for (std::size_t i = first; i < last; ++i)
      if (is_indexed(points[i])) include(bounds, points[i]);
    of_block[block] = bounds;
  });
  bounds_ = kNoBounds;
  std::vector<std::size_t> first_valid(blocks);
  for (std::size_t block = 0; block < blocks; ++block) {
    first_valid[block] = bounds_.valid;
    unite(bounds_, of_block[block]);
  }
  points_ = Index(bounds_.valid);
  leaves_ = groups_of(points_);
  if (points_ == 0) bounds_ = {};

  space.elements.resize(points_);
  for_blocks(points.size(), kBlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
    std::size_t next = first_valid[block];
    if (of_block[block].valid == last - first) {
      for (std::size_t i = first; i < last; ++i) space.elements[next + i - first] = i;
      return;
    }
    for (std::size_t i = first; i < last; ++i)
      if (is_indexed(points[i])) space.elements[next++] = i;
  });
  invalid_.clear();
  for (std::size_t block = 0; block < blocks && points_ < points.size(); ++block) {
    const std::size_t first = block * kBlock, last = std::min(points.size(), first + kBlock);
    if (of_block[block].valid == last - first) continue;
    for (std::size_t i = first; i < last; ++i)
      if (!is_indexed(points[i])) invalid_.push_back({originals.empty() ? Index(i) : originals[i], points[i]});
  }
}

void SpatialIndex::gather(std::span<const Point> points, std::span<const Index> originals, const SortSpace& space,
                          const std::stop_token& stop) {
  const std::size_t padded = std::size_t(leaves_) * kLeafSize;
  for (Buffer<float>* axis : {&x_, &y_, &z_}) axis->resize(padded);
  original_.resize(padded);
  for_items(padded, kBlock, stop, [&](std::size_t i) {
    if (i + kPrefetchedAhead < points_)
      __builtin_prefetch(&points[std::uint32_t(space.elements[i + kPrefetchedAhead])]);
    const bool real = i < points_;
    const std::size_t from = real ? std::uint32_t(space.elements[i]) : 0;
    const Point p = real ? points[from] : Point{kNan, kNan, kNan};
    x_[i] = p.x;
    y_[i] = p.y;
    z_[i] = p.z;
    original_[i] = !real ? point::kNoNeighbor : originals.empty() ? Index(from) : originals[from];
  });
}

void SpatialIndex::hash_positions(point::Vec3<float> corner, const std::stop_token& stop) {
  share_.resize(x_.size());
  for_items(points_, kBlock, stop, [&](std::size_t i) {
    share_[i] = point::share_of_hash(point::position_hash({x_[i], y_[i], z_[i]}, corner));
  });
  std::fill(share_.data() + points_, share_.data() + share_.size(), 1.0f);  // the padding
}

void SpatialIndex::build_boxes(const std::stop_token& stop) {
  levels_.clear();
  if (leaves_ == 0) return;
  levels_.emplace_back(*meter_).resize(groups_of<std::size_t>(leaves_));
  for_blocks(levels_[0].size(), kGroupsOfBlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t child = first * kLeafSize; child < last * kLeafSize; ++child)
      set_child(levels_[0][child / kLeafSize], child % kLeafSize, leaf_box(child));
  });
  while (levels_.back().size() > 1) {
    const std::size_t below = levels_.size() - 1;
    levels_.emplace_back(*meter_).resize(groups_of(levels_[below].size()));
    Buffer<BoxGroup>& level = levels_.back();
    for_blocks(level.size(), kGroupsOfBlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t child = first * kLeafSize; child < last * kLeafSize; ++child)
        set_child(level[child / kLeafSize], child % kLeafSize,
                  child < levels_[below].size() ? united(levels_[below][child]) : kNoChild);
    });
  }
}

Box SpatialIndex::leaf_box(std::size_t leaf) const {
  if (leaf >= leaves_) return kNoChild;
  Box result = kEmptyBox;
  const std::size_t last = std::min<std::size_t>(points_, (leaf + 1) * kLeafSize);
  for (std::size_t i = leaf * kLeafSize; i < last; ++i)
    result = unite(result, {x_[i], y_[i], z_[i], x_[i], y_[i], z_[i]});
  return result;
}

}  // namespace pointfair::cpu
