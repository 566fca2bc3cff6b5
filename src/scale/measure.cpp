// SPDX-License-Identifier: Apache-2.0
#include "scale/measure.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <type_traits>
#include <utility>

#include "estimate/automatic.hpp"
#include "estimate/sensor.hpp"
#include "scale/candidates.hpp"
#include "scale/kept_leaves.hpp"
#include "seam/cloud_sample.hpp"
#include "tiles/choice.hpp"
#include "tiles/exact_rows.hpp"
#include "tiles/halo.hpp"

namespace pointfair::scale {
namespace {

// The calls of Sampling over stored points: the sample by passing over all of them, and what lies around its points by
// loading the regions around them.
class StoredSampling final : public Sampling, private PointStore {
 public:
  StoredSampling(const StoredCloud& cloud, const Plan& plan, Backend& backend)
      : cloud_(cloud),
        backend_(backend),
        bytes_of_point_(bytes_of_tile_point(plan.params)),
        most_(points_of_tile(plan.memory, plan.params)),
        leaves_(cloud, most_ * bytes_of_point_ / 2 / sizeof(Point)) {}

  CloudSample sample_cloud(std::size_t count) override {
    const Bounds& bounds = cloud_.bounds();
    CandidatesAhead candidates(
        bounds, [this](const auto& visit) { leaves_.for_all(visit); }, on_host());
    CloudSample sample = draw_sample(bounds, count, [&](Candidates wanted) { return candidates.collect(wanted); });
    for (std::size_t i = 0; i < sample.indices.size(); ++i) sample.indices[i] = std::uint32_t(i);
    queries_.clear();
    for (const Point& p : sample.points) queries_.push_back({p, cloud_.zones().origin});
    if (cloud_.zones().are_several()) find_in_zones();
    return sample;
  }

  // From now on rows have no copies by this rule.
  void set_aside(const CopyRule& rule) { copies_ = rule; }
  // The sample where each place counts once.
  CloudSample once_each(const CloudSample& sample, double times) {
    std::vector<Point> places = sample.points;
    if (!cloud_.zones().are_several()) {  // else places are relative to the cloud's origin, and rows are not
      std::vector<Point> rows(2 * places.size());
      sample_neighborhoods(sample.indices, 1, rows);
      for (std::size_t i = 0; i < places.size(); ++i) places[i] = rows[2 * i];
    }
    return pointfair::once_each(sample, sample.indices, places, times);
  }

  // Queries are indices in the sample.
  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    std::ranges::fill(out, Point{kNan, kNan, kNan});
    std::map<Position, std::vector<std::size_t>> of_origin;
    std::vector<Point> places;
    for (std::size_t q = 0; q < queries.size(); ++q) {
      of_origin[queries_[queries[q]].origin].push_back(q);
      places.push_back(queries_[queries[q]].place);
    }
    ExactRows rows{k, places, out, [&](const TileWorker& worker, std::size_t q) {
                     return std::uint32_t(
                         std::ranges::find_if(worker.points, [&](const Point& p) { return same_place(p, places[q]); }) -
                         worker.points.begin());
                   }};
    TileWorker worker(backend_);
    for (const auto& [origin, around] : of_origin) {
      rows.copies = relative_to(origin, copies_, cloud_.zones());
      const StoredCloud seen = cloud_.seen_from(origin);
      seen_ = &seen;
      std::map<std::size_t, std::vector<std::size_t>> of_leaf;
      for (const std::size_t q : around) of_leaf[leaf_near(places[q])].push_back(q);
      for (auto& [leaf, asked] : of_leaf)
        rows.fill(*this, worker, std::move(asked), reach_of_nearest(seen.bounds(), k, seen.leaves()[leaf]));
    }
    loaded_ = {};
  }
  void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) override {
    backend_.sampling().for_each_on_host(count, body);
  }

 private:
  // A point of the sample.
  struct Query {
    Point place;
    Position origin;
  };

  // The sample was drawn by places around the cloud's origin, to which far points are rounded: of those that share a
  // place, the first by zone and coordinates stands for it.
  void find_in_zones() {
    const auto less = [](const Point& a, const Point& b) { return point::lies_before(to_vec3(a), to_vec3(b)); };
    std::map<Point, std::size_t, decltype(less)> places(less);
    for (std::size_t i = 0; i < queries_.size(); ++i) places.emplace(queries_[i].place, i);
    constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
    std::vector<std::pair<std::uint32_t, Point>> found(queries_.size(), {kNone, {}});  // their leaves, and as stored
    const auto comes_before = [&](std::uint32_t leaf, const Point& p, const std::pair<std::uint32_t, Point>& other) {
      if (other.first == kNone || cloud_.zone_of(leaf) != cloud_.zone_of(other.first))
        return other.first == kNone || cloud_.zone_of(leaf) < cloud_.zone_of(other.first);
      return less(p, other.second);
    };
    std::vector<Point> around_origin;
    for (std::uint32_t leaf = 0; leaf < cloud_.leaves().size(); ++leaf) {
      const Bounds& box = cloud_.leaves()[leaf];
      if (std::ranges::none_of(places, [&](const auto& place) {
            return may_overlap({to_vec3(place.first), to_vec3(place.first)}, box);
          }))
        continue;
      const std::span<const Point> stored = leaves_.leaf(leaf);
      around_origin.assign(stored.begin(), stored.end());
      cloud_.bring(leaf, around_origin);
      for (std::size_t i = 0; i < stored.size(); ++i) {
        if (!is_indexed(around_origin[i])) continue;
        const auto its = places.find(around_origin[i]);
        if (its == places.end()) continue;
        auto& first = found[its->second];
        if (comes_before(leaf, stored[i], first)) first = {leaf, stored[i]};
      }
    }
    for (std::size_t i = 0; i < queries_.size(); ++i) {
      const auto& [leaf, place] = found[i];
      const Position& origin = cloud_.origin_for(leaf);
      const Position shift = difference(cloud_.zones().middle_of(cloud_.zone_of(leaf)), origin);
      queries_[i] = {shift == Position{} ? place : shifted(place, shift), origin};
    }
  }

  // One whose box holds the point.
  std::size_t leaf_near(const Point& p) const {
    const point::Region here{to_vec3(p), to_vec3(p)};
    std::size_t leaf = 0;
    while (!may_overlap(here, seen_->leaves()[leaf])) ++leaf;
    return leaf;
  }

  const Bounds& bounds() const override { return seen_->bounds(); }
  // Leaves that are kept make room where the region needs it.
  bool load(const point::Region& region, TileWorker& worker) override {
    const std::uint64_t kept = leaves_.kept() * sizeof(Point) / bytes_of_point_;
    bool fits = leaves_.load(*seen_, region, most_ - std::min(most_, kept), loaded_);
    if (!fits) {
      loaded_ = {};
      fits = seen_->append(region, {}, most_, loaded_, worker.known_copies);
    }
    worker.points = loaded_;
    return fits;
  }
  double load_nearest(const Point& to, TileWorker& worker) override {
    loaded_.clear();
    const double known =
        seen_->append_nearest(to, most_ / 2, loaded_, worker.known_copies);  // beside the leaves that are kept
    worker.points = loaded_;
    return known;
  }
  Error does_not_fit(std::size_t) const override {
    return {ErrorKind::memory,
            "what lies around a point that the noise is measured at does not fit into --memory; give more"};
  }

  const StoredCloud& cloud_;
  Backend& backend_;
  std::uint64_t bytes_of_point_, most_;  // points that are loaded at once
  KeptLeaves leaves_;
  std::vector<Query> queries_;
  CopyRule copies_{};
  std::vector<Point> loaded_;
  const StoredCloud* seen_ = nullptr;  // from the origin that is sampled around
};

// Relative to the cloud's origin; null: unknown.
std::shared_ptr<const SensorPlaces> sensor_of(const Plan& plan) {
  if (!plan.sensor) return nullptr;
  return std::make_shared<const SensorPlaces>(SensorPlaces{{offset(*plan.sensor, plan.zones.origin)}});
}

}  // namespace

Measured measure(const StoredCloud& cloud, const Plan& plan, const std::optional<GivenNoise>& given, Backend& backend,
                 const std::stop_token& stop) {
  Measured measured{plan.zones.origin, cloud.bounds(), {}, {}, {}, cloud.ignored()};
  WantedEstimates wanted = needed_by(plan.params).estimates;
  Estimate& its = measured.estimate;
  its.sensor.places = sensor_of(plan);
  const bool may_seek = plan.sensor && plan.params.outliers != Outliers::off;
  if (!wanted.spacing && !wanted.noise && !sums_within_radius(plan.params) && !may_seek) return measured;
  StoredSampling sampling(cloud, plan, backend);
  CloudSample sample = sampling.sample_cloud(kSampledPoints);
  const Frame frame = frame_of(sample);
  if (sums_within_radius(plan.params)) measured.frame = frame;
  Estimate found = estimate(sampling, sample, wanted, stop);
  if (const CopiesFound copies = found.copies; copies.within >= 0) {
    measured.copies = {copies.within, frame.corner};
    sampling.set_aside(measured.copies);
    const CloudSample once = sampling.once_each(sample, copies.points);
    wanted.seeks_copies = false;
    found = estimate(sampling, once, wanted, stop);
    if (!share_an_error(copies, found.noise)) {
      measured.copies = {};
      sampling.set_aside({});
      found = estimate(sampling, sample, wanted, stop);
    } else {
      sample = once;
    }
  }
  if (wanted.spacing) its.spacing = found.spacing;
  if (wanted.noise) {
    its.noise = given ? with_given(found.noise, *given) : found.noise;
    its.levels = given ? given->levels : found.levels;
    its.reach_levels = found.reach_levels;
    if (plan.seeks_sensor) its.sensor = found.sensor;
  }
  if (may_seek && seeks_mixed_pixels(resolve(plan, measured).params))
    its.sensor.beam_width = beam_width(beam_samples(sampling, sample, *its.sensor.places));
  return measured;
}

namespace {

// Calls visit(number) for all that is measured but the levels themselves, whose files have the numbers in this order,
// as doubles, then the levels of the noise and those of the reach.
template <class Visit>
void visit_numbers(Measured& m, NoiseLevels& levels, NodeLevels& reach_levels, Point& sensor, const Visit& visit) {
  auto& [sigma, surface_spacing, shape_to_noise, gap, sheets, depth_has_steps, confined, surface_points, repeats,
         is_shared, without_surface, is_of_lines, coordinate_step] = m.estimate.noise;
  const auto visit_all = [&](auto&... numbers) { (visit(numbers), ...); };
  visit_all(m.origin[0], m.origin[1], m.origin[2], m.bounds.valid, m.frame.side, m.estimate.spacing.mean,
            m.estimate.spacing.rho, sigma, surface_spacing, shape_to_noise, gap, sheets, depth_has_steps, confined,
            surface_points, repeats, is_shared, without_surface, is_of_lines, coordinate_step, m.ignored,
            m.estimate.sensor.beam_width, m.copies.within);
  for (Point* p : {&m.bounds.min, &m.bounds.max, &m.frame.corner, &m.copies.corner, &m.frame.reference, &levels.first,
                   &reach_levels.first, &sensor})
    visit_all(p->x, p->y, p->z);
  for (double& quantile : levels.quantiles) visit(quantile);
  for (NodeLevels* its : {static_cast<NodeLevels*>(&levels), &reach_levels}) visit_all(its->nodes, its->nodes_per_unit);
}

}  // namespace

void save(const Measured& measured, const std::filesystem::path& path) {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  Measured m = measured;
  const Estimate& its = measured.estimate;
  NoiseLevels levels = its.levels ? *its.levels : NoiseLevels{};
  NodeLevels reach_levels = its.reach_levels ? *its.reach_levels : NodeLevels{};
  Point sensor = its.sensor.places ? its.sensor.places->places.front() : Point{kNaN, kNaN, kNaN};
  std::vector<double> numbers;
  visit_numbers(m, levels, reach_levels, sensor, [&](const auto& number) { numbers.push_back(double(number)); });
  NewFile file(path,
               numbers.size() * sizeof(double) + (levels.levels.size() + reach_levels.levels.size()) * sizeof(float));
  file.write(std::span(numbers));
  file.write(std::span(levels.levels));
  file.write(std::span(reach_levels.levels));
  file.finish();
}

Measured load_measured(const std::filesystem::path& path) {
  const StoredFile file(path);
  std::uint64_t at = 0;
  const auto read = [&]<class T>(std::span<T> values) {
    file.read(at, values);
    at += values.size_bytes();
  };
  Measured m;
  NoiseLevels levels;
  NodeLevels reach_levels;
  Point sensor;
  visit_numbers(m, levels, reach_levels, sensor, [&](auto& number) {
    double value = 0;
    read(std::span(&value, 1));
    number = static_cast<std::remove_reference_t<decltype(number)>>(value);
  });
  for (NodeLevels* its : {static_cast<NodeLevels*>(&levels), &reach_levels}) {
    its->levels.resize(std::size_t(its->nodes) * std::size_t(its->nodes) * std::size_t(its->nodes));
    read(std::span(its->levels));
  }
  if (levels.nodes > 0) m.estimate.levels = std::make_shared<NoiseLevels>(std::move(levels));
  if (is_indexed(sensor)) m.estimate.sensor.places = std::make_shared<const SensorPlaces>(SensorPlaces{{sensor}});
  if (reach_levels.nodes > 0) m.estimate.reach_levels = std::make_shared<NodeLevels>(std::move(reach_levels));
  return m;
}

RunSettings resolve(const Plan& plan, const Measured& measured) {
  Estimate found = measured.estimate;
  const KnownSensor given = plan.sensor ? std::exchange(found.sensor, {}) : KnownSensor{};
  const Resolved used = pointfair::resolve(plan.params, std::move(found), diagonal_of(measured.bounds));
  return {used.params, settings_of(used, given), used.followed.without_surface};
}

}  // namespace pointfair::scale
