// SPDX-License-Identifier: Apache-2.0
// What a page shows while a run goes on. Oracle: a fresh pipeline.
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "viewer_seat.h"

namespace pointfair::viewer {
namespace {

void expect_a_true_preview(Seat& seat, const Json& params) {
  seat.ask(run_text(1, params));
  const Decoded preview = seat.page.wait_for("preview", 1);
  const Points expected = fresh_run(seat.points, params);
  const Order order(seat.points.size());
  const double spacing = seat.page.wait_for("cloud").head["spacing"];
  const auto places = preview.array<std::uint32_t>("places");
  const auto moved = preview.array<float>("displacements");
  ASSERT_GT(places.size(), 500u);
  std::size_t close = 0;
  for (std::size_t p = 0; p < places.size(); ++p) {
    const std::uint32_t i = order.index(places[p]);
    const Point d{expected[i].x - seat.points[i].x, expected[i].y - seat.points[i].y, expected[i].z - seat.points[i].z};
    close += std::hypot(d.x - moved[3 * p], d.y - moved[3 * p + 1], d.z - moved[3 * p + 2]) < 0.02 * spacing;
  }
  EXPECT_GT(double(close), 0.98 * double(places.size()));
  seat.result(1);
}

// The page cuts the sphere out of the cloud and puts these points in its place.
TEST(ViewerSession, APreviewHoldsEveryPointWithinItsRadius) {
  Seat seat(noisy(150000));
  Json request = Json::parse(run_text(1, {{"k", "16"}, {"iterations", "2"}}));
  request["focus"] = {seat.points[777].x, seat.points[777].y, seat.points[777].z};
  seat.ask(request.dump());
  seat.result(1);
  const Order order(seat.points.size());
  int previews = 0;
  for (const Decoded& message : seat.page.all()) {
    if (!message.is("preview")) continue;
    ++previews;
    const auto places = message.array<std::uint32_t>("places");
    const std::set<std::uint32_t> held(places.begin(), places.end());
    const double radius = message.head["radius"];
    const Json& center = message.head["center"];
    for (std::size_t i = 0; i < seat.points.size(); ++i) {
      const double d = std::hypot(seat.points[i].x - double(center[0]), seat.points[i].y - double(center[1]),
                                  seat.points[i].z - double(center[2]));
      if (std::abs(d / radius - 1) > 1e-4) {
        ASSERT_EQ(held.contains(order.place(i)), d < radius) << i;
      }
    }
  }
  EXPECT_GE(previews, 1);
}

TEST(ViewerSession, AHeldSliderEndsInTheStateOfItsLastPlace) {
  Seat seat(noisy(150000));
  Json params{{"k", "16"}, {"iterations", "2"}};
  for (int id = 1; id <= 6; ++id) {
    params["similarity_sigma"] = std::to_string(0.1 * id) + "s";
    Json request = Json::parse(run_text(id, params));
    request["held"] = true;
    seat.ask(request.dump());
    seat.page.wait([id](const Decoded& m) { return (m.is("preview") || m.is("result")) && m.head["id"] == id; });
  }
  EXPECT_LT(seat.error_of(6, fresh_run(seat.points, params)), 0.01);
}

TEST(ViewerSession, ASlowRunIsPreviewedByPointsThatGoWhereTheWholeRunSendsThem) {
  for (const char* method : {"bilateral", "taubin"}) {
    Seat seat(noisy(150000));
    expect_a_true_preview(seat, {{"method", method}, {"k", "16"}, {"iterations", "2"}});
  }
}

}  // namespace
}  // namespace pointfair::viewer
