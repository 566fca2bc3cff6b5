// SPDX-License-Identifier: Apache-2.0
// Samples and estimates that a card makes against those of the CPU, in all bits.
#include <bit>
#include <cmath>
#include <numeric>

#include "cuda_backend_test.h"
#include "estimate/estimate.hpp"
#include "tiles/tiled_backend.hpp"

namespace pointfair {
namespace {

using Bits = std::vector<std::uint64_t>;

Bits bits_of(const Samples& samples) {
  Bits bits;
  const auto add = [&](auto... values) { (bits.push_back(std::bit_cast<std::uint64_t>(double(values))), ...); };
  for (const point::SpacingSample& s : samples.spacing) add(s.mean, s.last);
  for (const point::NoiseSample& s : samples.noise)
    add(s.is_short, s.shows_noise, s.is_wide, s.sigma, s.spacing, s.gap);
  for (const point::ResidualSample& s : samples.residuals()) add(s.narrow, s.wide, s.widest);
  return bits;
}

Bits bits_of(const Estimate& found) {
  Bits bits;
  const Noise& noise = found.noise;
  for (const double value : {found.spacing.mean, found.spacing.rho, noise.sigma, noise.surface_spacing,
                             noise.shape_to_noise, noise.gap, double(noise.is_shared), noise.confined})
    bits.push_back(std::bit_cast<std::uint64_t>(value));
  return bits;
}

// Lines of a scanner, across which points are 25 times as far apart as along.
std::vector<Point> scan_lines(double noise) {
  shapes::Random random(5);
  std::vector<Point> points;
  for (int line = 0; line < 40; ++line)
    for (int i = 0; i < 1000; ++i) {
      const double x = 0.001 * (i + random.uniform()), y = 0.025 * line;
      points.push_back(shapes::make_point(x, y, 0.05 * std::sin(4 * x) * std::cos(3 * y) + noise * random.normal()));
    }
  return points;
}

class CudaEstimates : public CudaBackendTest {
 protected:
  static void load(Backend& backend, const std::vector<Point>& points) {
    backend.upload(points, IndexOrder::fastest);
    backend.build_index(0, {}, {});
  }

  static Estimate estimate_of(Backend& backend, WantedEstimates wanted, const std::stop_token& stop = {}) {
    Sampling& sampling = backend.sampling();
    return estimate(sampling, sampling.sample_cloud(kSampledPoints), wanted, stop);
  }

  void expect_same(const std::vector<Point>& whole, const char* what) {
    SCOPED_TRACE(what);
    const std::vector<Point> points = cut(whole);
    std::vector<std::unique_ptr<Backend>> workers;
    workers.push_back(make_cuda_backend(0));
    const auto in_tiles = make_tiled_backend(std::move(workers), {3});
    std::vector<Backend*> cards = {cuda_.get()};
    if (points.size() > 1024) cards.insert(cards.end(), {&in_parts(points.size()), in_tiles.get()});
    load(*cpu_, points);
    const Estimate expected = estimate_of(*cpu_, {true, true});
    std::vector<std::uint32_t> queries;
    for (std::size_t i = 0; i < points.size(); i += points.size() / 300 + 1) queries.push_back(std::uint32_t(i));
    const std::vector<SampleRule> rules = {{.sheets = true}, {.stride = 2}, {.stride = 4}, {.stride = 16}};
    const auto samples_of = [&](Backend& backend) {
      std::vector<Bits> bits = {bits_of(backend.sampling().take_samples(queries, queries, {}))};
      for (const SampleRule& rule : rules)
        bits.push_back(bits_of(backend.sampling().take_samples_by(rule, queries, {})));
      return bits;
    };
    const std::vector<Bits> samples = samples_of(*cpu_);
    for (Backend* card : cards) {
      load(*card, points);
      EXPECT_EQ(samples_of(*card), samples);
      EXPECT_EQ(bits_of(estimate_of(*card, {true, true})), bits_of(expected));
    }
    EXPECT_EQ(estimate_of(*cuda_, {.spacing = true}).spacing.mean, expected.spacing.mean);
    EXPECT_EQ(estimate_of(*cuda_, {.noise = true}).noise.sigma, expected.noise.sigma);
  }
};

TEST_F(CudaEstimates, equal_those_of_the_cpu_on_surfaces) {
  for (const double noise : {0.0, 0.0005, 0.003, 0.02, 0.1}) expect_same(noisy_sphere(50000, 3, noise), "a sphere");
  expect_same(uneven_sphere(50000, 7), "density 50:1");
}

TEST_F(CudaEstimates, equal_those_of_the_cpu_on_sheets_edges_and_lines) {
  for (const double noise : {0.0, 0.001, 0.0018}) {
    expect_same(shapes::with_noise(shapes::two_sheets(20000, 0.015), noise), "two sheets");
    expect_same(shapes::with_noise(shapes::cube(20000), noise), "edges");
    expect_same(scan_lines(noise), "scan lines");
  }
}

TEST_F(CudaEstimates, equal_those_of_the_cpu_on_hard_clouds) {
  const std::vector<Point> even = noisy_sphere(30000, 12, 0.002);
  std::vector<Point> cloud = even;
  for (std::size_t i = 0; i < cloud.size(); i += 7)
    cloud[i].y = i % 2 == 0 ? kNan : std::numeric_limits<float>::infinity();
  cloud[8] = {1e30f, 0, 0};
  expect_same(cloud, "invalid points");
  for (std::size_t i = 9000; i < 25000; ++i) cloud[i].x = kNan;
  expect_same(cloud, "mostly invalid points");
  cloud = even;
  cloud[0] = {1e6f, -1e6f, 1e6f};
  expect_same(cloud, "a stray point");
  for (std::size_t i = 0; i < 6000; ++i) cloud[5 * i] = {0.5f, 0.25f, 0.125f};
  expect_same(cloud, "6000 identical");
  for (Point& p : cloud) p = {std::round(p.x * 100) / 100, std::round(p.y * 100) / 100, std::round(p.z * 100) / 100};
  expect_same(cloud, "quantised");
  expect_same(std::vector<Point>(5000, Point{1, 2, 3}), "all identical");
  expect_same(lattice(20), "a lattice");
  expect_same(std::vector<Point>(100, Point{kNan, 0, 0}), "nothing valid");
}

TEST_F(CudaEstimates, equal_those_of_the_cpu_on_few_points) {
  for (const int count : {0, 1, 2, 5, 7, 14, 15, 16, 31, 59, 60, 61, 115, 116, 117, 600, 601, 602, 2100})
    expect_same(shapes::with_noise(shapes::sphere(count), 0.02), std::to_string(count).c_str());
}

TEST_F(CudaEstimates, are_given_up_after_a_stop) {
  const std::vector<Point> points = noisy_sphere(3000, 12, 0.002);
  load(*cuda_, points);
  std::stop_source source;
  source.request_stop();
  EXPECT_THROW(estimate_of(*cuda_, {true, true}, source.get_token()), Error);
}

}  // namespace
}  // namespace pointfair
