// SPDX-License-Identifier: Apache-2.0
// The noise at each point, as the pipeline tells it.
#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "pipeline/run_state.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/noise_levels.hpp"
#include "seam/sampling.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kBlock = 1 << 14;                              // points that one core takes at once
constexpr float kNoNoise = std::numeric_limits<float>::quiet_NaN();  // of invalid points

}  // namespace

void Pipeline::State::noise(std::span<float> out, const Length& typical, const std::stop_token& stop) {
  if (out.size() != cloud.points())
    throw Error(ErrorKind::usage, "noise: the output holds " + std::to_string(out.size()) +
                                      " values, the loaded cloud " + std::to_string(cloud.points()) + " points");
  Params params{.noise = typical};
  check_params(params);
  attempt([&] {
    std::vector<Point> points(out.size());
    cloud.backend().download_input(points);
    if (wide) {  // the levels are so coarse that points around one origin find theirs
      const double sigma = typical.is_automatic()
                               ? of_zones->noise.sigma
                               : pointfair::resolve(params, *of_zones, estimates->diagonal).params.noise.value;
      return tell_noise(points, sigma, of_zones->levels.get(), out);
    }
    measure({false, true}, IndexOrder::along_curve, stop);
    const double sigma = typical.is_automatic() ? noise().sigma : resolve_once(params, stop).params.noise.value;
    tell_noise(points, sigma, levels().get(), out);
  });
}

void Pipeline::State::tell_noise(std::span<const Point> points, double sigma, const NoiseLevels* levels,
                                 std::span<float> out) {
  const std::size_t blocks = (out.size() + kBlock - 1) / kBlock;
  cloud.backend().sampling().for_each_on_host(blocks, [&](std::size_t block) {
    for (std::size_t i = block * kBlock; i < std::min(out.size(), (block + 1) * kBlock); ++i)
      out[i] = is_indexed(points[i]) ? float(sigma) * noise_level_at(levels, points[i]) : kNoNoise;
  });
}

}  // namespace pointfair
