// SPDX-License-Identifier: Apache-2.0
// Clouds that are cut into pieces give the bits of the whole; host memory that devices copy fast from.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "backend.hpp"
#include "forwarding_backend.h"
#include "pipeline_access.hpp"
#include "pointfair/pipeline.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

struct Settings {
  NeighborSettings neighbors{8, 0, false, 0};
  NormalSettings normals{true, 0.02f};
  FairingSettings fairing{Method::bilateral, AreaWeight::none, 0.02f, 0.01f};
  int passes = 1;
  DisplacementLimits limits;
};

struct Result {
  Points points, normals;
  Counts counts;
  std::uint64_t held_back = 0;
};

Result run(Backend& backend, const Points& points, const Settings& settings) {
  if (settings.neighbors.k == 0) backend.order_along(CurveCube{{-1.5f, -1.5f, -1.5f}, 3});
  backend.upload(points);
  for (int pass = 0; pass < settings.passes; ++pass) {
    backend.begin_pass(pass);
    backend.build_index({});
    backend.find_neighbors(settings.neighbors, {});
    backend.estimate_normals(settings.normals, {});
    backend.fair(settings.fairing, {});
  }
  Result result{Points(points.size()), Points(points.size()), {}, 0};
  result.held_back = backend.download(result.points, settings.limits, {});
  backend.download_normals(result.normals);
  result.counts = backend.counts();
  return result;
}

std::size_t differences(const Points& a, const Points& b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) count += std::memcmp(&a[i], &b[i], sizeof(Point)) != 0;
  return count;
}

// Every device of this machine; `workers` of them at once cut a cloud.
struct Place {
  Device::Kind kind;
  int workers;
  std::unique_ptr<Backend> make() const { return kind == Device::cpu ? make_cpu_backend(0) : make_cuda_backend(0); }
  std::unique_ptr<Backend> make_cut(Cutting cutting) const {
    std::vector<std::unique_ptr<Backend>> backends;
    for (int i = 0; i < workers; ++i) backends.push_back(make());
    return make_cut_backend(std::move(backends), cutting);
  }
};
std::vector<Place> places() {
  std::vector<Place> all{{Device::cpu, 1}, {Device::cpu, 2}};
  for (const DeviceStatus& device : list_cuda_devices())
    if (device.usable && all.size() == 2) all.push_back({Device::cuda, 2});
  return all;
}

void expect_the_same_cut(const Points& points, const Settings& settings, const char* what,
                         const std::vector<Cutting>& cuttings = {{2}, {3, ~0ull, 0.2}, {7, ~0ull, 0.05}}) {
  for (const Place& place : places()) {
    const Result whole = run(*place.make(), points, settings);
    for (const Cutting& cutting : cuttings) {
      SCOPED_TRACE(std::string(what) + ", " + (place.kind == Device::cpu ? "cpu" : "cuda") + ", " +
                   std::to_string(cutting.pieces) + " pieces, " + std::to_string(place.workers) + " at once");
      const auto backend = place.make_cut(cutting);
      const Result cut = run(*backend, points, settings);
      EXPECT_EQ(differences(whole.points, cut.points), 0u);
      EXPECT_EQ(differences(whole.normals, cut.normals), 0u);
      EXPECT_EQ(whole.counts.unmoved, cut.counts.unmoved);
      EXPECT_EQ(whole.counts.short_neighborhoods, cut.counts.short_neighborhoods);
      EXPECT_EQ(whole.held_back, cut.held_back);
    }
  }
}

Points cloud(int count) { return shapes::with_noise(shapes::sphere(count), 0.002); }

TEST(CutCloud, has_the_bits_of_the_whole) { expect_the_same_cut(cloud(200000), {}, "plain"); }

TEST(CutCloud, has_the_outliers_of_the_whole) {
  Points points = cloud(30000);
  for (std::size_t i = 0; i < points.size(); i += 100) {
    const float lift = 1 + 0.0001f * float(i % 997);
    points[i] = {points[i].x * lift, points[i].y * lift, points[i].z * lift};
  }
  Settings settings;
  settings.neighbors = {0, 0.02f};
  settings.neighbors.widening = 16;
  settings.fairing.outlier_distance = 0.012f;
  settings.limits = {0.008f, 0.012f};
  for (const int passes : {1, 2}) {
    settings.passes = passes;
    settings.fairing.pull_outliers = false;
    expect_the_same_cut(points, settings, "kept");
    settings.fairing.pull_outliers = true;
    expect_the_same_cut(points, settings, "pulled in");
  }
}

TEST(CutCloud, has_the_bits_of_the_whole_with_every_option) {
  const Points points = cloud(60000);
  Settings settings;
  settings.fairing.area_weight = AreaWeight::squared;
  expect_the_same_cut(points, settings, "area weight");
  settings.neighbors.k = 3;
  expect_the_same_cut(points, settings, "area weight over more than the list");
  settings.neighbors = {8, 0, true, 0.012f};
  expect_the_same_cut(points, settings, "constraint");
  settings.neighbors = {12, 0.02f, true, 0.008f};
  expect_the_same_cut(points, settings, "constraint within a radius");
  settings.neighbors = {16, 0.015f, false, 0};
  expect_the_same_cut(points, settings, "radius");
  settings.normals.filter_rounds = 2;
  settings.normals.filter_angle = 20;
  settings.fairing.two_planes = true;
  settings.fairing.facing_angle = 40;
  settings.fairing.strength = 0.9f;
  settings.passes = 2;
  expect_the_same_cut(points, settings, "filtered, both planes, two passes");
  settings.neighbors = {30, 0, true, 0.012f};
  settings.passes = 3;
  expect_the_same_cut(points, settings, "constraint, filtered, both planes, three passes");
}

TEST(CutCloud, has_the_bits_of_the_whole_with_every_method) {
  const Points points = cloud(30000);
  for (const ParamInfo& info : kParams) {
    if (info.name != "method") continue;
    for (std::size_t start = 0; start < info.values.size();) {
      const std::string_view word = info.values.substr(start, info.values.find('|', start) - start);
      start += word.size() + 1;
      Params params;
      set_param(params, info, word);
      Settings settings;
      settings.neighbors.k = 12;
      settings.fairing.method = params.method;
      settings.fairing.area_weight = AreaWeight::length;
      settings.fairing.strength = 0.8f;
      expect_the_same_cut(points, settings, std::string(word).c_str(), {{7, ~0ull, 0.05}});
    }
  }
}

TEST(CutCloud, has_the_bits_of_the_whole_over_balls) {
  const Points points = cloud(30000);
  Settings settings;
  settings.neighbors = {0, 0.04f, false, 0};
  settings.passes = 2;
  expect_the_same_cut(points, settings, "one radius");
  settings.normals = {true, 1.4f, true, 2, 20};
  settings.fairing.closeness_sigma = 0.6f;
  settings.fairing.closeness_of_radius = settings.fairing.two_planes = true;
  settings.fairing.facing_angle = 40;
  settings.neighbors = {0, 0.02f, false, 0, 16};
  expect_the_same_cut(points, settings, "balls that follow the density");
  expect_the_same_cut(shapes::with_invalid(shapes::uneven(20000, 50), 11), settings, "uneven, invalid points");
}

TEST(CutCloud, has_the_bits_of_the_whole_over_thinned_balls) {
  Settings settings;
  settings.neighbors = {0, 0.2f, false, 0, 8};
  settings.normals = {true, 1.4f, true, 1, 20};
  settings.fairing.closeness_sigma = 0.6f;
  settings.fairing.closeness_of_radius = settings.fairing.two_planes = true;
  settings.fairing.facing_angle = 40;
  expect_the_same_cut(cloud(60000), settings, "thinned balls", {{5, ~0ull, 0.3}});
}

TEST(CutCloud, has_the_bits_of_the_whole_on_hard_clouds) {
  expect_the_same_cut(shapes::with_invalid(cloud(20000), 7), {}, "invalid points");
  expect_the_same_cut(shapes::with_stray(cloud(20000), 1e6f), {}, "a stray point");
  expect_the_same_cut(shapes::uneven(20000, 200), {}, "uneven");
  expect_the_same_cut(shapes::grid(20), {}, "a grid, full of ties");
  expect_the_same_cut(shapes::flat_grid(100), {}, "a flat grid");
  expect_the_same_cut(shapes::line(5000), {}, "a line");
  Points some_identical = cloud(20000);
  for (std::size_t i = 0; i < some_identical.size(); i += 5) some_identical[i] = {0.5f, 0.25f, 0.125f};
  expect_the_same_cut(some_identical, {}, "a fifth identical");
  for (const int count : {0, 1, 2, 9, 100}) expect_the_same_cut(cloud(count), {}, "tiny");
  expect_the_same_cut(shapes::identical(3000), {}, "identical points");
}

TEST(CutCloud, has_the_bits_of_the_whole_where_little_may_be_uploaded) {
  expect_the_same_cut(cloud(60000), {}, "a limit", {{2, 15000}, {3, 9000}});
}

TEST(CutCloud, that_a_far_point_keeps_from_being_cut_is_an_error_and_no_wrong_cloud) {
  const Points points = shapes::with_stray(cloud(20000), 1e6f);
  const auto backend = Place{Device::cpu, 1}.make_cut({4, 12000});
  try {
    run(*backend, points, {});
    FAIL() << "fitted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::memory);
  }
}

TEST(CutCloud, has_the_estimates_of_the_whole) {
  const Points points = shapes::with_invalid(cloud(50000), 9);
  std::vector<std::uint32_t> queries;
  for (std::uint32_t i = 0; i < 50000; i += 77) queries.push_back(i);
  for (const Place& place : places()) {
    const auto whole = place.make(), cut = place.make_cut({5, ~0ull, 0.1});
    for (Backend* backend : {whole.get(), cut.get()}) {
      backend->upload(points);
      backend->begin_pass(0);
      backend->build_index({});
    }
    for (const int k : {6, 30, 600}) {
      Points expected(queries.size() * std::size_t(k + 1)), rows = expected;
      whole->sample_neighborhoods(queries, k, expected);
      cut->sample_neighborhoods(queries, k, rows);
      for (std::size_t i = 0; i < rows.size(); ++i) {
        if (std::isnan(expected[i].x) && std::isnan(rows[i].x)) rows[i] = expected[i] = {};
      }
      EXPECT_EQ(differences(expected, rows), 0u) << k;
    }
    const Bounds a = whole->bounds(), b = cut->bounds();
    EXPECT_EQ(differences({a.min, a.max}, {b.min, b.max}), 0u);
    EXPECT_EQ(a.valid, b.valid);
  }
}

TEST(CutCloud, runs_a_stage_again_without_the_others) {
  const Points points = cloud(20000);
  Settings settings;
  settings.passes = 2;
  const auto cut = Place{Device::cpu, 1}.make_cut({3});
  run(*cut, points, settings);
  settings.fairing.similarity_sigma = 0.005f;
  settings.passes = 1;
  cut->begin_pass(0);
  cut->fair(settings.fairing, {});
  Points again(points.size());
  cut->download(again, {}, {});
  EXPECT_EQ(differences(again, run(*make_cpu_backend(0), points, settings).points), 0u);
}

TEST(CutCloud, stops_when_asked_and_then_runs_again) {
  const Points points = cloud(20000);
  for (const Place& place : places()) {
    const auto cut = place.make_cut({4});
    std::stop_source stop;
    cut->upload(points);
    cut->begin_pass(0);
    cut->build_index({});
    cut->find_neighbors({8, 0, false, 0}, {});
    cut->estimate_normals({true, 0.02f}, {});
    stop.request_stop();
    try {
      cut->fair(Settings{}.fairing, stop.get_token());
      FAIL() << "not interrupted";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::interrupted);
    }
    EXPECT_EQ(differences(run(*cut, points, {}).points, run(*place.make(), points, {}).points), 0u);
  }
}

// A CPU backend with room for so many points.
class SmallBackend : public ForwardingBackend {
 public:
  explicit SmallBackend(std::size_t room) : ForwardingBackend(make_cpu_backend(0)), room_(room) {}
  void upload(std::span<const Point> points) override {
    require(points.size() / 2);  // they fit, but not what is made of them
    count_ = points.size();
    ForwardingBackend::upload(points);
    input_.assign(points.begin(), points.end());
  }
  void find_neighbors(const NeighborSettings& settings, std::stop_token stop) override {
    require(count_);
    ForwardingBackend::find_neighbors(settings, stop);
  }
  void download_input(std::span<Point> points) override { std::copy(input_.begin(), input_.end(), points.begin()); }

 private:
  void require(std::size_t points) const {
    if (points > room_) throw Error(ErrorKind::memory, "no room");
  }
  std::size_t room_, count_ = 0;
  Points input_;
};

// A pipeline whose device has too little memory against one whose has enough. `small` makes the former's backends.
void expect_the_same_in_little_memory(Device::Kind kind, const std::function<std::unique_ptr<Backend>()>& small) {
  const Points points = cloud(200000);
  Pipeline tight = PipelineAccess::make(small(), {kind, "small", "test"}, small), ample(kind);
  Params params;
  for (int run = 0; run < 3; ++run) {
    if (run == 0) {  // nothing set: balls
      tight.load(points);
      ample.load(points);
    } else if (run == 1) {
      params.k = 8;
    } else {  // some stages only
      params.similarity_sigma = 0.004;
    }
    Points expected(points.size()), out(points.size());
    ample.run(params, expected);
    tight.run(params, out);
    EXPECT_GT(tight.report().pieces, 1u);
    EXPECT_EQ(ample.report().pieces, 1u);
    EXPECT_EQ(ample.report().params, tight.report().params);
    EXPECT_EQ(differences(expected, out), 0u);
    EXPECT_EQ(ample.estimates().noise, tight.estimates().noise);
    tight.normals(out);
    ample.normals(expected);
    EXPECT_EQ(differences(expected, out), 0u);
  }
  const Points few = cloud(1000);
  tight.load(few);
  Points out(few.size());
  tight.run(params, out);
  EXPECT_EQ(tight.report().pieces, 1u) << "a cloud that fits";
}

TEST(CutCloud, is_what_becomes_of_a_cloud_that_memory_does_not_hold) {
  for (const std::size_t room : {150000, 60000})
    expect_the_same_in_little_memory(Device::cpu, [room] { return std::make_unique<SmallBackend>(room); });
  if (places().size() < 3) return;
  for (const std::uint64_t bytes : {18'000'000, 8'000'000})  // the second hold the points, but not their index
    expect_the_same_in_little_memory(Device::cuda, [bytes] {
      auto backend = make_cuda_backend(0);
      backend->limit_memory(bytes);
      return backend;
    });
}

TEST(CutCloud, that_never_fits_is_an_error) {
  const auto small = [] { return std::make_unique<SmallBackend>(100); };
  Pipeline pipeline = PipelineAccess::make(small(), {Device::cpu, "small", "test"}, small);
  try {
    pipeline.load(cloud(100000));
    pipeline.run();
    FAIL() << "fitted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::memory);
  }
}

// No more workers are to be had: the cloud is lost, and said to be; the next load is as any.
TEST(CutCloud, without_workers_is_an_error_and_the_next_cloud_is_sound) {
  bool lost = true;
  const auto small = [&lost] {
    if (lost) throw Error(ErrorKind::device, "the card is lost");
    return std::make_unique<SmallBackend>(60000);
  };
  const Points points = cloud(100000), few = cloud(5000);
  const auto error_of = [](const auto& work) {
    try {
      work();
    } catch (const Error& error) {
      return error.kind();
    }
    return ErrorKind::interrupted;  // none
  };
  Pipeline pipeline =
      PipelineAccess::make(std::make_unique<SmallBackend>(60000), {Device::cpu, "small", "test"}, small);
  pipeline.load(points);
  Points out(points.size());
  EXPECT_EQ(error_of([&] { pipeline.run({}, out); }), ErrorKind::device) << "it is to be cut";
  EXPECT_EQ(error_of([&] { pipeline.run({}, out); }), ErrorKind::device) << "there is still no device";
  EXPECT_EQ(error_of([&] { pipeline.load(few); }), ErrorKind::device);
  lost = false;
  EXPECT_EQ(error_of([&] { pipeline.run({}, out); }), ErrorKind::usage) << "no cloud is loaded";
  EXPECT_EQ(pipeline.run().points.size(), 0u);
  out.resize(few.size());
  for (const Points& next : {few, points}) {
    Pipeline fresh(Device::cpu);
    Points expected(next.size());
    fresh.load(next);
    fresh.run({}, expected);
    pipeline.load(next);
    out.resize(next.size());
    pipeline.run({}, out);
    EXPECT_EQ(differences(out, expected), 0u);
  }
}

TEST(HostBuffer, gives_the_same_as_ordinary_memory_on_every_device) {
  for (const DeviceStatus& device : list_devices()) {
    if (!device.usable) continue;
    for (const int count : {0, 7, 5000, 300000}) {  // the last is uploaded in two parts
      SCOPED_TRACE(device.info.name + ", " + std::to_string(count) + " points");
      const Points points = shapes::with_noise(shapes::waves(count), 0.002);
      Pipeline pipeline(device.info.kind);
      const HostBuffer in = pipeline.host_buffer(points.size()), out = pipeline.host_buffer(points.size());
      ASSERT_EQ(in.points().size(), points.size());
      std::copy(points.begin(), points.end(), in.points().begin());
      Params params;
      params.k = 8;
      pipeline.load(in.points());
      std::fill(in.points().begin(), in.points().end(), Point{});  // load has taken its copy
      pipeline.run(params, out.points());
      Points expected(points.size());
      Pipeline fresh(device.info.kind);
      fresh.load(points);
      fresh.run(params, expected);
      EXPECT_TRUE(std::equal(expected.begin(), expected.end(), out.points().begin(),
                             [](Point a, Point b) { return std::memcmp(&a, &b, sizeof a) == 0; }));
    }
  }
}

TEST(Pipeline, loads_and_runs_at_once_with_the_same_result_on_every_device) {
  for (const DeviceStatus& device : list_devices()) {
    if (!device.usable) continue;
    for (const int count : {0, 7, 5000, 1000000}) {  // in order of z, so that a card gets the last in parts
      SCOPED_TRACE(device.info.name + ", " + std::to_string(count) + " points");
      Points points = shapes::with_noise(shapes::sphere(count), 0.001);
      std::sort(points.begin(), points.end(), [](Point a, Point b) { return a.z < b.z; });
      Pipeline pipeline(device.info.kind), fresh(device.info.kind);
      const HostBuffer in = pipeline.host_buffer(points.size()), out = pipeline.host_buffer(points.size());
      Points expected(points.size());
      std::copy(points.begin(), points.end(), in.points().begin());
      for (const int passes : {1, 1, 2}) {
        for (const bool all_automatic : {false, true}) {
          if (all_automatic && count > 5000) continue;
          Params params;
          if (!all_automatic) {
            params.k = 8;
            params.normal_sigma = params.closeness_sigma = 0.004;
            params.similarity_sigma = 0.002;
            params.step = 100;
          }
          params.passes = passes;
          pipeline.run(in.points(), params, out.points());
          fresh.load(points);
          fresh.run(params, expected);
          EXPECT_EQ(differences(expected, Points(out.points().begin(), out.points().end())), 0u);
          std::vector<std::string> names, separate;
          for (const StageTime& stage : pipeline.report().stages) names.push_back(stage.name);
          for (const StageTime& stage : fresh.report().stages) separate.push_back(stage.name);
          EXPECT_EQ(names, separate);
          params.similarity_sigma = 0.003;  // and what is cached serves as well
          pipeline.run(params, out.points());
          fresh.run(params, expected);
          EXPECT_EQ(differences(expected, Points(out.points().begin(), out.points().end())), 0u);
        }
      }
    }
    Pipeline pipeline(device.info.kind);
    Points out(2);
    EXPECT_THROW(pipeline.run(Points(3), {}, out), Error);
  }
}

TEST(HostBuffer, outlives_its_pipeline_and_moves) {
  HostBuffer buffer;
  EXPECT_TRUE(buffer.points().empty());
  {
    const Pipeline pipeline;
    buffer = pipeline.host_buffer(100);
  }
  const HostBuffer moved = std::move(buffer);
  moved.points()[99] = {1, 2, 3};
  EXPECT_EQ(moved.points()[99].z, 3);
}

TEST(Report, names_every_stage_once_on_every_device) {
  for (const DeviceStatus& device : list_devices()) {
    if (!device.usable) continue;
    Pipeline pipeline(device.info.kind);
    pipeline.load(shapes::with_noise(shapes::waves(3000), 0.002));
    Params params;
    params.k = 8;
    params.normal_sigma = params.closeness_sigma = params.similarity_sigma = 0.05;
    const auto names = [&] {
      std::vector<Point> out(3000);
      pipeline.run(params, out);
      std::vector<std::string> result;
      for (const StageTime& stage : pipeline.report().stages) {
        EXPECT_GT(stage.milliseconds, 0) << stage.name;
        result.push_back(stage.name);
      }
      return result;
    };
    using Names = std::vector<std::string>;
    EXPECT_EQ(names(), (Names{"upload", "index", "neighbors", "normals", "fairing", "download"}));
    params.similarity_sigma = 0.06;
    params.passes = 1;
    names();
    params.similarity_sigma = 0.07;
    EXPECT_EQ(names(), (Names{"fairing", "download"}));
  }
}

}  // namespace
}  // namespace pointfair
