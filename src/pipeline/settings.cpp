// SPDX-License-Identifier: Apache-2.0
#include "pipeline/settings.hpp"

#include <algorithm>
#include <cstdlib>

#include "estimate/automatic.hpp"

namespace pointfair {
namespace {

// Degrees. With Offset::symmetric, neighbours whose normals differ by more hardly count. From 15 to 90 degrees results
// differ by less than a twentieth, so this is no parameter.
constexpr int kFacingAngle = 40;

int filter_rounds(NormalFilter filter) {
  if (filter == NormalFilter::on) return 2;
  return filter == NormalFilter::mollify ? 1 : 0;
}

}  // namespace

Settings settings_of(const Params& p, const Params& asked, std::shared_ptr<const NoiseLevels> levels, double level) {
  Settings s;
  s.neighbors.k = p.k;
  s.neighbors.radius = p.radius.is_automatic() ? 0.0f : float(p.radius.value);
  s.neighbors.constraint = p.constraint;
  s.neighbors.reach = p.constraint ? float(p.rho.value + p.delta.value) : 0.0f;
  s.neighbors.widening = p.k == 0 ? p.min_neighbors : 0;
  s.normals.filter_rounds = filter_rounds(p.normal_filter);
  s.normals.sigma = float(p.normal_sigma.value);
  s.normals.of_radius = p.normal_sigma.unit == Length::Unit::radius;
  s.normals.filter_angle = p.normal_filter == NormalFilter::on ? p.crease_angle : 0;
  if (sums_balls(p) && p.method == Method::bilateral) s.normals.flat_radius = float(p.flat_scale.value_or(1));
  s.fairing.method = p.method;
  s.fairing.area_weight = p.area_weight;
  s.fairing.closeness_sigma = float(p.closeness_sigma.value);
  s.fairing.similarity_sigma = float(p.similarity_sigma.value);
  s.fairing.closeness_of_radius = p.closeness_sigma.unit == Length::Unit::radius;
  s.fairing.two_planes = p.offset == Offset::symmetric;
  s.fairing.facing_angle = s.fairing.two_planes ? kFacingAngle : 0;
  s.fairing.strength = float(p.relaxation.value_or(1));
  if (p.outliers != Outliers::off) {
    s.fairing.outlier_distance = float(p.outlier_distance.value);
    if (sums_balls(p)) s.fairing.outlier_radius = float(p.outlier_radius.value);
  }
  s.fairing.pull_outliers = p.outliers == Outliers::move;
  if (p.outliers == Outliers::keep || p.outliers == Outliers::mark) {
    s.limits.farthest = float(p.displacement_limit.value);
    s.limits.outlier_distance = std::max(s.limits.farthest, float(p.outlier_distance.value));
  }
  if (!follows_noise(asked)) return s;
  if (!asked.relaxation) {
    s.fairing.noise = float(p.noise.value);
    s.fairing.damage = (getenv("PF_C")?float(atof(getenv("PF_C"))):0.4f) * float(p.iterations) * float(shape_matters(level));
  }
  if (!levels || std::getenv("PF_FLAT")) return s;
  s.neighbors.levels = levels;
  s.neighbors.radius_follows = true;
  s.fairing.similarity_follows = asked.similarity_sigma.is_automatic();
  if (asked.outlier_distance.is_automatic()) s.fairing.level_outlier_distance = float(outlier_distance_of(p.noise.value));
  s.limits.levels = std::move(levels);
  s.limits.farthest_follows = asked.displacement_limit.is_automatic();
  s.limits.level_outlier_distance = s.fairing.level_outlier_distance;
  return s;
}

Stage first_difference(const Settings& a, const Settings& b) {
  if (a.neighbors != b.neighbors) return Stage::neighbors;
  if (a.normals != b.normals) return Stage::normals;
  if (a.fairing != b.fairing) return Stage::fairing;
  return Stage::iterations;
}

}  // namespace pointfair
