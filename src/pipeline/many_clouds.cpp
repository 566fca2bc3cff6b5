// SPDX-License-Identifier: Apache-2.0
// Many small clouds in one call: on a device that can, as many at once as it has room for, else one after the other.
#include "seam/many_clouds.hpp"

#include <algorithm>
#include <string>

#include "estimate/automatic.hpp"
#include "pipeline/run_state.hpp"
#include "seam/device_memory.hpp"

namespace pointfair {
namespace {

void check_clouds(std::span<const std::uint64_t> offsets, std::size_t points, std::size_t room) {
  if (offsets.empty() || offsets.front() != 0 || offsets.back() != points)
    throw Error(ErrorKind::usage,
                "offsets must begin with 0 and end with the number of points, " + std::to_string(points));
  if (!std::is_sorted(offsets.begin(), offsets.end()))
    throw Error(ErrorKind::usage, "offsets must not decrease: cloud i has the points offsets[i] to offsets[i + 1]");
  if (room != points)
    throw Error(ErrorKind::usage,
                "the output holds " + std::to_string(room) + " points, the clouds " + std::to_string(points));
}

// Where clouds end, from the first of `offsets` on.
std::vector<std::uint32_t> ends_of(std::span<const std::uint64_t> offsets) {
  std::vector<std::uint32_t> ends;
  for (const std::uint64_t offset : offsets.subspan(1))
    ends.push_back(static_cast<std::uint32_t>(offset - offsets.front()));
  return ends;
}

// By all cores of the host: one of them is slower than the way to a card.
void copy(Sampling& by, std::span<const Point> from, std::span<Point> to) {
  constexpr std::size_t kPiece = 1 << 14;
  by.for_each_on_host((from.size() + kPiece - 1) / kPiece, [&](std::size_t piece) {
    const std::size_t begin = piece * kPiece, size = std::min(kPiece, from.size() - begin);
    std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(begin), size,
                to.begin() + static_cast<std::ptrdiff_t>(begin));
  });
}

template <class Memory>
PointsOnCard<Memory> part_of(const PointsOnCard<Memory>& points, std::size_t begin, std::size_t count) {
  using Byte = std::conditional_t<std::is_const_v<Memory>, const std::byte, std::byte>;
  PointsOnCard<Memory> part = points;
  part.data = static_cast<Byte*>(points.data) + static_cast<std::ptrdiff_t>(begin) * points.row_stride *
                                                    static_cast<std::ptrdiff_t>(size_of(points.type));
  part.count = count;
  return part;
}

}  // namespace

// Lists of every point serve clouds of any scale; what is estimated differs from cloud to cloud.
bool Pipeline::State::runs_together(const Params& params) {
  return cloud.backend().many_clouds() != nullptr && params.method == Method::bilateral &&
         params.along == Along::normal && !sums_within_radius(params) && !params.constraint && !needs_spacing(params) &&
         !needs_noise(params) && !needs_diagonal(params);
}

// As many at once as one upload takes. Afterwards the pipeline is empty.
void Pipeline::State::run_groups(std::span<const std::uint64_t> offsets, const Groups& groups) {
  const ManyClouds* const many = cloud.backend().many_clouds();
  const ManyClouds::Room room = many != nullptr ? many->room() : ManyClouds::Room{};
  const std::size_t all = offsets.size() - 1;
  for (std::size_t first = 0; first < all;) {
    std::size_t largest = 0, end = first;
    for (; end < all && end - first < room.clouds && groups.may_join(end); ++end) {
      const std::size_t points = offsets[end + 1] - offsets[end];
      largest = std::max(largest, points);
      if (points > room.points_of_cloud || (end + 1 - first) * largest > room.places) break;
    }
    if (end > first) {
      groups.run_together(first, end - first);
    } else {
      groups.run_alone(end++);
    }
    first = end;
  }
  load({});
}

void Pipeline::State::run_stages_of_all(const Params& used, const std::stop_token& stop) {
  Backend& backend = cloud.backend();
  Settings settings = settings_of(used, {});
  for (int iteration = 0; iteration < used.iterations; ++iteration) {
    backend.build_index(iteration, std::nullopt, stop);
    backend.find_neighbors(iteration, settings.neighbors, stop);
    backend.estimate_normals(iteration, settings.normals, stop);
    settings.fairing.is_further = iteration > 0;
    backend.fair(iteration, settings.fairing, false, stop);
  }
}

void Pipeline::State::run_many(std::span<const Point> points, std::span<const std::uint64_t> offsets,
                               const Params& params, std::span<Point> out, const std::stop_token& stop) {
  check_params(params);
  check_clouds(offsets, points.size(), out.size());
  load({});
  const bool at_once = runs_together(params);
  const Params used = at_once ? resolve_params(params, {}, {}, 0) : params;
  Groups groups;
  groups.may_join = [&](std::size_t) { return at_once; };
  groups.run_alone = [&](std::size_t one) {
    const std::size_t begin = offsets[one], size = offsets[one + 1] - begin;
    load(points.subspan(begin, size));
    run(params, out.subspan(begin, size), stop, {});
  };
  groups.run_together = [&](std::size_t first, std::size_t clouds) {
    Backend& backend = cloud.backend();
    const auto its = offsets.subspan(first, clouds + 1);
    const std::size_t begin = its.front(), size = its.back() - begin;
    if (staged_.points().size() < size) staged_ = backend.host_buffer(size);
    const std::span<Point> staged = staged_.points().first(size);
    copy(backend.sampling(), points.subspan(begin, size), staged);
    backend.many_clouds()->upload(staged, ends_of(its));
    run_stages_of_all(used, stop);
    backend.download(used.iterations - 1, staged, settings_of(used, {}).limits, {});
    backend.take_costs();
    copy(backend.sampling(), staged, out.subspan(begin, size));
  };
  run_groups(offsets, groups);
}

void Pipeline::State::run_many(const DevicePoints& points, DeviceStream stream, std::span<const std::uint64_t> offsets,
                               const Params& params, const DeviceOutput& out, const std::stop_token& stop) {
  check_params(params);
  check_clouds(offsets, points.count, out.count);
  device_memory();  // throws where there is none
  load({});
  const bool at_once = runs_together(params);
  const Params used = at_once ? resolve_params(params, {}, {}, 0) : params;
  std::vector<std::uint8_t> joins(offsets.size() - 1);
  if (at_once) joins = cloud.backend().many_clouds()->surely_have_no_origin(points, stream, ends_of(offsets));
  Groups groups;
  groups.may_join = [&](std::size_t one) { return joins[one] != 0; };
  groups.run_alone = [&](std::size_t one) {
    const std::size_t begin = offsets[one], size = offsets[one + 1] - begin;
    load(part_of(points, begin, size), stream);
    run(params, part_of(out, begin, size), stream, stop, {});
  };
  groups.run_together = [&](std::size_t first, std::size_t clouds) {
    const auto its = offsets.subspan(first, clouds + 1);
    const std::size_t begin = its.front(), size = its.back() - begin;
    cloud.backend().many_clouds()->upload(part_of(points, begin, size), stream, ends_of(its));
    run_stages_of_all(used, stop);
    device_memory().download(used.iterations - 1, part_of(out, begin, size), stream, settings_of(used, {}).limits, {});
    cloud.backend().take_costs();
  };
  run_groups(offsets, groups);
}

}  // namespace pointfair
