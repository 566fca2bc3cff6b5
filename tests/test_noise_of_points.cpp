// SPDX-License-Identifier: Apache-2.0
// The noise at each point: as it is told (Pipeline::noise), and as it is given (Pipeline::set_noise).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "backend_runs.h"
#include "forwarding_backend.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points, shapes::same_bits;
using Values = std::vector<float>;

constexpr int kPoints = 20000;  // over the unit square: the spacing is 0.007
constexpr double kSpacing = 0.0071;
constexpr double kQuiet = 0.1 * kSpacing, kLoud = 0.6 * kSpacing;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

double sigma_at(double x) { return x < 0.5 ? kQuiet : kLoud; }

// A plane whose right half is six times as noisy as the left.
Points two_halves() {
  Points points = shapes::plane(kPoints);
  const Points unit = shapes::with_noise(Points(points.size()), 1);
  for (std::size_t i = 0; i < points.size(); ++i) points[i].z += float(sigma_at(points[i].x) * unit[i].z);
  return points;
}

Values known_noise(const Points& points) {
  Values values;
  for (const Point& p : points) values.push_back(float(sigma_at(p.x)));
  return values;
}

Values told(Pipeline& pipeline, std::size_t count, const Params& params = {}) {
  Values values(count);
  pipeline.noise(values, params);
  return values;
}

Values told_of(const Points& points, Device device = Device::cpu) {
  Pipeline pipeline = loaded(points, device);
  return told(pipeline, points.size());
}

// But where the noise changes, since it is told smoothly; `error`: of its logarithm.
void expect_near_the_truth(const Points& points, const Values& values, double error) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double x = points[i].x;
    ASSERT_TRUE(std::abs(x - 0.5) < 0.1 || std::abs(std::log(values[i] / sigma_at(x))) < error) << x;
  }
}

TEST(NoiseOfPoints, is_the_level_that_a_run_follows_times_the_noise) {
  const Points points = two_halves();
  Pipeline pipeline = loaded(points);
  const Values values = told(pipeline, points.size());
  const Points out = pipeline.run({}).points;
  const auto settings = reference::settings_of(pipeline.report().params, PipelineAccess::followed_noise(pipeline));
  ASSERT_TRUE(settings.levels);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double expected = pipeline.estimates().noise * reference::noise_level(settings, points[i]);
    ASSERT_NEAR(values[i], expected, 1e-5 * expected) << i;
  }
  EXPECT_TRUE(same_bits(told(pipeline, points.size()), values)) << "places are those of the cloud as loaded";
}

TEST(NoiseOfPoints, is_none_where_a_point_is_invalid) {
  Points points = two_halves();
  points[3].y = kNaN;
  points[5].z = kInfinity;
  points[7].x = 1e19f;
  const Values values = told_of(points);
  for (std::size_t i = 0; i < points.size(); ++i) ASSERT_EQ(std::isnan(values[i]), i == 3 || i == 5 || i == 7) << i;
}

TEST(NoiseOfPoints, does_not_depend_on_the_order_of_the_points_nor_on_the_device) {
  const Points points = two_halves();
  const Values values = told_of(points);
  const auto order = shapes::shuffle_order(points.size(), 5);
  const Values shuffled = told_of(shapes::permuted(points, order));
  for (std::size_t i = 0; i < order.size(); ++i) ASSERT_EQ(shuffled[i], values[order[i]]) << i;
  Device one_thread = Device::cpu;
  one_thread.threads = 1;
  EXPECT_TRUE(same_bits(told_of(points, one_thread), values));
  for (const DeviceStatus& device : list_devices())
    EXPECT_TRUE(!device.usable || same_bits(told_of(points, device.info.kind), values)) << device.info.name;
}

TEST(NoiseOfPoints, has_the_same_bits_in_tiles) {
  const Points points = two_halves();
  const auto make = [] { return std::make_unique<SmallBackend>(9 * kPoints / 10); };
  for (const bool given : {false, true}) {
    Pipeline tight = PipelineAccess::make(make(), {Device::cpu, "small", "test"}, MakeWorkers{{make}}),
             ample(Device::cpu);
    tight.load(points);
    ample.load(points);
    if (given) tight.set_noise(known_noise(points)), ample.set_noise(known_noise(points));
    EXPECT_TRUE(same_bits(told(tight, points.size()), told(ample, points.size())));
    Points in_tiles(points.size()), whole(points.size());
    tight.run({}, in_tiles);
    ample.run({}, whole);
    EXPECT_GT(tight.report().tiles, 1u);
    EXPECT_TRUE(same_bits(in_tiles, whole));
  }
}

TEST(NoiseOfPoints, takes_a_noise_that_is_given_for_that_of_a_typical_place) {
  const Points points = two_halves();
  Pipeline pipeline = loaded(points);
  const Values values = told(pipeline, points.size());
  Params params{.noise = 3 * pipeline.estimates().noise};
  const Values more = told(pipeline, points.size(), params);
  params.noise = Length(50, Length::Unit::spacing);
  const Values most = told(pipeline, points.size(), params);
  const double factor = 50 * pipeline.estimates().spacing / pipeline.estimates().noise;
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_NEAR(more[i] / values[i], 3, 1e-5);
    ASSERT_NEAR(most[i] / values[i], factor, 1e-5 * factor);
  }
  params.noise = Length(0.005, Length::Unit::metre);
  EXPECT_THROW(told(pipeline, points.size(), params), Error) << "no file says its unit";
}

TEST(NoiseOfPoints, is_zero_or_none_where_there_is_too_little_to_tell) {
  EXPECT_TRUE(told_of({}).empty());
  EXPECT_EQ(told_of({{1, 2, 3}}), Values{0});
  EXPECT_EQ(told_of(shapes::identical(50)), Values(50, 0));
  EXPECT_TRUE(std::isnan(told_of({{kNaN, 2, 3}})[0]));
}

TEST(NoiseOfPoints, needs_an_array_of_the_cloud_s_size) {
  Pipeline pipeline = loaded(two_halves());
  Values few(kPoints - 1);
  expect_error(ErrorKind::usage, "19999", [&] { pipeline.noise(few); });
}

TEST(NoiseOfPoints, that_is_given_is_told_again_as_far_as_it_is_smooth) {
  const Points points = two_halves();
  Pipeline pipeline = loaded(points);
  pipeline.set_noise(known_noise(points));
  const Values values = told(pipeline, points.size());
  expect_near_the_truth(points, values, 0.05);
  const Estimates& estimates = pipeline.estimates();
  EXPECT_TRUE(estimates.noise == float(kQuiet) || estimates.noise == float(kLoud)) << "the median of all values";
  EXPECT_NEAR(estimates.noise_quantiles[0], kQuiet, 1e-6 * kQuiet);
  EXPECT_NEAR(estimates.noise_quantiles[2], kLoud, 1e-6 * kLoud);
  EXPECT_EQ(pipeline.resolve({}).noise, Length(estimates.noise));
}

// The same noise everywhere, of which one side is said to have a sixth.
TEST(NoiseOfPoints, that_is_given_is_followed) {
  const Points points = shapes::with_noise(shapes::plane(kPoints), 0.3 * kSpacing);
  const auto moved = [&](const Values& given) {
    Pipeline pipeline = loaded(points);
    if (!given.empty()) pipeline.set_noise(given);
    const Points out = pipeline.run({}).points;
    double left = 0, right = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      (points[i].x < 0.5 ? left : right) += std::abs(double(out[i].z) - points[i].z);
    return std::pair(left, right);
  };
  Values values;
  for (const Point& p : points) values.push_back(float(p.x < 0.5 ? 0.3 * kSpacing / 6 : 0.3 * kSpacing));
  const auto [left, right] = moved(values);
  const auto [plain_left, plain_right] = moved({});
  EXPECT_LT(left, 0.6 * plain_left);
  EXPECT_NEAR(right, plain_right, 0.15 * plain_right);
}

TEST(NoiseOfPoints, that_is_given_does_not_depend_on_the_order_of_the_points) {
  const Points points = two_halves();
  const auto order = shapes::shuffle_order(points.size(), 5);
  const Points shuffled = shapes::permuted(points, order);
  const auto run = [](const Points& of) {
    Pipeline pipeline = loaded(of);
    pipeline.set_noise(known_noise(of));
    return pipeline.run({}).points;
  };
  const Points a = run(points), b = run(shuffled);
  EXPECT_TRUE(same_bits(shapes::permuted(a, order), b));
}

TEST(NoiseOfPoints, that_is_given_may_have_holes) {
  const Points points = two_halves();
  Values values = known_noise(points);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i % 5 == 0) values[i] = kNaN;
    if (i % 5 == 1) values[i] = 0;
    if (i % 5 == 2) values[i] = -1;
    if (i % 7 == 3) values[i] = kInfinity;
  }
  Pipeline pipeline = loaded(points);
  pipeline.set_noise(values);
  const Values smooth = told(pipeline, points.size());
  expect_near_the_truth(points, smooth, 0.05);
}

TEST(NoiseOfPoints, that_is_given_holds_until_it_is_taken_back_or_another_cloud_comes) {
  const Points points = two_halves();
  Pipeline pipeline = loaded(points);
  const auto run = [&] { return pipeline.run({}).points; };
  const double measured = pipeline.estimates().noise;
  const Points automatic = run();
  pipeline.set_noise(Values(points.size(), 0.01f));
  EXPECT_EQ(pipeline.estimates().noise, 0.01f);
  const Points given = run();
  EXPECT_FALSE(same_bits(given, automatic));
  {
    Pipeline fresh = loaded(points);
    fresh.set_noise(Values(points.size(), 0.01f));
    const Points out = fresh.run({}).points;
    EXPECT_TRUE(same_bits(out, given)) << "what was cached does not show";
  }
  pipeline.set_noise({});
  EXPECT_EQ(pipeline.estimates().noise, measured);
  EXPECT_TRUE(same_bits(run(), automatic));
  pipeline.set_noise(Values(points.size(), 0.01f));
  pipeline.load(points);
  EXPECT_EQ(pipeline.estimates().noise, measured);
  EXPECT_TRUE(same_bits(run(), automatic));
}

TEST(NoiseOfPoints, that_is_given_is_refused_where_it_cannot_be) {
  Pipeline pipeline = loaded(two_halves());
  const double measured = pipeline.estimates().noise;
  for (const Values& values : {Values(3, 0.01f), Values(kPoints, 0), Values(kPoints, kNaN), Values(kPoints, -1)}) {
    expect_error(ErrorKind::usage, "", [&] { pipeline.set_noise(values); });
    EXPECT_EQ(pipeline.estimates().noise, measured);
  }
}

}  // namespace
}  // namespace pointfair
