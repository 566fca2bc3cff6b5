// SPDX-License-Identifier: Apache-2.0
// Many clouds with estimates of each, over a device that computes them one by one, against a run of each.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "forwarding_backend.h"
#include "many_shapes.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "seam/many_clouds.hpp"

namespace pointfair {
namespace {

// Keeps what ManyClouds promises, on the CPU.
class OneByOne final : public ForwardingBackend, public ManyClouds {
 public:
  OneByOne() : ForwardingBackend(make_cpu_backend(1)) {}
  using ForwardingBackend::download;
  using ForwardingBackend::take_samples;
  using ForwardingBackend::upload;

  ManyClouds* many_clouds() override { return this; }
  Room room() const override { return {1000, 5000, std::size_t(1) << 20}; }
  void upload(std::span<const Point> points, std::span<const std::uint32_t> ends) override {
    points_.assign(points.begin(), points.end());
    moved_ = points_;
    ends_.assign(ends.begin(), ends.end());
  }
  void upload(const DevicePoints&, DeviceStream, std::span<const std::uint32_t>) override { FAIL(); }
  std::vector<std::uint8_t> surely_have_no_origin(const DevicePoints&, DeviceStream,
                                                  std::span<const std::uint32_t>) override {
    return {};
  }

  Taken take_samples(const Queries& for_spacing, const Queries& for_noise, std::stop_token stop) override {
    spacing_.clear(), noise_.clear(), residuals_.clear(), heads_.clear();
    for (std::uint32_t cloud = 0; cloud < ends_.size(); ++cloud) {
      to().upload(points_of(points_, cloud), IndexOrder::fastest);
      to().build_index(0, std::nullopt, stop);
      const std::vector<std::uint32_t> spacing = queries_of(for_spacing, cloud), noise = queries_of(for_noise, cloud);
      const Samples samples = to().sampling().take_samples(spacing, noise, stop);
      const std::vector<point::ResidualSample> residuals = samples.residuals();
      std::vector<Point> heads(noise.size() * point::kHeadRow);
      to().sampling().sample_neighborhoods(noise, point::kHeadRow - 1, heads);
      spacing_.insert(spacing_.end(), samples.spacing.begin(), samples.spacing.end());
      noise_.insert(noise_.end(), samples.noise.begin(), samples.noise.end());
      residuals_.insert(residuals_.end(), residuals.begin(), residuals.end());
      heads_.insert(heads_.end(), heads.begin(), heads.end());
    }
    pools_.clear();
    if (++times_sampled_ % 2 == 0) pool(for_noise);
    return {spacing_, noise_, residuals_, heads_, pools_};
  }
  void run(std::span<const std::uint32_t> clouds, std::span<const FramedSettings> settings, int iterations,
           std::stop_token stop) override {
    ++runs;
    ASSERT_EQ(clouds.size(), settings.size());
    for (std::size_t n = 0; n < clouds.size(); ++n) {
      FramedSettings its = settings[n];
      EXPECT_EQ(its.normals.flat_scale > 1, settings[0].normals.flat_scale > 1);
      EXPECT_EQ(its.fairing.noise > 0, settings[0].fairing.noise > 0);
      EXPECT_EQ(its.fairing.outlier_distance > 0, settings[0].fairing.outlier_distance > 0);
      EXPECT_EQ(its.limits.farthest > 0, settings[0].limits.farthest > 0);
      to().upload(points_of(points_, clouds[n]), IndexOrder::along_curve);
      for (int iteration = 0; iteration < iterations; ++iteration) {
        its.fairing.is_further = iteration > 0;
        run_stages(to(), iteration, its, stop);
      }
      to().download(iterations - 1, points_of(moved_, clouds[n]), its.limits, {});
    }
  }
  void download(std::span<Point> points) override { std::copy(moved_.begin(), moved_.end(), points.begin()); }
  void download(const DeviceOutput&, DeviceStream) override { FAIL(); }

  int runs = 0;

 private:
  std::span<Point> points_of(std::vector<Point>& all, std::uint32_t cloud) const {
    const std::uint32_t first = cloud == 0 ? 0 : ends_[cloud - 1];
    return std::span(all).subspan(first, ends_[cloud] - first);
  }
  std::vector<std::uint32_t> queries_of(const Queries& queries, std::uint32_t cloud) const {
    const std::uint32_t first = cloud == 0 ? 0 : ends_[cloud - 1];
    std::vector<std::uint32_t> its;
    for (std::size_t i = 0; i < queries.points.size(); ++i)
      if (queries.clouds[i] == cloud) its.push_back(queries.points[i] - first);
    return its;
  }

  // By looking at all of a cloud's samples.
  void pool(const Queries& queries) {
    pools_.resize(queries.points.size() * point::kPool);
    for (std::size_t first = 0, end = 0; first < queries.points.size(); first = end) {
      for (end = first; end < queries.points.size() && queries.clouds[end] == queries.clouds[first];) ++end;
      for (std::size_t i = first; i < end; ++i) {
        std::vector<std::pair<double, std::uint32_t>> others;
        for (std::size_t j = first; j < end && noise_[i].shows_noise; ++j)
          if (noise_[j].shows_noise)
            others.emplace_back(squared_distance(points_[queries.points[i]], points_[queries.points[j]]),
                                static_cast<std::uint32_t>(j - first));
        std::sort(others.begin(), others.end());
        for (std::size_t n = 0; n < std::min<std::size_t>(others.size(), point::kPool); ++n)
          pools_[i * point::kPool + n] = others[n].second;
      }
    }
  }
  static double squared_distance(const Point& a, const Point& b) {
    const double x = double(a.x) - b.x, y = double(a.y) - b.y, z = double(a.z) - b.z;
    return x * x + y * y + z * z;
  }

  int times_sampled_ = 0;
  std::vector<std::uint32_t> pools_;
  std::vector<Point> points_, moved_, heads_;
  std::vector<std::uint32_t> ends_;
  std::vector<point::SpacingSample> spacing_;
  std::vector<point::NoiseSample> noise_;
  std::vector<point::ResidualSample> residuals_;
};

TEST(ManyEstimates, have_the_bits_of_single_runs) {
  const shapes::Clouds clouds = shapes::clouds_with_estimates();
  auto backend = std::make_unique<OneByOne>();
  OneByOne& device = *backend;
  Pipeline many = PipelineAccess::make(std::move(backend), {Device::cpu, "one by one", ""}), single(Device::cpu);
  const std::vector<Params> kinds = shapes::params_with_estimates();
  EXPECT_TRUE(many.runs_together(Params{}));
  for (std::size_t kind = 0; kind < kinds.size(); ++kind) {
    device.runs = 0;
    EXPECT_TRUE(many.runs_together(kinds[kind]));
    shapes::expect_bits_of_single_runs(many, single, clouds, kinds[kind], "parameters " + std::to_string(kind));
    EXPECT_GT(device.runs, 0);
    EXPECT_LT(device.runs, int(clouds.count()));
  }
}

// Steps of depth are looked for in wide rows, which are not taken of many clouds at once.
TEST(ManyEstimates, of_steps_of_depth_are_made_of_the_cloud_alone) {
  shapes::Clouds clouds;
  clouds.add(500, 1, 0);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 60; ++x) {
      const float disparity = 60.0f - std::floor(0.5f * float(y) + 0.03f * float(x));
      const float depth = 60.0f / disparity;
      clouds.points.push_back({float(x - 30) * depth / 60, float(y - 30) * depth / 60, depth});
    }
  clouds.offsets.push_back(clouds.points.size());
  clouds.add(600, 1, 0);
  Pipeline many = PipelineAccess::make(std::make_unique<OneByOne>(), {Device::cpu, "one by one", ""}),
           single(Device::cpu);
  shapes::expect_bits_of_single_runs(many, single, clouds, {}, "");
}

// The twelfth neighbours that its place asks for are not taken of many clouds at once, and kernels of many know none.
TEST(ManyEstimates, that_one_sensor_saw_are_computed_alone) {
  shapes::Clouds clouds;
  clouds.add(500, 1, 0);
  for (int y = -30; y < 30; ++y)
    for (int x = -30; x < 30; ++x) {
      const double depth = (x < 0 ? 1.0 : x == 0 ? 1.5 : 2.0) + 0.002 * ((x * 7 + y * 13) % 5);
      clouds.points.push_back(shapes::make_point(0.01 * x * depth, 0.01 * y * depth, depth));
    }
  clouds.offsets.push_back(clouds.points.size());
  clouds.add(600, 1, 0);
  Pipeline many = PipelineAccess::make(std::make_unique<OneByOne>(), {Device::cpu, "one by one", ""}),
           single(Device::cpu);
  shapes::expect_bits_of_single_runs(many, single, clouds, {}, "");
  single.load(std::span(clouds.points).subspan(500, 3600));
  std::vector<Point> out(3600);
  single.run({}, out);
  EXPECT_TRUE(single.report().found_sensor.has_value());
}

TEST(ManyEstimates, stop_when_asked) {
  const shapes::Clouds clouds = shapes::clouds_with_estimates();
  Pipeline many = PipelineAccess::make(std::make_unique<OneByOne>(), {Device::cpu, "one by one", ""});
  std::vector<Point> result(clouds.points.size());
  std::stop_source source;
  source.request_stop();
  expect_error(ErrorKind::interrupted, "",
               [&] { many.run_many(clouds.points, clouds.offsets, {}, result, source.get_token()); });
}

}  // namespace
}  // namespace pointfair
