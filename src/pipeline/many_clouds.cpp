// SPDX-License-Identifier: Apache-2.0
// Many small clouds in one call: on a device that can, as many at once as it has room for, else one after the other.
#include "seam/many_clouds.hpp"

#include <algorithm>
#include <exception>
#include <limits>
#include <mutex>
#include <string>
#include <thread>

#include "estimate/automatic.hpp"
#include "pipeline/many_estimates.hpp"
#include "pipeline/run_state.hpp"
#include "seam/device_memory.hpp"

namespace pointfair {
namespace {

void check_clouds(std::span<const std::uint64_t> offsets, std::size_t points, std::size_t room) {
  if (offsets.empty() || offsets.front() != 0 || offsets.back() != points)
    throw Error(ErrorKind::usage,
                "offsets must begin with 0 and end with the number of points, " + std::to_string(points));
  if (!std::ranges::is_sorted(offsets))
    throw Error(ErrorKind::usage, "offsets must not decrease: cloud i has the points offsets[i] to offsets[i + 1]");
  if (room != points)
    throw Error(ErrorKind::usage,
                "the output holds " + std::to_string(room) + " points, the clouds " + std::to_string(points));
}

constexpr std::size_t kAny = std::numeric_limits<std::size_t>::max();
constexpr std::size_t kMeasuredAtOnce = 128;  // clouds; samples and levels of noise take 1 MB of each
constexpr std::size_t kWorkers = 6;

// Where clouds end, from the first of `offsets` on.
std::vector<std::uint32_t> ends_of(std::span<const std::uint64_t> offsets) {
  std::vector<std::uint32_t> ends;
  for (const std::uint64_t offset : offsets.subspan(1))
    ends.push_back(static_cast<std::uint32_t>(offset - offsets.front()));
  return ends;
}

std::span<Point> stage(Backend& backend, HostBuffer& buffer, std::size_t points) {
  if (buffer.points().size() < points) buffer = backend.host_buffer(points);
  return buffer.points().first(points);
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

// Whether lists are found and all lengths are given.
bool is_alike(const Params& params) {
  const Needed needed = needed_by(params);
  return !sums_within_radius(params) && !params.constraint && !needed.estimates.spacing && !needed.estimates.noise &&
         !needed.diagonal;
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

// With lists kernels take one rule for all clouds, so nothing may be estimated of each; within a radius every cloud has
// its own.
bool Pipeline::State::runs_together(const Params& params) {
  return cloud.backend().many_clouds() != nullptr && params.method == Method::bilateral &&
         params.along == Along::normal && !needs_whole_cloud(params) && (may_differ(params) || is_alike(params));
}

// As many at once as one upload takes, but `at_once` clouds at most.
std::vector<Pipeline::State::Group> Pipeline::State::group(std::span<const std::uint64_t> offsets, std::size_t at_once,
                                                           const std::function<bool(std::size_t)>& may_join) {
  const ManyClouds* const many = cloud.backend().many_clouds();
  const ManyClouds::Room room = many != nullptr ? many->room() : ManyClouds::Room{};
  const std::size_t all = offsets.size() - 1, most = std::min(room.clouds, at_once);
  std::vector<Group> groups;
  for (std::size_t first = 0; first < all; first = groups.back().end) {
    std::size_t largest = 0, end = first;
    for (; end < all && end - first < most && may_join(end); ++end) {
      const std::size_t points = offsets[end + 1] - offsets[end];
      largest = std::max(largest, points);
      if (points > room.points_of_cloud || (end + 1 - first) * largest > room.places) break;
    }
    groups.push_back({first, std::max(end, first + 1), end > first});
  }
  return groups;
}

// Those that are computed together by several workers, of which one measures while another computes; then the others.
// Afterwards the pipeline is empty.
void Pipeline::State::run_groups(const std::vector<Group>& groups, std::size_t workers, const RunTogether& run_together,
                                 const RunAlone& run_alone) {
  std::vector<std::size_t> left_over;
  std::vector<const Group*> together;
  for (const Group& group : groups)
    if (group.together) together.push_back(&group);
  while (helpers_.size() + 1 < std::min(workers, together.size())) {
    std::unique_ptr<Backend> backend = cloud.make_worker();
    if (!backend) break;
    helpers_.push_back({std::move(backend), {}});
  }
  const std::size_t helping = std::min({helpers_.size(), workers - 1, std::max<std::size_t>(together.size(), 1) - 1});
  std::mutex mutex;
  std::size_t next = 0;
  std::exception_ptr error;
  const auto work = [&](Backend& backend, HostBuffer& staged) {
    std::unique_lock lock(mutex);
    while (next < together.size() && !error) {
      const Group& group = *together[next++];
      lock.unlock();
      std::vector<std::size_t> left;
      std::exception_ptr its_error;
      try {
        left = run_together(backend, staged, group);
      } catch (...) {
        its_error = std::current_exception();
      }
      lock.lock();
      left_over.insert(left_over.end(), left.begin(), left.end());
      if (its_error && !error) error = its_error;
    }
  };
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < helping; ++i)
      threads.emplace_back([&work, &helper = helpers_[i]] { work(*helper.backend, helper.staged); });
    work(cloud.backend(), staged_);
  }
  if (error) {
    helpers_.clear();
    std::rethrow_exception(error);
  }
  try {
    for (const std::size_t one : left_over) run_alone(one, true);
    for (const Group& group : groups)
      if (!group.together) run_alone(group.first, false);
  } catch (...) {
    try {
      load({});
    } catch (const Error&) {  // a lost card: what is told is what came first
    }
    throw;
  }
  load({});
}

void Pipeline::State::run_stages_of_all(Backend& backend, const Params& used, const std::stop_token& stop) {
  FramedSettings settings{settings_of({used, {}}), {}};
  for (int iteration = 0; iteration < used.iterations; ++iteration) {
    settings.fairing.is_further = iteration > 0;
    run_stages(backend, iteration, settings, stop);
  }
}

void Pipeline::State::run_many(std::span<const Point> points, std::span<const std::uint64_t> offsets,
                               const Params& params, std::span<Point> out, const std::stop_token& stop) {
  check_params(params);
  check_clouds(offsets, points.size(), out.size());
  load({});
  const bool at_once = runs_together(params), alike = is_alike(params);
  const Params used = at_once && alike ? pointfair::resolve(params, {}, 0).params : params;
  const auto run_together = [&](Backend& backend, HostBuffer& buffer, const Group& group) {
    ManyClouds& many = *backend.many_clouds();
    const auto its = offsets.subspan(group.first, group.end - group.first + 1);
    const std::size_t begin = its.front(), size = its.back() - begin;
    const std::vector<std::uint32_t> ends = ends_of(its);
    const std::span<Point> staged = stage(backend, buffer, size);
    copy(backend.sampling(), points.subspan(begin, size), staged);
    many.upload(staged, ends);
    std::vector<std::size_t> alone;
    if (alike) {
      run_stages_of_all(backend, used, stop);
      backend.download(used.iterations - 1, staged, settings_of({used, {}}).limits, {});
    } else {
      for (const std::uint32_t one : run_by_estimates(backend, staged, ends, params, stop))
        alone.push_back(group.first + one);
      many.download(staged);
    }
    backend.take_costs();
    copy(backend.sampling(), staged, out.subspan(begin, size));
    return alone;
  };
  const auto groups = group(offsets, alike ? kAny : kMeasuredAtOnce, [&](std::size_t) { return at_once; });
  run_groups(groups, alike ? 1 : kWorkers, run_together, [&](std::size_t one, bool is_there) {
    const std::size_t begin = offsets[one], size = offsets[one + 1] - begin;
    load(is_there ? out.subspan(begin, size) : points.subspan(begin, size));
    run(params, out.subspan(begin, size), stop, {});
  });
}

void Pipeline::State::run_many(const DevicePoints& points, DeviceStream stream, std::span<const std::uint64_t> offsets,
                               const Params& params, const DeviceOutput& out, const std::stop_token& stop) {
  check_params(params);
  check_clouds(offsets, points.count, out.count);
  device_memory();  // throws where there is none
  load({});
  const bool at_once = runs_together(params), alike = is_alike(params);
  const Params used = at_once && alike ? pointfair::resolve(params, {}, 0).params : params;
  std::vector<std::uint8_t> joins(offsets.size() - 1);
  if (at_once) joins = cloud.backend().many_clouds()->surely_have_no_origin(points, stream, ends_of(offsets));
  const auto run_together = [&](Backend& backend, HostBuffer& buffer, const Group& group) {
    ManyClouds& many = *backend.many_clouds();
    const auto its = offsets.subspan(group.first, group.end - group.first + 1);
    const std::size_t begin = its.front(), size = its.back() - begin;
    const std::vector<std::uint32_t> ends = ends_of(its);
    const DeviceOutput to = part_of(out, begin, size);
    many.upload(part_of(points, begin, size), stream, ends);
    std::vector<std::size_t> alone;
    if (alike) {
      run_stages_of_all(backend, used, stop);
      backend.device_memory()->download(used.iterations - 1, to, stream, settings_of({used, {}}).limits, {});
    } else {
      const std::span<Point> staged = stage(backend, buffer, size);
      backend.download_input(staged);
      for (const std::uint32_t one : run_by_estimates(backend, staged, ends, params, stop))
        alone.push_back(group.first + one);
      many.download(to, stream);
    }
    backend.take_costs();
    return alone;
  };
  const auto groups = group(offsets, alike ? kAny : kMeasuredAtOnce, [&](std::size_t one) { return joins[one] != 0; });
  run_groups(groups, alike ? 1 : kWorkers, run_together, [&](std::size_t one, bool is_there) {
    const std::size_t begin = offsets[one], size = offsets[one + 1] - begin;
    const DeviceOutput to = part_of(out, begin, size);
    load(is_there ? DevicePoints{to.data, to.count, to.row_stride, to.column_stride, to.type, to.card}
                  : part_of(points, begin, size),
         stream);
    run(params, to, stream, stop, {});
  });
}

}  // namespace pointfair
