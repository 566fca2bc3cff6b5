// SPDX-License-Identifier: Apache-2.0
// Radii that follow noise and shape (Eq. 18 of docs/how-it-works.md): which way, and that they leave less noise than
// one width for all shapes.
#include <gtest/gtest.h>

#include <cmath>

#include "estimate/automatic.hpp"
#include "pointfair/pointfair.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

Params resolved(const Noise& noise, Method method = Method::bilateral) {
  return resolve({.method = method}, {{1, 1}, noise}, 100).params;
}

// Noise in spacings of 1.
Noise noise_of(double sigma, double confined = 0) {
  Noise noise{sigma, 1};
  noise.confined = confined;
  return noise;
}

TEST(Automatic, radii_grow_with_the_noise_and_are_smaller_where_shapes_are_thin) {
  for (const double sigma : {0.3, 0.6, 1.2, 2.4}) {
    const double radius = resolved(noise_of(sigma)).radius.value;
    EXPECT_GT(resolved(noise_of(2 * sigma)).radius.value, radius) << sigma;
    EXPECT_LT(resolved(noise_of(sigma, 1)).radius.value, radius) << sigma;
    EXPECT_LT(resolved(noise_of(sigma, 1)).min_neighbors, resolved(noise_of(sigma)).min_neighbors) << sigma;
  }
}

TEST(Automatic, radii_follow_the_shape_where_normals_are_filtered_only_and_no_second_sheet_is_near) {
  Noise noise = noise_of(1);
  EXPECT_NEAR(resolved(noise, Method::laplacian).radius.value, 2.5, 1e-9);
  EXPECT_EQ(resolved(noise, Method::laplacian).min_neighbors, 16);
  EXPECT_GT(resolved(noise).radius.value, 2.6);
  noise.gap = 3;
  EXPECT_NEAR(resolved(noise).radius.value, 2.5, 1e-9);
}

TEST(Automatic, normals_of_noisy_clouds_mix_in_larger_flat_places) {
  const Params quiet = resolved(noise_of(0.1)), noisy = resolved(noise_of(2));
  EXPECT_LT(quiet.flat_scale, noisy.flat_scale);
  EXPECT_EQ(resolved(noise_of(2), Method::laplacian).flat_scale, 1);  // which reads no filtered normals
}

TEST(Automatic, a_given_radius_changes_nothing_else) {
  const Noise noise = noise_of(0.4);
  const Params automatic = resolved(noise);
  Params params{.radius = automatic.radius};
  EXPECT_EQ(resolve(params, {{1, 1}, noise}, 100).params, automatic);
  params.radius = 2 * automatic.radius.value;
  const Params wider = resolve(params, {{1, 1}, noise}, 100).params;
  EXPECT_EQ(wider.min_neighbors, automatic.min_neighbors);
  EXPECT_EQ(wider.flat_scale, automatic.flat_scale);
  EXPECT_EQ(wider.relaxation, automatic.relaxation);
}

// With nothing set, and with radii of 2.5 sigma and the 16th neighbour whatever the shape; `off`: a point's distance to
// the true surface.
struct Left {
  double automatic, of_one_width;
};
Left left(const Points& noisy, double (*off)(Point)) {
  Ran automatic(noisy);
  return {reference::rms(automatic.points, off),
          reference::rms(Ran(noisy, {.radius = 2.5 * automatic.pipeline.estimates().noise, .min_neighbors = 16}).points,
                         off)};
}

TEST(Automatic, less_noise_is_left_than_by_one_radius_for_all_shapes) {
  const Left plane =
      left(shapes::with_noise(shapes::plane(10000), 0.02), [](Point p) { return double{p.z}; });  // two spacings
  EXPECT_LT(plane.automatic, 0.85 * plane.of_one_width);
  const Left round = left(shapes::with_noise(shapes::sphere(4000), 0.18),
                          [](Point p) { return std::hypot(double{p.x}, p.y, p.z) - 1; });  // a sixth of the radius
  EXPECT_LT(round.automatic, round.of_one_width);
}

}  // namespace
}  // namespace pointfair
