// SPDX-License-Identifier: Apache-2.0
// Which results of a part of a cloud are said to be those of the whole.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <utility>

#include "backend_runs.h"
#include "point/region.h"
#include "seam/exactness.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

std::vector<std::pair<const char*, StageSettings>> several_settings() {
  StageSettings listed{.normals = {{0.02f}}, .fairing = {{0.02f, 0.01f}, Method::bilateral, AreaWeight::length}};
  StageSettings filtered = listed;
  filtered.normals.filter_rounds = 2;
  filtered.normals.crease_angle = 20;
  StageSettings smoothed = filtered;
  smoothed.fairing.method = Method::wiener;
  StageSettings wide = filtered;
  wide.neighbors = {0, 0.02f, false, 0, 16};
  wide.normals.sigma = 1.4f;
  wide.normals.of_radius = true;
  wide.fairing = {{0.6f, 0.01f}};
  wide.fairing.closeness_of_radius = wide.fairing.symmetric = true;
  wide.fairing.turn_angle = 40;
  wide.frame = frame_over({-1.5f, -1.5f, -1.5f}, 3);
  StageSettings growing = wide;
  growing.normals.flat_scale = 1.8f;
  return {{"lists", listed},
          {"filtered normals", filtered},
          {"displacements of neighbours", smoothed},
          {"radii", wide},
          {"radii that grow", growing}};
}

struct Part {
  Points points;
  std::vector<std::size_t> of_whole;
};

Part part_inside(const Points& whole, const point::Region& region) {
  Part part;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    if (!point::is_inside(region, {whole[i].x, whole[i].y, whole[i].z})) continue;
    part.points.push_back(whole[i]);
    part.of_whole.push_back(i);
  }
  return part;
}

// All with x from this on.
point::Region beyond(float x) {
  const float far = std::numeric_limits<float>::infinity();
  return {{x, -far, -far}, {far, far, far}};
}

std::vector<unsigned char> outcomes_of(Backend& backend, const point::Region& region, std::size_t count) {
  std::vector<unsigned char> outcomes(count);
  backend.exactness()->outcomes(region, outcomes);
  return outcomes;
}

TEST(Outcomes, what_is_called_exact_has_the_bits_of_the_whole) {
  const Points whole = shapes::with_noise(shapes::sphere(40000), 0.002);
  const point::Region region = beyond(-0.3f);
  const Part part = part_inside(whole, region);
  for (const auto& [name, settings] : several_settings()) {
    SCOPED_TRACE(name);
    const auto backend = make_cpu_backend(2);
    const StageResults expected = run(*backend, whole, settings);
    const StageResults found = run(*backend, part.points, settings);
    const std::vector<unsigned char> outcomes = outcomes_of(*backend, region, part.points.size());
    std::size_t exact = 0, wrong = 0, others = 0;
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      const Point &a = expected.points[part.of_whole[i]], &b = found.points[i];
      const bool same = std::memcmp(&a, &b, sizeof a) == 0;
      const bool is_exact = (outcomes[i] & point::kExact) != 0;
      exact += is_exact;
      wrong += is_exact && !same;
      others += !is_exact && !same;
    }
    EXPECT_EQ(wrong, 0u);
    EXPECT_GT(others, 0u);
    EXPECT_GT(exact, outcomes.size() * 8 / 10);
  }
}

// Nobody has the middle of the sphere as a neighbour. Its own neighbourhood is not exact though it lies deep in the
// region, so that hardly a point lies deeper than all that are not.
TEST(Outcomes, of_others_are_the_same_with_a_point_that_is_not_exact_deep_inside) {
  const point::Region region = beyond(-0.3f);
  const Part part = part_inside(shapes::with_noise(shapes::sphere(40000), 0.002), region);
  Points with_middle = part.points;
  with_middle.push_back({0, 0, 0});
  for (const auto& [name, settings] : several_settings()) {
    SCOPED_TRACE(name);
    const auto backend = make_cpu_backend(2);
    run(*backend, part.points, settings);
    const std::vector<unsigned char> without = outcomes_of(*backend, region, part.points.size());
    run(*backend, with_middle, settings);
    std::vector<unsigned char> with = outcomes_of(*backend, region, with_middle.size());
    EXPECT_EQ(with.back() & point::kExact, 0);
    with.pop_back();
    EXPECT_EQ(without, with);
  }
}

}  // namespace
}  // namespace pointfair
