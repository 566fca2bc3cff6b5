// SPDX-License-Identifier: Apache-2.0
// Host memory that devices copy fast from.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "pointfair/pipeline.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

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
