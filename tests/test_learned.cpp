// SPDX-License-Identifier: Apache-2.0
// Method learned: the net against the integer reference in Python, its promises, and files of weights.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "cpu/refinement.h"
#include "every_kernel.h"
#include "learned_clouds.h"
#include "pointfair/pipeline.hpp"
#include "runs.h"
#include "shapes.h"

namespace pointfair {
namespace {

using shapes::Points;

using learned_clouds::bytes_of;
using learned_clouds::kWeightsFile;

bool same_bits(const Points& a, const Points& b) { return learned_clouds::differing(a, b) == 0; }

Points learned(const Points& points, unsigned threads = 1, Params params = {}) {
  params.method = Method::learned;
  return Ran(points, params, threads).points;
}
Points classical(const Points& points) { return Ran(points, {}, 1).points; }

using shapes::distance;

TEST(Learned, every_instruction_set_gives_the_bits_of_the_integer_reference) {
  const std::vector<learned_clouds::Golden> clouds = learned_clouds::golden_clouds();
  ASSERT_EQ(clouds.size(), 20u);
  for (std::size_t n = 0; n < clouds.size(); ++n) {
    const auto expect_same = [&](const cpu::Kernels& kernels, const cpu::NetKernels& net_kernels) {
      Points out(clouds[n].measured.size());
      cpu::refine(clouds[n].input(), *own_net_weights(), clouds[n].frame, kernels, net_kernels, out, {});
      EXPECT_EQ(learned_clouds::differing(out, clouds[n].refined), 0u)
          << n << " " << kernels.name << ", " << net_kernels.name;
    };
    for (const cpu::Kernels* kernels : available_kernels()) expect_same(*kernels, cpu::best_net_kernels());
    for (const cpu::NetKernels* net_kernels : available_net_kernels()) expect_same(cpu::best_kernels(), *net_kernels);
  }
}

TEST(Learned, threads_and_the_order_of_points_do_not_change_a_bit) {
  for (const Points& points :
       {shapes::with_noise(shapes::waves(12000), 0.004), shapes::with_noise(shapes::uneven(9000, 1000), 0.0005),
        shapes::flat_grid(60), shapes::with_noise(shapes::with_invalid(shapes::sphere(9000), 11), 0.01)}) {
    const Points expected = learned(points);
    EXPECT_TRUE(same_bits(learned(points, 3), expected));
    const std::vector<std::uint32_t> order = shapes::shuffle_order(points.size(), 5);
    EXPECT_TRUE(same_bits(learned(shapes::permuted(points, order), 2), shapes::permuted(expected, order)));
  }
}

TEST(Learned, no_point_leaves_the_default_run_by_more_than_one_noise) {
  Params params;
  params.displacement_limit = 1;  // which would hold the default run's result back, too
  Pipeline pipeline(Device(Device::cpu));
  for (const Points& points :
       {shapes::with_noise(shapes::cube(6000), 0.02), shapes::with_noise(shapes::uneven(6000, 1000), 0.01)}) {
    const Points before = result_of(pipeline, points, params);
    std::vector<float> noise(points.size());
    pipeline.noise(noise);
    const Points after = learned(points, 1, params);
    double farthest = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      farthest = std::max(farthest, distance(before[i], after[i]) / double(noise[i]));
    EXPECT_LE(farthest, 1.0001);
    EXPECT_GT(farthest, 0.5);
  }
}

// Mean distance to the unit sphere.
double left(const Points& points) {
  return shapes::mean_error(points, [](Point p) { return std::hypot(p.x, p.y, p.z) - 1; });
}

TEST(Learned, leaves_less_noise_than_the_default_run_and_stays_near_its_result) {
  const double sigma = 0.02;
  const Points noisy = shapes::with_noise(shapes::sphere(20000), sigma);
  const Points before = classical(noisy), after = learned(noisy);
  EXPECT_LT(left(after), left(before));
  double farthest = 0;
  for (std::size_t i = 0; i < noisy.size(); ++i) farthest = std::max(farthest, distance(before[i], after[i]));
  EXPECT_GT(farthest, 0);
  EXPECT_LT(farthest, 1.5 * sigma);  // one noise, as the program believes it
}

TEST(Learned, clean_clouds_move_by_a_hundredth_of_the_spacing_at_most) {
  for (const Points& points : {shapes::waves(20000), shapes::sphere(20000), shapes::cube(20000)}) {
    Pipeline pipeline = loaded(points, Device(Device::cpu));
    const double spacing = pipeline.estimates().spacing;
    const Points moved = learned(points);
    double squares = 0;
    for (std::size_t i = 0; i < points.size(); ++i) squares += std::pow(distance(points[i], moved[i]), 2);
    EXPECT_LT(std::sqrt(squares / double(points.size())), 0.01 * spacing);
  }
}

TEST(Learned, the_net_says_how_far_it_is_and_stops_when_told) {
  const Points points = shapes::with_noise(shapes::sphere(6000), 0.02);
  const Points expected = learned(points);
  Pipeline pipeline = loaded(points, Device(Device::cpu));
  Points out(points.size());
  std::vector<double> shares, of_net;
  const Params params{.method = Method::learned};
  pipeline.run(params, out, {}, [&](double share, std::string_view stage) {
    shares.push_back(share);
    if (stage == "net") of_net.push_back(share);
  });
  EXPECT_TRUE(same_bits(out, expected));
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  ASSERT_GT(of_net.size(), 10u);
  EXPECT_LT(of_net.front(), 0.5);
  EXPECT_EQ(shares.back(), 1);

  std::stop_source stop;
  expect_error(ErrorKind::interrupted, "", [&] {
    pipeline.run(params, out, stop.get_token(), [&](double share, std::string_view stage) {
      EXPECT_LT(share, 0.7);
      if (stage == "net" && share > 0.5) stop.request_stop();
    });
  });
}

// By 3-4-5 and 7-24-25 angles about two axes.
Points turned(const Points& from) {
  Points to;
  for (const Point& p : from)
    to.push_back(shapes::make_point(0.6 * p.x - 0.8 * p.y, 0.96 * (0.8 * p.x + 0.6 * p.y) - 0.28 * p.z,
                                    0.28 * (0.8 * p.x + 0.6 * p.y) + 0.96 * p.z));
  return to;
}

// Of so few points that all scales are the finest one: which points coarse scales hold depends on the coordinates.
TEST(Learned, turning_the_cloud_turns_the_net) {
  const float sigma = 0.1f;
  const Points clean = shapes::sphere(60), measured = shapes::with_noise(clean, sigma),
               smoothed = shapes::with_noise(clean, 0.3 * sigma, 8);
  const std::vector<float> noise(clean.size(), sigma);
  const std::vector<std::uint8_t> held(clean.size());
  const auto refined = [&](const Points& m, const Points& c, const Points& n) {
    Points out(m.size());
    refine({m, c, n, noise, held}, *own_net_weights(), {}, out, {});
    return out;
  };
  const Points expected = turned(refined(measured, smoothed, clean)),
               result = refined(turned(measured), turned(smoothed), turned(clean));
  double way = 0;
  for (std::size_t i = 0; i < clean.size(); ++i) {
    EXPECT_LT(distance(expected[i], result[i]), 0.05 * sigma) << i;
    way += distance(refined(measured, smoothed, clean)[i], smoothed[i]) / double(clean.size());
  }
  EXPECT_GT(way, 0.1 * sigma);
}

TEST(Learned, a_turned_cloud_keeps_as_little_noise) {
  const Points points = shapes::with_noise(shapes::sphere(20000), 0.02);
  EXPECT_NEAR(left(learned(turned(points))) / left(learned(points)), 1, 0.1);
}

TEST(Learned, points_without_a_surface_and_small_clouds_are_as_in_the_default_run) {
  for (const Points& points : {Points{}, shapes::identical(40), shapes::line(50), shapes::sphere(10),
                               shapes::with_invalid(shapes::plane(30), 2)})
    EXPECT_TRUE(same_bits(learned(points), classical(points))) << points.size();
  const Points stray = shapes::with_stray(shapes::with_noise(shapes::sphere(5000), 0.01), 50);
  const Points before = classical(stray), after = learned(stray);
  ASSERT_EQ(distance(stray.back(), before.back()), 0);
  EXPECT_EQ(distance(stray.back(), after.back()), 0);
}

TEST(Learned, the_displacement_limit_holds_for_the_whole_way) {
  const Points points = shapes::with_noise(shapes::sphere(8000), 0.02);
  const Points after = learned(points, 1, {.displacement_limit = 0.004});
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LE(distance(points[i], after[i]), 0.004 * 1.0001);
}

std::string refusal(const std::vector<std::byte>& bytes) {
  Pipeline pipeline(Device(Device::cpu));
  const test::Thrown thrown = test::thrown_by([&] { pipeline.set_weights(bytes, "net.bin"); });
  EXPECT_EQ(thrown.kind, ErrorKind::file);
  return thrown.message;
}

TEST(Learned, weights_that_do_not_fit_give_one_clear_line) {
  const std::vector<std::byte> sound = bytes_of(kWeightsFile);
  std::vector<std::byte> cut(sound.begin(), sound.end() - 100), foreign(5000, std::byte('x')),
      newer = sound, older = sound, damaged = sound;
  newer[8] = std::byte(3);
  older[8] = std::byte(1);
  damaged[5000] ^= std::byte(1);
  EXPECT_EQ(refusal(cut), "net.bin: the file of weights has 89504 bytes instead of 89604: it is cut or damaged");
  EXPECT_EQ(refusal({sound.begin(), sound.begin() + 20}), "net.bin: the file of weights is cut after 20 bytes");
  EXPECT_EQ(refusal(foreign), "net.bin: this is no file of weights for --method learned");
  EXPECT_EQ(refusal(newer),
            "net.bin: the weights have version 3, and this program reads version 2; use a newer program");
  EXPECT_EQ(refusal(older), "net.bin: the weights have version 1, and this program reads version 2: train them anew");
  EXPECT_EQ(refusal(damaged), "net.bin: the weights are damaged: their fingerprint does not fit");
}

TEST(Learned, a_given_file_takes_the_place_of_the_own_weights) {
  const Points points = shapes::with_noise(shapes::sphere(3000), 0.02);
  Params params{.method = Method::learned};
  Pipeline pipeline(Device(Device::cpu));
  pipeline.set_weights(bytes_of(kWeightsFile), "own");
  EXPECT_TRUE(same_bits(result_of(pipeline, points, params), learned(points)));
  EXPECT_EQ(pipeline.report().params.method, Method::learned);
}

}  // namespace
}  // namespace pointfair
