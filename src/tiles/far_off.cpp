// SPDX-License-Identifier: Apache-2.0
#include "tiles/far_off.hpp"

#include <algorithm>
#include <cmath>

#include "point/outliers.h"
#include "seam/exactness.hpp"
#include "seam/noise_levels.hpp"

namespace pointfair {
namespace {

constexpr double kSurely = 1 + 1e-5;  // of squares of lengths, which backends round to floats

// Whether the radius of a point ends within what is known, and none of its neighbours is so near that their plane could
// make it one of a surface (point/outliers.h).
bool lacks_near_ones(const TileWorker& worker, std::size_t index, const FramedSettings& stages, double known) {
  const NeighborSettings& n = stages.neighbors;
  const FairingSettings& f = stages.fairing;
  const Point& place = worker.points[index];
  const std::uint32_t itself = first_of(worker.copies, std::uint32_t(index));
  std::vector<double> squared;
  for (std::uint32_t i = 0; i < worker.points.size(); ++i)
    if (i != itself && first_of(worker.copies, i) == i)
      squared.push_back(point::squared_length(point::offset_between(place, worker.points[i])));
  if (n.k > 0 || n.min_neighbors == 0 || squared.size() < std::size_t(n.min_neighbors)) return false;
  const auto last = squared.begin() + n.min_neighbors - 1;
  std::nth_element(squared.begin(), last, squared.end());
  const double nearest = *std::min_element(squared.begin(), last + 1), level = noise_level_at(n.levels.get(), place),
               base = level * n.radius, off = std::max(double(f.outlier_distance), level * f.level_outlier_distance),
               wide = std::isfinite(n.widest) ? n.widest : 0,
               widest = kSurely * (std::max(*last, wide * wide) + base * base);
  return widest < known * known && nearest > kSurely * std::max(point::kNearSquaredRadius * widest, off * off);
}

}  // namespace

std::optional<Isolated> isolated_at(const Point& place, PointStore& store, const FramedSettings& stages,
                                    TileWorker& worker, const std::stop_token& stop) {
  const auto& sensors = stages.fairing.sensors;
  if (sensors && sensors->places.size() > 1) return std::nullopt;  // which place is whose is told by numbers
  const double known = store.load_nearest(place, worker) - reach_of_decision(stages.copies);
  const auto at = std::ranges::find_if(worker.points, [&](const Point& p) { return same_place(p, place); });
  if (!(known > 0) || at == worker.points.end()) return std::nullopt;
  const auto index = std::size_t(at - worker.points.begin());
  worker.loaded = kEverywhere;
  worker.upload(stages.frame ? IndexOrder::along_curve : IndexOrder::fastest, stages.copies);
  if (!lacks_near_ones(worker, index, stages, known)) return std::nullopt;
  Backend& backend = *worker.backend;
  run_stages(backend, 0, stages, stop);
  worker.outcomes.resize(worker.points.size());
  backend.exactness()->outcomes(kEverywhere, worker.outcomes);
  const unsigned char outcome = worker.outcomes[index];
  backend.download(0, worker.results, {}, {});
  worker.note_costs();
  const Point result = worker.results[index];
  const bool is_isolated = std::isnan(result.x) && point::outlier_at(result.x) == point::Outlier::isolated;
  if (!is_isolated && (outcome & (point::kTooFew | point::kNoNormal)) == 0) return std::nullopt;
  return Isolated{result, outcome};
}

}  // namespace pointfair
