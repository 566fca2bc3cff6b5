// SPDX-License-Identifier: Apache-2.0
// The chain of cached stages: which stages run again is read from a recording backend, and what they give must equal a
// fresh run.
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "forwarding_backend.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pipeline.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;
using Calls = std::vector<std::string>;

// A CPU backend that notes each stage, fails one on request, and tells of each sample of neighbourhoods.
class RecordingBackend : public ForwardingBackend {
 public:
  RecordingBackend(Calls& calls, std::string& failing, std::function<void()>& sampled)
      : ForwardingBackend(make_cpu_backend(1)), calls_(calls), failing_(failing), sampled_(sampled) {}
  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token stop) override {
    note("index");
    ForwardingBackend::build_index(iteration, frame, stop);
  }
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) override {
    note("neighbors");
    ForwardingBackend::find_neighbors(iteration, settings, stop);
  }
  void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token stop) override {
    note("normals");
    ForwardingBackend::estimate_normals(iteration, settings, stop);
  }
  void fair(int iteration, const FairingSettings& settings, std::stop_token stop) override {
    note("fairing");
    ForwardingBackend::fair(iteration, settings, stop);
  }
  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    ForwardingBackend::sample_neighborhoods(queries, k, out);
    if (sampled_) sampled_();
  }
  Samples take_samples(std::span<const std::uint32_t> for_spacing, std::span<const std::uint32_t> for_noise,
                       std::stop_token stop) override {
    return Sampling::take_samples(for_spacing, for_noise, stop);  // of rows that it sees
  }

 private:
  void note(const std::string& stage) {
    calls_.push_back(stage);
    if (stage == failing_) throw Error(ErrorKind::memory, "no memory for " + stage);
  }
  Calls& calls_;
  std::string& failing_;
  std::function<void()>& sampled_;
};

// A pipeline over a recording backend, with a small cloud loaded.
struct Recorded {
  Points points = shapes::with_noise(shapes::waves(1500), 0.004);
  Calls calls;
  std::string failing;
  std::function<void()> sampled;
  Pipeline pipeline = make();

  Pipeline make() {
    auto backend = std::make_unique<RecordingBackend>(calls, failing, sampled);
    const DeviceInfo device = backend->device();
    Pipeline made = PipelineAccess::make(std::move(backend), device);
    made.load(points);
    return made;
  }
  // The stages that a run calls.
  Calls run(const Params& params) {
    calls.clear();
    pipeline.run(params);
    return calls;
  }
};

const Calls kAll = {"index", "neighbors", "normals", "fairing"};

Params settled() {  // nothing automatic, so that a change of one value changes nothing else
  return {.k = 12,
          .constraint = true,
          .rho = 0.08,
          .delta = 0.01,
          .normal_sigma = 0.05,
          .normal_filter = NormalFilter::on,
          .crease_angle = 30,
          .flat_scale = 1.5,
          .closeness_sigma = 0.05,
          .similarity_sigma = 0.02,
          .offset = Offset::symmetric,
          .relaxation = 0.9,
          .implicit_lambda = 2,
          .outliers = Outliers::keep,
          .outlier_distance = 0.3,
          .outlier_radius = 0.4,
          .iterations = 1,
          .displacement_limit = 0.2};
}

Params settled_without_list() {
  Params params = settled();
  params.k = kAutomatic;
  params.constraint = false;
  params.radius = 0.1;
  params.min_neighbors = 6;
  return params;
}

Params settled_on_mesh() {
  Params params = settled_without_list();
  params.connectivity = Connectivity::mesh;
  params.rings = 1;
  params.tangential = 0.5;
  return params;
}

// A strip along the points, in their order.
Polygons strip(std::size_t points) {
  Polygons faces;
  for (std::uint32_t i = 0; i + 2 < points; ++i) {
    faces.corners.insert(faces.corners.end(), {i, i + 1, i + 2});
    faces.ends.push_back(faces.corners.size());
  }
  return faces;
}

// Another value for the field of a row.
void change(Params& params, const ParamInfo& info) {
  std::visit(
      [&](auto field) {
        using Field = std::remove_cvref_t<decltype(params.*field)>;
        if constexpr (std::is_same_v<Field, int>) params.*field += 1;
        if constexpr (std::is_same_v<Field, bool>) params.*field = !(params.*field);
        if constexpr (std::is_same_v<Field, std::optional<double>>) params.*field = *(params.*field) + 0.05;
        if constexpr (std::is_same_v<Field, Length>) params.*field = 0.8 * (params.*field).value + 0.05;
        if constexpr (std::is_same_v<Field, AreaWeight>) params.*field = AreaWeight::squared;
        if constexpr (std::is_same_v<Field, NormalFilter>) params.*field = NormalFilter::off;
        if constexpr (std::is_same_v<Field, Offset>) params.*field = Offset::point;
        if constexpr (std::is_same_v<Field, Method>) params.*field = Method::mls;
        if constexpr (std::is_same_v<Field, Outliers>) params.*field = Outliers::off;
        if constexpr (std::is_same_v<Field, Along>) params.*field = Along::ray;
        if constexpr (std::is_same_v<Field, ImplicitWeights>) params.*field = ImplicitWeights::uniform;
        if constexpr (std::is_same_v<Field, Connectivity>) params.*field = Connectivity::mesh;
      },
      info.field);
}

TEST(Cache, first_run_calls_every_stage_and_an_equal_run_none) {
  Recorded recorded;
  EXPECT_EQ(recorded.run(settled()), kAll);
  EXPECT_EQ(recorded.run(settled()), Calls{});
}

TEST(Cache, a_changed_parameter_runs_again_from_the_stage_of_its_row_and_no_earlier) {
  for (const ParamInfo& info : kParams) {
    Recorded recorded;
    const bool is_of_radii = info.name == "min_neighbors" || info.name == "flat_scale" || info.name == "outlier_radius";
    const bool is_of_mesh = info.name == "rings" || info.name == "keep_boundary" || info.name == "tangential";
    Params before = is_of_mesh                                   ? settled_on_mesh()
                    : is_of_radii || info.name == "connectivity" ? settled_without_list()
                                                                 : settled();
    if (info.name.starts_with("implicit")) before.method = Method::implicit;
    recorded.pipeline.set_faces(strip(recorded.points.size()));
    const std::array<double, 3> above{0.5, 0.5, 5};
    if (info.name == "along") recorded.pipeline.set_viewpoint({&above, 1});
    recorded.run(before);
    Params params = before;
    change(params, info);
    Calls expected(kAll.begin() + std::ptrdiff_t(std::min(kAll.size(), std::size_t(info.stage))), kAll.end());
    if (info.name == "iterations") expected = kAll;  // one more
    if (info.name == "noise") expected = {};         // nothing is automatic that could follow from it
    EXPECT_EQ(recorded.run(params), expected) << info.name;
  }
}

TEST(Cache, lists_whose_lengths_are_given_need_no_samples_for_what_only_radii_read) {
  Params params = settled();
  params.outlier_radius = {};
  Recorded recorded;
  recorded.sampled = [] { FAIL() << "an outlier radius was estimated for lists"; };
  EXPECT_EQ(recorded.run(params), kAll);
  bool is_sampled = false;
  recorded.sampled = [&] { is_sampled = true; };
  params = settled_without_list();
  params.outlier_radius = {};
  recorded.run(params);
  EXPECT_TRUE(is_sampled);
}

TEST(Cache, a_run_with_several_passes_repeats_them_all_but_keeps_the_first) {
  Recorded recorded;
  Params params = settled();
  params.iterations = 3;
  Calls expected;
  for (int pass = 0; pass < 3; ++pass) expected.insert(expected.end(), kAll.begin(), kAll.end());
  EXPECT_EQ(recorded.run(params), expected);
  EXPECT_EQ(recorded.run(params), Calls{});
  params.similarity_sigma = 0.01;
  expected.erase(expected.begin(), expected.begin() + 3);
  EXPECT_EQ(recorded.run(params), expected);
  params.iterations = 1;
  EXPECT_EQ(recorded.run(params), Calls{});
}

TEST(Cache, a_new_cloud_runs_from_the_first_stage) {
  Recorded recorded;
  recorded.run(settled());
  recorded.pipeline.load(shapes::cube(700));
  EXPECT_EQ(recorded.run(settled()), kAll);
}

TEST(Cache, estimates_build_the_index_and_the_run_uses_it) {
  Recorded recorded;
  recorded.pipeline.estimates();
  EXPECT_EQ(recorded.calls, Calls{"index"});
  EXPECT_EQ(recorded.run(settled()), Calls(kAll.begin() + 1, kAll.end()));
}

TEST(Cache, a_stage_that_failed_is_where_the_next_run_begins) {
  for (std::size_t stage = 1; stage < kAll.size(); ++stage) {
    Recorded recorded;
    recorded.failing = kAll[stage];
    EXPECT_THROW(recorded.run(settled()), Error);
    recorded.failing.clear();
    EXPECT_EQ(recorded.run(settled()), Calls(kAll.begin() + std::ptrdiff_t(stage), kAll.end()));
  }
}

// By a stop after the sample for the spacing, and after that for the noise.
TEST(Cache, interrupted_estimates_are_measured_by_the_next_call) {
  for (int samples = 1; samples <= 2; ++samples) {
    Recorded recorded;
    recorded.pipeline.run(settled());
    std::stop_source source;
    int taken = 0;
    recorded.sampled = [&] {
      if (++taken == samples) source.request_stop();
    };
    expect_error(ErrorKind::interrupted, "", [&] { recorded.pipeline.estimates(source.get_token()); });
    Recorded fresh;
    const Estimates found = recorded.pipeline.estimates(), expected = fresh.pipeline.estimates();
    EXPECT_EQ(found.spacing, expected.spacing);
    EXPECT_EQ(found.noise, expected.noise);
  }
}

}  // namespace
}  // namespace pointfair
