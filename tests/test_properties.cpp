// SPDX-License-Identifier: Apache-2.0
// What must hold for any cloud: the code against itself, over random shapes and parameters that are given.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pointfair/pipeline.hpp"
#include "reference.h"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points, shapes::same_bits;

struct Sample {
  Points points;
  Params params;
  double sigma;  // width of the weights, about the size of a neighbourhood
};

// A random noisy cloud without exact ties, in about the unit cube, and settled parameters that suit it.
Sample make_sample(std::uint64_t seed, bool with_list) {
  shapes::Random random(seed);
  const int count = 200 + int(random.below(800));
  const double spacing = 1 / std::sqrt(double(count)), noise = spacing * random.uniform(0.02, 0.3);
  const Points clean[] = {shapes::waves(count, seed), shapes::sphere(count, seed), shapes::cube(count, seed),
                          shapes::uneven(count, 30, seed)};
  Sample sample;
  sample.points = shapes::with_noise(clean[random.below(4)], noise, seed + 1);
  sample.sigma = spacing * random.uniform(1, 3);
  sample.params.iterations = 1;
  sample.params.outliers = Outliers::off;  // limits by the noise, which is estimated anew for every cloud
  sample.params.normal_sigma = random.below(4) != 0 ? sample.sigma : 1e9;  // the latter weighs all alike
  sample.params.closeness_sigma = sample.sigma;
  sample.params.similarity_sigma = spacing * random.uniform(0.3, 2);
  sample.params.area_weight = AreaWeight(random.below(3));
  if (with_list) sample.params.k = 6 + int(random.below(40));
  if (!with_list || random.below(3) == 0) sample.params.radius = spacing * random.uniform(2, 4);
  sample.params.min_neighbors = 1;  // the radius alone
  if (with_list && random.below(3) == 0) {
    sample.params.constraint = true;
    sample.params.rho = spacing * random.uniform(1, 3);
    sample.params.delta = noise;
  }
  sample.params.relaxation = 1;
  sample.params.normal_filter = random.below(2) == 0 ? NormalFilter::off : NormalFilter::on;
  sample.params.flat_scale = 1 + 0.2 * double(random.below(5));
  sample.params.crease_angle = 10 + int(random.below(20));
  sample.params.offset = random.below(2) == 0 ? Offset::point : Offset::symmetric;
  return sample;
}

Points fair(const Points& points, const Params& params) { return Ran(points, params, 1).points; }

// Those of `sound` whose moves read sound normals only: each round of the filter and a step over both planes read those
// of neighbours.
std::vector<bool> among_sound(std::vector<bool> sound, const Points& points, const Params& params) {
  const reference::Settings settings = reference::settings_of(params);
  std::vector<reference::List> lists;
  for (std::size_t i = 0; i < points.size(); ++i) lists.push_back(reference::neighborhood(points, i, settings));
  for (int ring = 0; ring < settings.filter_rounds + int(settings.symmetric); ++ring) {
    const std::vector<bool> before = sound;
    for (std::size_t i = 0; i < sound.size(); ++i)
      for (const std::uint32_t j : lists[i]) sound[i] = sound[i] && before[j];
  }
  return sound;
}

// Points whose move the data determines: elsewhere the last bits of the input may decide.
std::vector<bool> well_determined(const Sample& sample) {
  std::vector<bool> result;
  for (const reference::Faired& p : reference::fair_once(sample.points, reference::settings_of(sample.params)))
    result.push_back(p.neighbors < 3 || p.normal.gap > 0.03);
  return among_sound(result, sample.points, sample.params);
}

// The share of points that differ by more than `limit`, among those that are well determined. A neighbour at the edge
// of a neighbourhood may fall on its other side after rounding, so single points may differ by more.
double share_beyond(const Points& a, const Points& b, double limit, const std::vector<bool>& compared) {
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    beyond += compared[i] && !(reference::length(reference::to_vec(a[i]) - reference::to_vec(b[i])) <= limit);
  return double(beyond) / double(a.size());
}

RC_GTEST_PROP(Properties, shuffling_the_input_shuffles_the_output_bit_for_bit, (std::uint64_t seed, bool with_list)) {
  const Sample sample = make_sample(seed, with_list);
  const auto order = shapes::shuffle_order(sample.points.size(), seed);
  RC_ASSERT(same_bits(fair(shapes::permuted(sample.points, order), sample.params),
                      shapes::permuted(fair(sample.points, sample.params), order)));
}

RC_GTEST_PROP(Properties, scaling_by_a_power_of_two_commutes_bit_for_bit, (std::uint64_t seed, bool with_list)) {
  const Sample sample = make_sample(seed, with_list);
  for (const int exponent : {-20, 20}) {
    const float factor = std::ldexp(1.0f, exponent);
    Params params = sample.params;
    for (Length* length : {&params.radius, &params.rho, &params.delta, &params.normal_sigma, &params.closeness_sigma,
                           &params.similarity_sigma})
      if (!length->is_automatic()) length->value *= double(factor);
    RC_ASSERT(same_bits(fair(shapes::scaled(sample.points, factor), params),
                        shapes::scaled(fair(sample.points, sample.params), factor)));
  }
}

// Axes exchanged and mirrored: exact, but sums of squares round in another order.
RC_GTEST_PROP(Properties, rotating_commutes_within_rounding, (std::uint64_t seed, bool with_list)) {
  const Sample sample = make_sample(seed, with_list);
  shapes::Random random(seed + 5);
  const double angle_cosine = random.uniform(-1, 1), angle_sine = std::sqrt(1 - angle_cosine * angle_cosine);
  const auto turn = [&](const Points& points) {
    Points turned;
    for (const Point& p : points)
      turned.push_back(
          shapes::make_point(angle_cosine * p.x - angle_sine * p.y, p.z, angle_sine * p.x + angle_cosine * p.y));
    return turned;
  };
  const Points a = fair(turn(sample.points), sample.params), b = turn(fair(sample.points, sample.params));
  const std::vector<bool> compared = well_determined(sample);
  RC_PRE(std::count(compared.begin(), compared.end(), true) > std::ptrdiff_t(a.size()) / 2);
  RC_ASSERT(share_beyond(a, b, 1e-6 + 2e-3 * sample.sigma, compared) < 0.01);
}

// Over lists: sums within radii run in the order of the index, which is another one for moved points.
RC_GTEST_PROP(Properties, iterations_one_by_one_are_the_iterations_at_once_over_lists, (std::uint64_t seed)) {
  Sample sample = make_sample(seed, true);
  Points step = sample.points;
  for (int iteration = 0; iteration < 3; ++iteration) step = fair(step, sample.params);
  sample.params.iterations = 3;
  RC_ASSERT(same_bits(fair(sample.points, sample.params), step));
}

}  // namespace
}  // namespace pointfair
