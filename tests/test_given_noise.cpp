// SPDX-License-Identifier: Apache-2.0
// Params::noise: everything automatic follows from it, and what it says is not estimated.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "estimate/automatic.hpp"
#include "forwarding_backend.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "seam/backend.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

const Points& hills() {
  static const Points points = shapes::with_noise(shapes::waves(3000), 0.01);
  return points;
}

std::vector<std::pair<std::string, Params>> kinds_of_runs() {
  std::vector<std::pair<std::string, Params>> runs{{"default", Params{}}, {"paper", paper_preset()}};
  const auto add = [&](const std::string& name, auto change) { change(runs.emplace_back(name, Params{}).second); };
  add("k", [](Params& p) { p.k = 24; });
  add("radius", [](Params& p) { p.radius = 0.08; });
  add("constraint", [](Params& p) { p.k = 24, p.constraint = true, p.outliers = Outliers::mark; });
  for (const Method method : {Method::laplacian, Method::taubin, Method::mls, Method::wiener})
    add("method " + std::to_string(int(method)), [=](Params& p) { p.method = method; });
  return runs;
}

TEST(GivenNoise, equal_to_the_estimate_gives_the_same_parameters_and_points) {
  for (const auto& [name, automatic] : kinds_of_runs()) {
    Pipeline pipeline = loaded(hills());
    Params given = automatic;
    given.noise = pipeline.estimates().noise;
    EXPECT_EQ(pipeline.resolve(given), pipeline.resolve(automatic)) << name;
    EXPECT_EQ(pipeline.resolve(automatic).noise, given.noise) << name;
    Points of_automatic(hills().size()), of_given(hills().size());
    pipeline.run(automatic, of_automatic);
    pipeline.run(given, of_given);
    EXPECT_EQ(std::memcmp(of_given.data(), of_automatic.data(), of_given.size() * sizeof(Point)), 0) << name;
  }
}

TEST(GivenNoise, is_read_in_every_unit) {
  Pipeline pipeline = loaded(hills());
  const Estimates estimates = pipeline.estimates();
  Params params{.noise = 0.02};
  const Params expected = pipeline.resolve(params);
  EXPECT_EQ(expected.noise, Length(0.02));
  params.noise = {0.02 / estimates.spacing, Length::Unit::spacing};
  EXPECT_NEAR(pipeline.resolve(params).noise.value, 0.02, 1e-12);
  params.noise = {100 * 0.02 / estimates.diagonal, Length::Unit::percent};
  EXPECT_NEAR(pipeline.resolve(params).noise.value, 0.02, 1e-12);
  EXPECT_NEAR(pipeline.resolve(params).radius.value, expected.radius.value, 1e-12);
}

TEST(GivenNoise, sets_what_is_automatic_and_leaves_what_is_given) {
  Pipeline pipeline = loaded(hills());
  const Params used = pipeline.resolve({.noise = 0.05, .min_neighbors = 20, .similarity_sigma = 0.01});
  EXPECT_EQ(used.min_neighbors, 20);
  EXPECT_EQ(used.similarity_sigma, Length(0.01));
  EXPECT_DOUBLE_EQ(used.delta.value, 2.5 * 0.05);  // as docs/parameters.md says
  EXPECT_DOUBLE_EQ(used.outlier_distance.value, 6 * 0.05);
  EXPECT_GT(used.radius.value, 2 * pipeline.resolve({}).radius.value);
}

TEST(GivenNoise, that_differs_from_the_estimate_leaves_the_shape_that_was_measured) {
  Noise measured{0.02, 0.05};
  measured.gap = 0.3;
  const Noise less = of_sigma(measured, 0.01);
  EXPECT_DOUBLE_EQ(less.sigma, 0.01);
  EXPECT_DOUBLE_EQ(less.gap, 0.3);
  EXPECT_DOUBLE_EQ(less.surface_spacing, 0.05);
}

// Counts the queries of each kind.
class CountingBackend : public ForwardingBackend {
 public:
  explicit CountingBackend(std::size_t& noise_queries)
      : ForwardingBackend(make_cpu_backend(1)), noise_queries_(noise_queries) {}
  Samples take_samples(std::span<const std::uint32_t> for_spacing, std::span<const std::uint32_t> for_noise,
                       std::stop_token stop) override {
    noise_queries_ += for_noise.size();
    return ForwardingBackend::take_samples(for_spacing, for_noise, std::move(stop));
  }

 private:
  std::size_t& noise_queries_;
};

TEST(GivenNoise, is_not_estimated_where_nothing_else_of_the_estimate_is_read) {
  std::size_t queries = 0;
  auto backend = std::make_unique<CountingBackend>(queries);
  const DeviceInfo device = backend->device();
  Pipeline pipeline = PipelineAccess::make(std::move(backend), device);
  pipeline.load(hills());
  Params params = paper_preset();  // of its lengths delta alone follows from the noise and from nothing else
  params.normal_sigma = params.closeness_sigma = params.similarity_sigma = 0.05;
  params.rho = 0.05;
  params.noise = 0.01;
  Points out(hills().size());
  pipeline.run(params, out);
  EXPECT_EQ(queries, 0u);
  EXPECT_DOUBLE_EQ(pipeline.report().params.delta.value, 0.025);
  params.noise = {};
  pipeline.run(params, out);
  EXPECT_GT(queries, 0u);
}

// The radius of a list follows from the density alone, which must then be measured.
TEST(GivenNoise, widths_in_radii_of_a_list_are_no_less_than_those_that_are_automatic) {
  Pipeline pipeline = loaded(hills());
  Params params{.k = 16, .similarity_sigma = 0.03, .outliers = Outliers::off};
  const double automatic = pipeline.resolve(params).closeness_sigma.value;  // half the radius
  params.normal_sigma = {1, Length::Unit::radius};
  params.closeness_sigma = {0.5, Length::Unit::radius};
  EXPECT_DOUBLE_EQ(pipeline.resolve(params).closeness_sigma.value, automatic);
}

}  // namespace
}  // namespace pointfair
