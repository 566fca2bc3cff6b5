// SPDX-License-Identifier: Apache-2.0
// The stages of a backend one after the other, all that comes of them, and where two clouds differ.
#pragma once

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "point/curve.h"
#include "point/node_field.h"
#include "seam/backend.hpp"
#include "seam/overlap.hpp"

namespace pointfair {

struct StageSettings {
  NeighborSettings neighbors{8, 0, false, 0};
  NormalSettings normals{{0.1f}};
  FairingSettings fairing{{0.1f, 0.05f}};
  int iterations = 1;
  DisplacementLimits limits{};
  std::optional<Frame> frame{};

  IndexOrder order() const { return frame ? IndexOrder::along_curve : IndexOrder::fastest; }
};

struct StageResults {
  std::vector<Point> points, normals;
  Counts counts;
  OutlierCounts held_back{};
  SolverReport solver{};
};

// `while_arriving`: stages are started before the upload has ended.
inline StageResults run(Backend& backend, const std::vector<Point>& points, const StageSettings& settings,
                        bool while_arriving = false) {
  if (while_arriving) {
    backend.overlap()->start_upload(points, settings.order());
  } else {
    backend.upload(points, settings.order());
  }
  for (int iteration = 0; iteration < settings.iterations; ++iteration) {
    backend.build_index(iteration, settings.frame, {});
    backend.find_neighbors(iteration, settings.neighbors, {});
    backend.estimate_normals(iteration, settings.normals, {});
    FairingSettings fairing = settings.fairing;
    fairing.is_further = iteration > 0;
    backend.fair(iteration, fairing, {});
  }
  const int last = settings.iterations - 1;
  StageResults result{std::vector<Point>(points.size()), std::vector<Point>(points.size()), {}, {}, {}};
  result.held_back = backend.download(last, result.points, settings.limits, {});
  if (while_arriving) backend.overlap()->finish_upload();
  backend.download_normals(last, result.normals, {});
  result.counts = backend.counts(last);
  result.solver = backend.solver_report(last);
  return result;
}

// Whose curve runs over the cube with this lower corner.
inline Frame frame_over(Point lower, float side) {
  const float shift = point::kBelowReference * side;
  return {lower, {lower.x + shift, lower.y + shift, lower.z + shift}, side};
}

// With levels of noise and of reach from a half to three over the cube with this lower corner, which all that can
// follows, and shares of noise so large.
inline void follow_noise(StageSettings& settings, Point lower, float side, float noise) {
  NoiseLevels levels;
  const int nodes = 32;
  for (int z = 0; z < nodes; ++z)
    for (int y = 0; y < nodes; ++y)
      for (int x = 0; x < nodes; ++x) levels.levels.push_back(0.5f + 0.1f * float((7 * x + 11 * y + 5 * z) % 26));
  levels.nodes = nodes;
  levels.first = lower;
  levels.nodes_per_unit = float(nodes - 1) / side;
  NodeLevels reach{levels.levels, nodes, lower, levels.nodes_per_unit};
  std::reverse(reach.levels.begin(), reach.levels.end());
  settings.neighbors.reach_levels = std::make_shared<const NodeLevels>(std::move(reach));
  settings.neighbors.widest = 2.5f * settings.neighbors.radius;
  settings.neighbors.levels = settings.limits.levels = std::make_shared<const NoiseLevels>(std::move(levels));
  settings.neighbors.radius_follows = settings.fairing.similarity_follows = settings.limits.farthest_follows = true;
  settings.fairing.level_outlier_distance = settings.limits.level_outlier_distance = 5 * noise;
  settings.fairing.noise = noise;
  settings.fairing.damage = 1.2f;
}

// Places where two clouds differ in a bit, the first of them in words.
inline std::string difference(const std::vector<Point>& a, const std::vector<Point>& b) {
  std::size_t count = 0, first = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (std::memcmp(&a[i], &b[i], sizeof(Point)) != 0 && count++ == 0) first = i;
  if (count == 0) return "";
  const Point p = a[first], q = b[first];
  char text[200];
  std::snprintf(text, sizeof text, "%zu of %zu differ, first %zu: %.9g %.9g %.9g and %.9g %.9g %.9g", count, a.size(),
                first, double(p.x), double(p.y), double(p.z), double(q.x), double(q.y), double(q.z));
  return text;
}

}  // namespace pointfair
