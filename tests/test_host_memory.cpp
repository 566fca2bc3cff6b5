// SPDX-License-Identifier: Apache-2.0
// From host memory to a device and back: memory that devices copy fast from, load and run at once, and the report of
// it.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "backend_runs.h"
#include "pointfair/pipeline.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

TEST(HostBuffer, gives_the_same_as_ordinary_memory_on_every_device) {
  for (const DeviceStatus& device : list_devices()) {
    if (!device.usable) continue;
    std::vector<int> counts{0, 7, 5000, 300000};  // a card takes ordinary memory of so many in pieces
    if (device.info.kind == Device::cuda) counts.insert(counts.end(), {5000000, 300001});  // and in larger pieces
    Pipeline fresh(device.info.kind);
    for (const int count : counts) {
      SCOPED_TRACE(device.info.name + ", " + std::to_string(count) + " points");
      const Points points = shapes::with_noise(shapes::waves(count), 0.002);
      Pipeline pipeline(device.info.kind);
      const HostBuffer in = pipeline.host_buffer(points.size()), out = pipeline.host_buffer(points.size());
      ASSERT_EQ(in.points().size(), points.size());
      std::copy(points.begin(), points.end(), in.points().begin());
      Params params{.k = 8};
      pipeline.load(in.points());
      std::fill(in.points().begin(), in.points().end(), Point{});  // load has taken its copy
      pipeline.run(params, out.points());
      EXPECT_EQ(difference(result_of(fresh, points, params), Points(out.points().begin(), out.points().end())), "");
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
      std::copy(points.begin(), points.end(), in.points().begin());
      for (const int iterations : {1, 1, 2}) {
        for (const bool all_automatic : {false, true}) {
          if (all_automatic && count > 5000) continue;
          Params params;
          if (!all_automatic) {
            params.k = 8;
            params.normal_sigma = params.closeness_sigma = 0.004;
            params.similarity_sigma = 0.002;
            params.relaxation = 1;
          }
          params.iterations = iterations;
          pipeline.run(in.points(), params, out.points());
          Points expected = result_of(fresh, points, params);
          EXPECT_EQ(difference(expected, Points(out.points().begin(), out.points().end())), "");
          std::vector<std::string> names, separate;
          for (const StageTime& stage : pipeline.report().stages) names.push_back(stage.name);
          for (const StageTime& stage : fresh.report().stages) separate.push_back(stage.name);
          EXPECT_EQ(names, separate);
          params.similarity_sigma = 0.003;  // and what is cached serves as well
          pipeline.run(params, out.points());
          fresh.run(params, expected);
          EXPECT_EQ(difference(expected, Points(out.points().begin(), out.points().end())), "");
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
    Pipeline pipeline = loaded(shapes::with_noise(shapes::waves(3000), 0.002), device.info.kind);
    Params params{.k = 8, .normal_sigma = 0.05, .closeness_sigma = 0.05, .similarity_sigma = 0.05};
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
    params.iterations = 1;
    names();
    params.similarity_sigma = 0.07;
    EXPECT_EQ(names(), (Names{"fairing", "download"}));
  }
}

}  // namespace
}  // namespace pointfair
