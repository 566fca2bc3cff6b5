// SPDX-License-Identifier: Apache-2.0
#include "pipeline/stage_settings.hpp"

#include "seam/rules.hpp"

namespace pointfair {
namespace {

// Degrees. With Offset::symmetric, neighbours whose normals differ by more hardly count. From 15 to 90 degrees results
// differ by less than a twentieth, so this is no parameter.
constexpr int kFacingAngle = 40;

int filter_rounds(NormalFilter filter) {
  if (filter == NormalFilter::on) return 2;
  return filter == NormalFilter::mollify ? 1 : 0;
}

// Moves along rays are longer than along normals, so limits of the whole way are wider, and each step has its own.
void set_sensor(const Params& p, const KnownSensor& sensor, Settings& s) {
  s.fairing.beam_width = float(sensor.beam_width);
  s.fairing.along_ray = p.along == Along::ray;
  if (s.fairing.along_ray || s.fairing.beam_width > 0) s.fairing.sensors = sensor.places;
  if (!s.fairing.along_ray) return;
  s.fairing.farthest = s.limits.farthest;
  s.limits.farthest *= point::kMostStretch;
  s.limits.outlier_distance *= point::kMostStretch;
}

}  // namespace

bool seeks_mixed_pixels(const Params& p) {
  return p.method == Method::bilateral && p.outliers != Outliers::off &&
         (sums_within_radius(p) || (p.k != 1 && !p.constraint && p.radius.is_automatic()));
}

std::optional<Position> one_sensor(const Settings& settings, const Position& origin) {
  if (!settings.fairing.sensors) return std::nullopt;
  const Point& place = settings.fairing.sensors->places.front();
  return Position{origin[0] + place.x, origin[1] + place.y, origin[2] + place.z};
}

Settings settings_of(const Resolved& used, const KnownSensor& given) {
  const Params& p = used.params;
  const bool takes_found = !given.places && sums_within_radius(p) && seeks_mixed_pixels(p);
  const KnownSensor& sensor = takes_found ? used.sensor : given;
  const FollowedNoise& followed = used.followed;
  Settings s;
  s.neighbors.k = follows_rings(p) ? kMaxNeighbors : p.k;
  s.neighbors.rings = follows_rings(p) ? p.rings : 0;
  s.neighbors.radius = p.radius.is_automatic() ? 0.0f : float(p.radius.value);
  s.neighbors.constraint = p.constraint;
  s.neighbors.reach = p.constraint ? float(p.rho.value + p.delta.value) : 0.0f;
  // the radius alone where one neighbour is enough
  s.neighbors.min_neighbors = sums_within_radius(p) && p.min_neighbors > 1 ? p.min_neighbors : 0;
  s.normals.filter_rounds = filter_rounds(p.normal_filter);
  s.normals.sigma = float(p.normal_sigma.value);
  s.normals.of_radius = p.normal_sigma.unit == Length::Unit::radius;
  s.normals.crease_angle = p.normal_filter == NormalFilter::on ? p.crease_angle : 0;
  if (sums_within_radius(p) && p.method == Method::bilateral) s.normals.flat_scale = float(p.flat_scale.value_or(1));
  s.neighbors.mesh_growth = p.connectivity == Connectivity::mesh ? s.normals.flat_scale : 1;
  s.fairing.method = p.method == Method::fleishman ? Method::bilateral : p.method;  // but for its normals and sigmas
  s.fairing.area_weight = p.area_weight;
  s.fairing.closeness_sigma = float(p.closeness_sigma.value);
  s.fairing.similarity_sigma = float(p.similarity_sigma.value);
  s.fairing.closeness_of_radius = p.closeness_sigma.unit == Length::Unit::radius;
  s.fairing.symmetric = p.offset == Offset::symmetric;
  s.fairing.turn_angle = s.fairing.symmetric ? kFacingAngle : 0;
  s.fairing.strength = followed.trusted > 0 ? 1 : float(p.relaxation.value_or(1));
  if (p.method == Method::implicit) {
    s.fairing.implicit_weights = p.implicit_weights;
    s.fairing.implicit_lambda = p.implicit_lambda.value_or(0);
  }
  if (p.outliers != Outliers::off) {
    s.fairing.outlier_distance = float(p.outlier_distance.value);
    if (sums_within_radius(p)) s.fairing.outlier_radius = float(p.outlier_radius.value);
  }
  s.fairing.pull_outliers = p.outliers == Outliers::move;
  if (p.outliers == Outliers::keep || p.outliers == Outliers::mark) {
    s.limits.farthest = float(p.displacement_limit.value);
    s.limits.outlier_distance = float(p.outlier_distance.value);
  }
  s.fairing.noise = followed.damage > 0 ? float(p.noise.value) : 0;
  s.fairing.damage = float(followed.damage);
  s.fairing.trusted = float(followed.trusted);
  if (sensor.places) set_sensor(p, sensor, s);
  s.neighbors.reach_levels = followed.reach_levels;
  s.neighbors.widest = float(followed.widest);
  if (!followed.levels) return s;
  s.neighbors.levels = s.limits.levels = followed.levels;
  s.neighbors.radius_follows = followed.radius;
  s.fairing.similarity_follows = followed.similarity;
  s.fairing.level_outlier_distance = s.limits.level_outlier_distance = float(followed.outlier_distance);
  s.limits.farthest_follows = followed.limit;
  s.fairing.farthest_follows = p.along == Along::ray && followed.limit;
  if (p.along == Along::ray) s.limits.level_outlier_distance *= point::kMostStretch;
  return s;
}

IndexOrder order_for(const Params& params) {
  return sums_within_radius(params) || params.method == Method::implicit ? IndexOrder::along_curve
                                                                         : IndexOrder::fastest;
}

Stage first_difference(const Settings& a, const Settings& b) {
  if (a.neighbors != b.neighbors) return Stage::neighbors;
  if (a.normals != b.normals) return Stage::normals;
  if (a.fairing != b.fairing) return Stage::fairing;
  return Stage::iterations;
}

}  // namespace pointfair
