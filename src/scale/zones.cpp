// SPDX-License-Identifier: Apache-2.0
#include "scale/zones.hpp"

#include <algorithm>
#include <memory>
#include <numbers>
#include <type_traits>
#include <utility>

#include "portable.hpp"

namespace pointfair::scale {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr std::size_t kFewest = 64;         // points that show a spacing
constexpr double kAside = 0.01;             // of the points: as strays
constexpr double kCoarse = 1.0 / 128;       // of the spacing: noise is seldom less than three such steps
constexpr double kSurelyCoarse = 1.0 / 32;  // near scanners, whose files mostly do not tell, noise is about the spacing
constexpr double kTelling = 1.0 / 1024;     // of the spacing; finer steps of a file say nothing of the noise
constexpr double kFiner = 8;                // steps in zones, at least, than those that are too coarse
constexpr double kDense = 0.25;             // quantile of distances: where points are dense, steps matter most
constexpr std::size_t kNth = 4;

// Squared distance to the kNth nearest other place, `most` if it is farther; the places ascend along x.
double squared_reach(const std::vector<Position>& places, std::size_t at, double most) {
  std::array<double, kNth> nearest;
  nearest.fill(most);
  const auto offer = [&](const Position& p) {
    const Position d = difference(p, places[at]);
    if (d[0] * d[0] >= nearest.back()) return false;
    const double squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    if (squared < nearest.back()) {
      nearest.back() = squared;
      std::ranges::sort(nearest);
    }
    return true;
  };
  for (std::size_t i = at + 1; i < places.size() && offer(places[i]);) ++i;
  for (std::size_t i = at; i > 0 && offer(places[i - 1]);) --i;
  return nearest.back();
}

std::vector<Position> finite_of(std::vector<Position> places) {
  std::erase_if(places, [](const Position& p) { return !std::isfinite(p[0] + p[1] + p[2]); });
  return places;
}

// Of finite places, at least one.
double float_step_of(const std::vector<Position>& places, const Position& origin) {
  std::vector<double> far;
  for (const Position& p : places) {
    const Position d = difference(p, origin);
    far.push_back(std::max({std::abs(d[0]), std::abs(d[1]), std::abs(d[2])}));
  }
  const auto farthest = far.end() - 1 - std::ptrdiff_t(kAside * double(far.size()));
  std::nth_element(far.begin(), farthest, far.end());
  return portable::power_of_two_below(*farthest) * 0x1p-23;
}

// Of a surface that has `share` of its points among these: a disc to the kNth nearest holds so many. At least `most` if
// it is more: nothing is looked for beyond.
double spacing_of(std::vector<Position> places, double share, double most) {
  std::ranges::sort(places);
  places.erase(std::unique(places.begin(), places.end()), places.end());
  if (places.size() < kFewest) return kInfinite;
  const double farthest = most * most * double(kNth) / (std::numbers::pi * share) * 1.000001;
  std::vector<double> squared;
  for (std::size_t i = 0; i < places.size(); ++i) squared.push_back(squared_reach(places, i, farthest));
  const auto dense = squared.begin() + std::ptrdiff_t(kDense * double(squared.size()));
  std::nth_element(squared.begin(), dense, squared.end());
  return std::sqrt(std::numbers::pi * *dense / double(kNth) * share);
}

}  // namespace

Zone Zones::zone_of(const Position& p) const {
  Zone zone{};
  if (!are_several()) return zone;
  constexpr double kMost = 1 << 30;  // beyond, a zone has no end
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = std::floor(p[axis] / side);
    zone[axis] = static_cast<std::int32_t>(at > -kMost ? std::min(at, kMost) : -kMost);  // also of NaN
  }
  return zone;
}

Position Zones::middle_of(const Zone& zone) const {
  if (!are_several()) return origin;
  return {(zone[0] + 0.5) * side, (zone[1] + 0.5) * side, (zone[2] + 0.5) * side};
}

double coordinate_step(const Source& source) {
  if (source.encoding() == Encoding::ascii) return 0;  // its types are known once all of it was read
  return source.coordinate_type() == ScalarType::float32 ? kInfinite : source.info().step;
}

double float_step_around(std::vector<Position> sample, const Position& origin) {
  return float_step_of(finite_of(std::move(sample)), origin);
}

double zone_side(std::vector<Position> sample, std::uint64_t points, const Position& origin, double coordinate_step) {
  sample = finite_of(std::move(sample));
  if (sample.size() < kFewest) return 0;
  const double step = float_step_of(sample, origin);
  if (!(step > coordinate_step)) return 0;
  const double share = std::min(1.0, double(io::kSampledPositions) / double(points));
  const double spacing = spacing_of(std::move(sample), share, step / kCoarse);  // with more, the step is fine
  const double share_of_spacing = coordinate_step > kTelling * spacing ? kCoarse : kSurelyCoarse;
  const double coarse = std::max(coordinate_step, share_of_spacing * spacing);
  if (!(step > coarse)) return 0;
  return portable::power_of_two_below(0x1p25 / kFiner * coarse);
}

Zones zones_of(const Cloud& cloud) {
  if (!cloud.source) return {cloud.origin};
  const Source& source = *cloud.source;
  return {cloud.origin, zone_side(source.sample(), source.size(), cloud.origin, coordinate_step(source))};
}

CopyRule relative_to(const Position& origin, CopyRule rule, const Zones& zones) {
  if (origin == zones.origin) return rule;
  const auto half = float(zones.side / 2);
  return {rule.within, {-half, -half, -half}};
}

FramedSettings relative_to(const Position& origin, const FramedSettings& stages, const Zones& zones) {
  if (origin == zones.origin) return stages;
  const Position shift = difference(zones.origin, origin);
  const auto move = [&](auto levels) {
    using Levels = std::remove_const_t<typename decltype(levels)::element_type>;
    if (!levels) return levels;
    const auto moved = std::make_shared<Levels>(*levels);
    moved->first = shifted(moved->first, shift);
    return decltype(levels)(moved);
  };
  FramedSettings moved = stages;
  moved.copies = relative_to(origin, stages.copies, zones);
  moved.neighbors.levels = move(stages.neighbors.levels);
  moved.neighbors.reach_levels = move(stages.neighbors.reach_levels);
  if (const auto& sensors = stages.fairing.sensors) {
    auto places = sensors->places;
    for (Point& place : places) place = shifted(place, shift);
    moved.fairing.sensors = std::make_shared<const SensorPlaces>(SensorPlaces{std::move(places)});
  }
  if (stages.frame) {  // the curve runs through the zone, whatever the cloud's own frame is
    const auto half = float(zones.side / 2), reference = float(-0.3 * zones.side);
    moved.frame = Frame{{-half, -half, -half}, {reference, reference, reference}, float(zones.side)};
  }
  return moved;
}

}  // namespace pointfair::scale
