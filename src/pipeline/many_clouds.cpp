// SPDX-License-Identifier: Apache-2.0
// Many small clouds in one call: on a device that can, as many at once as it has room for, else one after the other.
#include "seam/many_clouds.hpp"

#include <algorithm>
#include <string>

#include "estimate/automatic.hpp"
#include "pipeline/run_state.hpp"

namespace pointfair {
namespace {

void check_offsets(std::span<const std::uint64_t> offsets, std::size_t points) {
  if (offsets.empty() || offsets.front() != 0 || offsets.back() != points)
    throw Error(ErrorKind::usage,
                "offsets must begin with 0 and end with the number of points, " + std::to_string(points));
  if (!std::is_sorted(offsets.begin(), offsets.end()))
    throw Error(ErrorKind::usage, "offsets must not decrease: cloud i has the points offsets[i] to offsets[i + 1]");
}

// How many clouds from the first on are computed together; 0: the first is too large for that.
std::size_t together(std::span<const std::uint64_t> offsets, const ManyClouds::Room& room) {
  std::size_t largest = 0, clouds = 0;
  for (; clouds + 1 < offsets.size() && clouds < room.clouds; ++clouds) {
    const std::size_t points = offsets[clouds + 1] - offsets[clouds];
    largest = std::max(largest, points);
    if (points > room.points_of_cloud || (clouds + 1) * largest > room.places) break;
  }
  return clouds;
}

}  // namespace

// Lists of every point serve clouds of any scale; what is estimated differs from cloud to cloud.
bool Pipeline::State::runs_together(const Params& params) {
  return cloud.backend().many_clouds() != nullptr && params.method == Method::bilateral && !sums_balls(params) &&
         !params.constraint && !needs_spacing(params) && !needs_noise(params) && !needs_diagonal(params);
}

void Pipeline::State::run_many(std::span<const Point> points, std::span<const std::uint64_t> offsets,
                               const Params& params, std::span<Point> out, const std::stop_token& stop) {
  check_params(params);
  check_offsets(offsets, points.size());
  if (out.size() != points.size())
    throw Error(ErrorKind::usage, "the output holds " + std::to_string(out.size()) + " points, the clouds " +
                                      std::to_string(points.size()));
  load({});
  const bool at_once = runs_together(params);
  const Params used = at_once ? resolve_params(params, {}, {}, 0) : params;
  for (std::size_t first = 0; first + 1 < offsets.size();) {
    const auto rest = offsets.subspan(first);
    const std::size_t clouds = at_once ? together(rest, cloud.backend().many_clouds()->room()) : 0;
    if (clouds > 0) {
      run_together(points, rest.first(clouds + 1), used, out, stop);
    } else {
      const std::size_t begin = rest[0], size = rest[1] - begin;
      load(points.subspan(begin, size));
      run(params, out.subspan(begin, size), stop, {});
    }
    first += std::max<std::size_t>(clouds, 1);
  }
  load({});
}

void Pipeline::State::run_together(std::span<const Point> points, std::span<const std::uint64_t> offsets,
                                   const Params& used, std::span<Point> out, const std::stop_token& stop) {
  const std::size_t begin = offsets.front(), size = offsets.back() - begin;
  std::vector<std::uint32_t> ends;
  for (const std::uint64_t offset : offsets.subspan(1)) ends.push_back(static_cast<std::uint32_t>(offset - begin));
  Backend& backend = cloud.backend();
  backend.many_clouds()->upload(points.subspan(begin, size), ends);
  const Settings settings = settings_of(used);
  for (int iteration = 0; iteration < used.iterations; ++iteration) {
    backend.build_index(iteration, std::nullopt, stop);
    backend.find_neighbors(iteration, settings.neighbors, stop);
    backend.estimate_normals(iteration, settings.normals, stop);
    backend.fair(iteration, settings.fairing, false, stop);
  }
  backend.download(used.iterations - 1, out.subspan(begin, size), settings.limits, {});
  backend.take_costs();
}

}  // namespace pointfair
