// SPDX-License-Identifier: Apache-2.0
// A session with a page in memory, and what a fresh pipeline gives.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "shapes.h"
#include "viewer_page.h"

namespace pointfair::viewer {

using Points = std::vector<Point>;

inline Points noisy(int count) { return shapes::with_noise(shapes::waves(count), 0.004); }

inline Cloud cloud_of(Points points) { return {.points = std::move(points)}; }

inline Session::Options cpu_options() {
  Session::Options options;
  options.make_pipeline = [] { return Pipeline(Device::cpu); };
  return options;
}

inline std::string run_text(int id, const Json& params, const Json& limits = Json::object()) {
  return Json{{"type", "run"}, {"id", id}, {"params", params}, {"limits", limits}}.dump();
}

// A session with a page, and the normals that the page has.
struct Seat {
  Points points;
  FakePage page;
  Session session;

  explicit Seat(Points its_points, Session::Options options = cpu_options())
      : points(std::move(its_points)), session(std::move(options), page.send()) {
    session.open(cloud_of(points), "scan.ply");
    EXPECT_TRUE(session.greet());
    page.wait_for("cloud");
  }

  void ask(std::string_view text) { EXPECT_TRUE(session.receive(text)); }
  Decoded result(int id) { return page.wait_for("result", id); }

  std::vector<std::int16_t> normals_until(int id) {
    std::vector<std::int16_t> normals;
    for (const Decoded& message : page.all()) {
      if (!message.is("result")) continue;
      for (const Json& row : message.head["arrays"])
        if (row[0] == "motion_normals") normals = message.array<std::int16_t>("motion_normals");
      if (message.head["id"] == id) break;
    }
    return normals;
  }

  // The largest error of what the page shows against the points expected, in spacings.
  double error_of(int id, const Points& expected) {
    const Decoded message = result(id);
    const double spacing = double(page.wait_for("cloud").head["spacing"]);
    const Points moved = displacements(message, normals_until(id), points.size());
    double worst = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double x = double{points[i].x} + moved[i].x - expected[i].x,
                   y = double{points[i].y} + moved[i].y - expected[i].y,
                   z = double{points[i].z} + moved[i].z - expected[i].z;
      worst = std::max(worst, std::sqrt(x * x + y * y + z * z));
    }
    return worst / spacing;
  }
};

inline Points fresh_run(const Points& points, const Json& params) {
  Params wanted;
  for (const auto& [name, text] : params.items()) set_param(wanted, *find_param(name), text.get<std::string>());
  return Ran(points, wanted).points;
}

}  // namespace pointfair::viewer
