// SPDX-License-Identifier: Apache-2.0
#include "io/array_source.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "io/offset.hpp"
#include "io/origin_sample.hpp"
#include "io/parallel.hpp"
#include "io/source.hpp"
#include "pointfair/positions.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kBlock = 4096;  // as binary files are read, so that the origin is that of such a file

Position in_double(const Position& position) { return position; }
Position in_double(const Point& point) { return {point.x, point.y, point.z}; }

// Coordinates in the caller's memory, seen as a file of nothing else. Lives no longer than that memory.
template <class Element>
class View final : public Source {
 public:
  explicit View(std::span<const Element> elements)
      : Source(io::FileBytes::copy({}), "array", Format::xyz, Encoding::binary), elements_(elements) {}

  std::size_t block_count() const override { return (elements_.size() + kBlock - 1) / kBlock; }
  std::uint64_t block_begin(std::size_t block) const override { return std::min(block * kBlock, elements_.size()); }
  void positions(std::size_t block, std::span<Position> out) const override {
    const auto part = elements_.subspan(static_cast<std::size_t>(block_begin(block)), out.size());
    std::ranges::transform(part, out.begin(), [](const Element& element) { return in_double(element); });
  }
  ScalarType coordinate_type() const override { return ScalarType::float64; }
  std::vector<io::Column> columns() const override { return {}; }
  void extract_block(std::size_t, std::size_t, std::span<char>) const override {}

 private:
  std::span<const Element> elements_;
};

void check_size(std::size_t is, std::size_t wanted) {
  if (is == wanted) return;
  throw Error(ErrorKind::usage,
              "the array has " + std::to_string(is) + " positions, the cloud " + std::to_string(wanted));
}

}  // namespace

Position choose_origin(std::span<const Position> positions) { return View<Position>(positions).sampled_origin(); }
Position choose_origin(std::span<const Point> positions) {
  if (positions.size() > io::kSampledPositions) return View<Point>(positions).sampled_origin();
  std::vector<Position> all(positions.size());  // the sample of few
  std::transform(positions.begin(), positions.end(), all.begin(), [](const Point& p) { return in_double(p); });
  return io::choose_origin(std::move(all));
}
std::vector<Position> choose_origins(std::span<const Point> positions, std::span<const std::uint64_t> offsets) {
  if (offsets.empty()) return {};
  std::vector<Position> origins(offsets.size() - 1);
  io::for_each_block(origins.size(), [&](std::size_t cloud) {
    const auto begin = static_cast<std::size_t>(offsets[cloud]), end = static_cast<std::size_t>(offsets[cloud + 1]);
    origins[cloud] = choose_origin(positions.subspan(begin, end - begin));
  });
  return origins;
}

Position choose_origin_by_sample(std::vector<Position> sample) { return io::choose_origin(std::move(sample)); }

io::PlacedArray io::place_array(std::span<const Position> positions) {
  View<Position> view(positions);
  PlacedArray placed;
  placed.cloud.points = view.place();
  placed.cloud.origin = view.origin();
  placed.sample = view.sample();
  return placed;
}

void positions(const Cloud& cloud, std::span<Position> out) {
  check_size(out.size(), cloud.points.size());
  if (!cloud.source) {
    std::ranges::transform(cloud.points, out.begin(), [&](const Point& p) {
      return Position{cloud.origin[0] + p.x, cloud.origin[1] + p.y, cloud.origin[2] + p.z};
    });
    return;
  }
  io::check_has_points_of_file(cloud);
  const io::Edits edits{cloud, {}, {}, {}};
  io::for_each_block(cloud.source->block_count(), [&](std::size_t block) {
    const Moves moves = cloud.source->moves(block, edits);
    std::ranges::copy(moves.values, out.begin() + cloud.source->block_begin(block));
  });
}

ScalarType position_type(const Cloud& cloud) {
  if (cloud.source) return cloud.source->coordinate_type();
  return cloud.origin == Position{} ? ScalarType::float32 : ScalarType::float64;
}

void move_positions(const Cloud& before, std::span<const Point> after, std::span<Position> positions) {
  check_size(positions.size(), before.points.size());
  check_size(after.size(), before.points.size());
  io::for_each_block((positions.size() + kBlock - 1) / kBlock, [&](std::size_t block) {
    const std::size_t end = std::min(positions.size(), (block + 1) * kBlock);
    for (std::size_t i = block * kBlock; i < end; ++i) {
      const float from[3] = {before.points[i].x, before.points[i].y, before.points[i].z};
      const float to[3] = {after[i].x, after[i].y, after[i].z};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (io::same_bits(from[axis], to[axis]) || from[axis] == to[axis]) continue;  // also of -0.0 and 0.0
        double& value = positions[i][axis];
        value = io::moved_value(value, from[axis], to[axis], before.origin[axis], 0);
      }
    }
  });
}

}  // namespace pointfair
