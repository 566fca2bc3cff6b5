// SPDX-License-Identifier: Apache-2.0
// Limits that a page sets. Oracle: the library's own on a fresh pipeline.
#include <gtest/gtest.h>

#include <cmath>

#include "viewer_seat.h"

namespace pointfair::viewer {
namespace {

TEST(ViewerSession, LimitsHoldPointsStill) {
  Seat seat(noisy(3000));
  seat.ask(run_text(1, {{"k", "16"}, {"iterations", "1"}}, {{"box", "0,-10,-10,10,10,10"}}));
  const Decoded result = seat.result(1);
  const Points moved = displacements(result, seat.normals_until(1), seat.points.size());
  int inside = 0;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const bool still = moved[i].x == 0 && moved[i].y == 0 && moved[i].z == 0;
    EXPECT_TRUE(still || seat.points[i].x >= 0) << i;
    inside += !still;
  }
  EXPECT_GT(inside, 100);
}

TEST(ViewerSession, IgnoredPointsComeAndGoWithTheirLimit) {
  Cloud cloud = cloud_of(noisy(3000));
  Attribute& classes = cloud.added.emplace_back();
  classes.name = "classification";
  classes.type = ScalarType::uint8;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) classes.data.push_back(std::byte{i % 4 == 0});
  FakePage page;
  Session session(cpu_options(), page.send());
  session.open(cloud, "scan.ply");
  EXPECT_TRUE(session.greet());
  page.wait_for("cloud");
  const Json params{{"k", "16"}, {"iterations", "2"}};  // two, so that whole displacements are sent
  int id = 0;
  for (const char* ignore : {"", "classification=1", "", "classification=0"}) {
    const Json limits{{"ignore", ignore}};
    EXPECT_TRUE(session.receive(run_text(++id, params, limits)));
    const Decoded result = page.wait_for("result", id);
    Limits same;
    set_limit(same, "ignore", ignore);
    Pipeline pipeline(Device::cpu);
    pipeline.load(without_ignored(same, cloud));
    Cloud expected = pipeline.run({.k = 16, .iterations = 2});
    apply_limits(same, cloud, expected);
    const double moved = shapes::mean_distance(expected.points, cloud.points);
    EXPECT_NEAR(result.head["moved"]["mean"].get<double>(), moved, 1e-5) << ignore;
  }
  EXPECT_TRUE(session.receive(run_text(++id, params, {{"where", "height=1"}})));
  EXPECT_NE(page.wait_for("error", id).head["message"].get<std::string>().find("no attribute 'height'"),
            std::string::npos);
}

}  // namespace
}  // namespace pointfair::viewer
