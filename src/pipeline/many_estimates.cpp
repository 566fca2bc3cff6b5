// SPDX-License-Identifier: Apache-2.0
#include "pipeline/many_estimates.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "estimate/automatic.hpp"
#include "pipeline/stage_settings.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/many_clouds.hpp"
#include "seam/stop.hpp"

namespace pointfair {
namespace {

void one_after_the_other(std::size_t count, const std::function<void(std::size_t)>& body) {
  for (std::size_t i = 0; i < count; ++i) body(i);
}

struct OneCloud {
  std::uint32_t first = 0, end = 0;  // of its points in upload order
  CloudSample sample;
  std::size_t spacing_at = 0, spacings = 0, noise_at = 0, noises = 0;  // its queries among those of all
  FramedSettings settings;
  int iterations = 1;
  bool is_alone = false;
};

// The samples of one cloud, taken before with those of others.
class SamplesTaken final : public Sampling {
 public:
  SamplesTaken(const ManyClouds::Taken& all, const OneCloud& cloud)
      : spacing_(all.spacing.subspan(cloud.spacing_at, cloud.spacings)),
        noise_(all.noise.subspan(cloud.noise_at, cloud.noises)),
        residuals_(all.residuals.subspan(cloud.noise_at, cloud.noises)),
        heads_(all.heads.subspan(cloud.noise_at * point::kHeadRow, cloud.noises * point::kHeadRow)) {
    if (!all.pools.empty()) pools_ = all.pools.subspan(cloud.noise_at * point::kPool, cloud.noises * point::kPool);
  }

  // Whether more was asked for than was taken: what was made of it is of no use.
  bool lacks_something() const { return lacks_something_; }

  CloudSample sample_cloud(std::size_t) override { return {}; }
  Samples take_samples(std::span<const std::uint32_t>, std::span<const std::uint32_t>, std::stop_token) override {
    return {{spacing_.begin(), spacing_.end()},
            {noise_.begin(), noise_.end()},
            [this] { return std::vector<point::ResidualSample>(residuals_.begin(), residuals_.end()); },
            {pools_.begin(), pools_.end()},
            {{heads_.begin(), heads_.end()}, point::kHeadRow - 1}};
  }
  void sample_neighborhoods(std::span<const std::uint32_t>, int, std::span<Point> out) override {
    constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
    std::ranges::fill(out, Point{kNaN, kNaN, kNaN});
    lacks_something_ = true;
  }
  void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) override {
    one_after_the_other(count, body);
  }

 private:
  std::span<const point::SpacingSample> spacing_;
  std::span<const point::NoiseSample> noise_;
  std::span<const point::ResidualSample> residuals_;
  std::span<const Point> heads_;
  std::span<const std::uint32_t> pools_;
  bool lacks_something_ = false;
};

// All that the stages of one cloud need, as State::resolve_once and State::run_to_end have it.
class Measuring {
 public:
  Measuring(Backend& backend, std::span<const Point> points, const Params& params, const std::stop_token& stop)
      : backend_(backend), points_(points), params_(params), stop_(stop), needed_(needed_by(params)) {}

  std::vector<OneCloud> measure(std::span<const std::uint32_t> ends) {
    std::vector<OneCloud> clouds(ends.size());
    for (std::size_t i = 0; i < ends.size(); ++i) clouds[i].first = i == 0 ? 0 : ends[i - 1], clouds[i].end = ends[i];
    for_all(clouds, [this](OneCloud& cloud) { draw(cloud); });
    const ManyClouds::Taken taken = take(clouds);
    for_all(clouds, [&](OneCloud& cloud) { resolve(cloud, taken); });
    return clouds;
  }

 private:
  template <class Body>
  void for_all(std::vector<OneCloud>& clouds, const Body& body) {
    throw_if_stopped(stop_);
    backend_.sampling().for_each_on_host(clouds.size(), [&](std::size_t i) {
      if (!stop_.stop_requested()) body(clouds[i]);
    });
    throw_if_stopped(stop_);
  }

  void draw(OneCloud& cloud) const {
    const std::span<const Point> its = points_.subspan(cloud.first, cloud.end - cloud.first);
    const auto point_at = [its](std::size_t i) { return std::pair(its[i], static_cast<std::uint32_t>(i)); };
    cloud.sample = sample_points(its.size(), point_at, kSampledPoints, one_after_the_other);
    cloud.settings.frame = frame_of(cloud.sample);
    cloud.spacings = needed_.estimates.spacing ? cloud.sample.indices.size() : 0;
    cloud.noises = needed_.estimates.noise ? noise_queries(cloud.sample) : 0;
  }

  ManyClouds::Taken take(std::vector<OneCloud>& clouds) {
    std::size_t spacings = 0, noises = 0;
    for (OneCloud& cloud : clouds) {
      cloud.spacing_at = std::exchange(spacings, spacings + cloud.spacings);
      cloud.noise_at = std::exchange(noises, noises + cloud.noises);
    }
    if (spacings + noises == 0) return {};
    ManyClouds::Queries for_spacing, for_noise;
    for_spacing.resize(spacings);
    for_noise.resize(noises);
    for_all(clouds, [&](OneCloud& cloud) {
      const auto number = static_cast<std::uint32_t>(&cloud - clouds.data());
      const auto fill = [&](ManyClouds::Queries& queries, std::size_t at, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) {
          queries.points[at + i] = cloud.first + cloud.sample.indices[i];
          queries.clouds[at + i] = number;
        }
      };
      fill(for_spacing, cloud.spacing_at, cloud.spacings);
      fill(for_noise, cloud.noise_at, cloud.noises);
    });
    return backend_.many_clouds()->take_samples(for_spacing, for_noise, stop_);
  }

  void resolve(OneCloud& cloud, const ManyClouds::Taken& taken) const {
    Estimate found;
    if (needed_.estimates.spacing || needed_.estimates.noise) {
      SamplesTaken samples(taken, cloud);
      found = estimate(samples, cloud.sample, needed_.estimates, stop_);
      cloud.is_alone = samples.lacks_something();
    }
    const Resolved used = pointfair::resolve(params_, std::move(found), diagonal_of(cloud.sample.bounds));
    Settings settings = settings_of(used);
    // Radii of clouds that run together follow the levels of the noise, and given radii do not. A sensor that was found
    // is that of one cloud, and kernels of many clouds take one place for all.
    cloud.is_alone =
        cloud.is_alone || settings.fairing.sensors || (settings.neighbors.levels && !settings.neighbors.radius_follows);
    static_cast<Settings&>(cloud.settings) = std::move(settings);
    cloud.iterations = used.params.iterations;
  }

  Backend& backend_;
  std::span<const Point> points_;
  const Params& params_;
  const std::stop_token& stop_;
  Needed needed_;
};

// Lists of so many take about as long, or less than kernels of their own would.
int kind_of_list(int neighbors) {
  constexpr int kShort = 32;
  if (neighbors <= kShort) return neighbors > 0;
  return std::bit_width(static_cast<unsigned>(neighbors - 1));
}

// What must be alike of clouds that run together.
auto kind_of(const OneCloud& cloud) {
  const FramedSettings& its = cloud.settings;
  return std::tuple(kind_of_list(its.neighbors.min_neighbors), its.normals.filter_rounds, its.normals.crease_angle > 0,
                    its.normals.flat_scale > 1, its.fairing.noise > 0, its.fairing.outlier_distance > 0,
                    its.limits.farthest > 0, cloud.iterations);
}

}  // namespace

bool may_differ(const Params& params) { return params.method == Method::bilateral && sums_within_radius(params); }

std::vector<std::uint32_t> run_by_estimates(Backend& backend, std::span<const Point> points,
                                            std::span<const std::uint32_t> ends, const Params& params,
                                            const std::stop_token& stop) {
  const std::vector<OneCloud> clouds = Measuring(backend, points, params, stop).measure(ends);
  std::vector<std::uint32_t> alone;
  std::map<decltype(kind_of(clouds[0])), std::vector<std::uint32_t>> kinds;
  for (std::uint32_t i = 0; i < clouds.size(); ++i) {
    if (clouds[i].first == clouds[i].end) continue;
    (clouds[i].is_alone ? alone : kinds[kind_of(clouds[i])]).push_back(i);
  }
  for (const auto& [kind, numbers] : kinds) {
    std::vector<FramedSettings> settings;
    for (const std::uint32_t i : numbers) settings.push_back(clouds[i].settings);
    backend.many_clouds()->run(numbers, settings, clouds[numbers[0]].iterations, stop);
  }
  return alone;
}

}  // namespace pointfair
