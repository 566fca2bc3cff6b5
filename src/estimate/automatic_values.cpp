// SPDX-License-Identifier: Apache-2.0
#include "estimate/automatic_values.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimate/share_between.hpp"
#include "portable.hpp"

namespace pointfair {

using namespace constants;

namespace {
// In spacings.
double level_of(const Noise& noise, double spacing) { return spacing > 0 ? noise.sigma / spacing : 0; }
}  // namespace

MethodDefaults defaults_of(Method method) {
  MethodDefaults its;
  switch (method) {
    case Method::bilateral:
    case Method::learned:  // its stages are the bilateral ones
      its.filter = NormalFilter::on;
      its.fits_radius = true;
      break;
    case Method::laplacian:
      its.closeness_width = 0.4;
      break;
    case Method::taubin:
      its.relaxation_percent = 63;  // his lambda
      its.iterations = 8;
      break;
    case Method::hc_laplacian:
      its.closeness_width = 0.5;
      its.iterations = 6;
      break;
    case Method::mls:
      its.noise_radius = 3;
      its.closeness_width = 0.5;
      break;
    case Method::wiener:
      its.closeness_width = 0.4;
      its.similarity_width = 1;  // the noise itself
      its.least_similarity = 0;
      break;
    case Method::implicit:
      its.iterations = 1;
      break;
    case Method::fleishman:  // its sigmas are measured on the mesh
      break;
    case Method::jones:  // the same
      its.iterations = 1;
      break;
    case Method::mollified:
      its.closeness_width = 0.5;
      its.filter = NormalFilter::mollify;
      break;
  }
  return its;
}

double radius_factor(const Noise& noise, double spacing) {
  const double level = level_of(noise, spacing);
  if (!(level > 0) || noise.gap > 0) return 1;
  if (noise.depth_has_steps) return kDepthWidening;
  const double room = portable::pow(kRoominess, share_between(kRoomyNoise, level));
  return portable::pow(room * portable::pow(kConfinement, noise.confined), 1 - share_between(kUnseenNoise, level));
}

double automatic_flat_scale(const Noise& noise, double spacing) {
  const double share = share_between(kHarmlessNoise, level_of(noise, spacing));
  return double(std::lround(std::lerp(kFlatPercent[0], kFlatPercent[1], share))) / 100;
}

int automatic_k(const Noise& noise, double spacing) {
  const double wide = portable::hypot(kListRadius * noise.sigma, spacing * std::sqrt(kListPoints / std::numbers::pi));
  const double count = spacing > 0 ? std::numbers::pi * (wide / spacing) * (wide / spacing) : kListPoints;
  return int(std::min<double>(count, kMaxNeighbors));
}

int automatic_min_neighbors(const Noise& noise, double spacing) {
  if (!(noise.gap > 0 && spacing > 0))
    return noise.surface_points > kReachPoints ? noise.surface_points : kMinNeighbors;
  const double gap = noise.gap / spacing, count = std::numbers::pi * gap * gap;
  if (gap > kSeparableGap + kApartFromNoise * noise.sigma / spacing)  // the nearest points end before the other sheet
    return std::min(kMinNeighbors, int(kOneSheet * count));
  if (noise.gap > kQuietSheets * noise.sigma && noise.sheets < kMostlySheets) return kMinNeighbors;
  return std::clamp(int(kBothSheets * count), kMinNeighbors, kMaxMinNeighbors);
}

double automatic_relaxation(int whole_percent, int iterations, const Noise& noise, double spacing, bool by_share) {
  if (!(noise.sigma > 0)) return 0.01;
  const double ratio = kTrustedNoise * spacing / noise.sigma;
  const double smallness = 1 - share_between(kHarmlessNoise, noise.sigma / spacing);
  const double of_noise = by_share ? 1
                                   : std::max(1 / (1 + kShapeDamage * (kUnseenShape + noise.shape_to_noise)),
                                              1 - smallness * smallness * smallness * smallness);
  const double share = 1 - portable::pow(1 - of_noise, 1.0 / iterations);
  return double(std::max(1l, std::lround(whole_percent * share / (1 + ratio * ratio * ratio * ratio)))) / 100;
}

double automatic_lambda(const Noise& noise, double spacing) {
  const double lambda = kLambda * portable::pow(level_of(noise, spacing), kLambdaPower);
  return std::clamp(double(std::lround(lambda * 100)) / 100, 0.01, kMostLambda);
}

double share_damage(const Noise& noise, int iterations) {
  const double level = level_of(noise, noise.surface_spacing);
  return kDamage * iterations * (1 - share_between(kHarmlessNoise, level));
}

double farthest_move(const Noise& noise, double spacing, bool by_share) {
  if (by_share) return kFarthestMove;  // what moves far for its edge is held back by that
  const double level = spacing > 0 ? noise.sigma / spacing : kFarNoise[1];
  return std::lerp(kFarthestOfNoise[0], kFarthestOfNoise[1], share_between(kFarNoise, level));
}

}  // namespace pointfair
