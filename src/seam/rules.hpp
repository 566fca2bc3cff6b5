// SPDX-License-Identifier: Apache-2.0
// What the bodies of the stages (src/point) read, from the settings of a run; the same for every backend.
#pragma once

#include <algorithm>
#include <span>

#include "point/graph.h"
#include "point/method.h"
#include "point/stages.h"
#include "pointfair/report.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// The square of a radius. It stays finite, since an infinite one marks places that hold no point.
inline float squared_base(float radius) { return std::min(radius * radius, 1e37f); }

inline float squared_widest(const NeighborSettings& neighbors) { return neighbors.widest * neighbors.widest; }

// The power of the mean distance in W_a.
inline int area_power(AreaWeight area_weight) {
  return area_weight == AreaWeight::squared ? 2 : area_weight == AreaWeight::length ? 1 : 0;
}

// Whether the radii of flat places grow for the bilateral step.
inline bool radii_grow(const NeighborSettings& neighbors, const NormalSettings& normals) {
  return neighbors.k == 0 && normals.filter_rounds > 0 && normals.flat_scale > 1;
}

// Whether the step of a point reads the normals of its neighbours, or their radii, which are exact where normals are.
inline bool reads_normals_of_neighbors(const FairingSettings& settings) {
  return settings.symmetric || settings.method != Method::bilateral || settings.pull_outliers;
}

// A view of the places, which must outlive it. Null: the places are unknown and not read.
inline point::Sensors sensors_of(const SensorPlaces* sensors) {
  if (sensors == nullptr || sensors->places.empty()) return {};
  const Point& first = sensors->places.front();
  return {{first.x, first.y, first.z}, sensors->places.size() > 1 ? &first.x : nullptr};
}

// settings.method is not Method::bilateral.
inline point::MethodRule method_rule(const FairingSettings& settings) {
  using point::Adjustment, point::Displacement;
  point::MethodRule rule;
  rule.strength = settings.strength;
  rule.settings = settings;
  switch (settings.method) {
    case Method::bilateral:
    case Method::learned:    // its stages are those of the method bilateral
    case Method::implicit:   // solves for all points at once (point/graph.h)
    case Method::jones:      // looks at faces (cpu/facets.h)
    case Method::fleishman:  // its stages are those of the method bilateral
    case Method::laplacian:
      break;
    case Method::taubin:
      rule.adjustment = Adjustment::relaxation;
      rule.relaxation = point::taubin_relaxation(settings.strength);
      break;
    case Method::hc_laplacian:
      rule.adjustment = Adjustment::relaxation;
      rule.relaxation = point::hc_relaxation();
      break;
    case Method::mls:
      rule.displacement = Displacement::to_quadric;
      break;
    case Method::wiener:
      rule.displacement = Displacement::to_plane;
      rule.adjustment = Adjustment::wiener;
      rule.strength = 1.0f;  // whole heights tell shape from noise
      rule.relaxation.own = settings.strength;
      break;
    case Method::mollified:
      rule.displacement = Displacement::to_planes;
      break;
  }
  return rule;
}

// What the edges of Method::implicit count for where they are weighed by length, of which `mean_length` is the mean.
inline point::EdgeRule edge_rule(const FairingSettings& settings, double mean_length) {
  const double sigma = settings.closeness_sigma;
  return {settings.implicit_weights == ImplicitWeights::scale,
          settings.implicit_weights == ImplicitWeights::curvature ? 1 / (2 * sigma * sigma) : 0,
          point::kLeastLength * mean_length};
}
// The unit of their lambda.
inline double lambda_unit(const FairingSettings& settings, double mean_length) {
  return settings.implicit_weights == ImplicitWeights::scale ? point::kUnitOfScale * mean_length * mean_length : 1;
}

// Of all iterations up to one, of those of each.
inline SolverReport sum_of(std::span<const SolverReport> iterations, int last) {
  SolverReport all;
  for (const SolverReport& one : iterations.first(std::size_t(last) + 1)) {
    all.iterations += one.iterations;
    all.residual = std::max(all.residual, one.residual);
  }
  return all;
}

}  // namespace pointfair
