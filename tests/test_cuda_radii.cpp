// SPDX-License-Identifier: Apache-2.0
// Sums over radius neighbourhoods on a card, and the default run, which is made of them.
#include <memory>
#include <utility>

#include "cuda_backend_test.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pipeline.hpp"
#include "tiles/tiled_backend.hpp"

namespace pointfair {
namespace {

StageSettings within_radius(float radius, int min_neighbors = 0) {
  StageSettings settings = with_filter_and_both_planes(with_neighbors(0, radius));
  settings.normals.flat_scale = 1.6f;
  settings.neighbors.min_neighbors = min_neighbors;
  if (min_neighbors == 0) return settings;
  settings.normals.sigma = 1.4f;
  settings.normals.of_radius = true;
  settings.fairing.closeness_sigma = 0.6f;
  settings.fairing.closeness_of_radius = true;
  return settings;
}

// Sums within radii run along one curve, of whose cube a part of the unit sphere lies outside.
class CudaRadii : public CudaBackendTest {
 protected:
  void expect_same(const std::vector<Point>& whole, StageSettings settings, const char* what) {
    settings.frame = frame_over({-1.2f, -1.1f, -1.0f}, 2.1f);
    CudaBackendTest::expect_same(whole, settings, what);
  }
};

TEST_F(CudaRadii, equal_the_cpu) {
  const std::vector<Point> points = noisy_sphere(50000, 10, 0.002);
  expect_same(points, with_neighbors(0, 0.03f), "one radius");
  expect_same(points, within_radius(0.03f), "one radius, filtered, both planes");
  StageSettings settings = within_radius(0.03f);
  settings.fairing.area_weight = AreaWeight::squared;
  expect_same(points, settings, "area weight");
}

TEST_F(CudaRadii, that_follow_the_density_equal_the_cpu) {
  for (const int min_neighbors : {4, 16, 40}) {
    StageSettings settings = within_radius(0.02f, min_neighbors);
    expect_same(noisy_sphere(50000, 10, 0.002), settings, "sphere");
    expect_same(uneven_sphere(50000, 7), settings, "uneven");
    settings.iterations = 3;
    expect_same(noisy_sphere(50000, 12, 0.002), settings, "three iterations");
  }
}

TEST_F(CudaRadii, of_strays_equal_the_cpu) {
  std::vector<Point> points = noisy_sphere(50000, 23, 0.002);
  shapes::Random random(24);
  const auto anywhere = [&] { return float(random.uniform(-1.2, 1.2)); };
  for (std::size_t i = 0; i < points.size(); i += 100) points[i] = {anywhere(), anywhere(), anywhere()};
  StageSettings settings = within_radius(0.02f, 16);
  settings.fairing.outlier_distance = 0.012f;
  settings.fairing.outlier_radius = 0.1f;
  settings.limits = {{0.008f, 0.012f}};
  settings.iterations = 2;
  expect_same(points, settings, "held back");
  settings.fairing.pull_outliers = true;
  expect_same(points, settings, "pulled in");
}

TEST_F(CudaRadii, that_follow_the_noise_equal_the_cpu) {
  const std::vector<Point> points = noisy_sphere(50000, 29, 0.004);
  StageSettings settings = within_radius(0.008f, 16);
  settings.fairing.outlier_distance = 0.01f;
  settings.fairing.outlier_radius = 0.1f;
  settings.limits = {{0.006f, 0.01f}};
  for (const int iterations : {1, 3}) {
    settings.iterations = iterations;
    follow_noise(settings, {-0.9f, -0.8f, -0.7f}, 1.5f, 0.003f);
    expect_same(points, settings, "levels and shares");
    settings.neighbors.radius_follows = settings.fairing.similarity_follows = false;
    expect_same(points, settings, "levels of limits alone");
    settings.fairing.outlier_distance = 0;
    expect_same(points, settings, "shares without outliers");
    settings.fairing.outlier_distance = 0.01f;
  }
}

TEST_F(CudaRadii, that_are_thinned_equal_the_cpu) {
  expect_same(noisy_sphere(50000, 18, 0.002), within_radius(0.2f, 8), "thinned");
}

TEST_F(CudaRadii, that_grow_where_the_surface_is_flat_equal_the_cpu) {
  const std::vector<Point> cube = shapes::with_noise(shapes::cube(50000), 0.002);
  expect_same(cube, within_radius(0.03f), "one radius");
  expect_same(cube, within_radius(0.015f, 16), "that follow the density");
  expect_same(cube, within_radius(0.2f, 8), "thinned");
  expect_same(shapes::cube(30000), within_radius(1.5f), "too large to be collected");
}

TEST_F(CudaRadii, that_are_too_large_to_be_collected_equal_the_cpu) {
  expect_same(noisy_sphere(5000, 19, 0.002), within_radius(1.5f), "most of the sphere");
}

TEST_F(CudaRadii, of_hard_clouds_equal_the_cpu) {
  const std::vector<Point> even = noisy_sphere(30000, 20, 0.002);
  std::vector<Point> cloud = even;
  cloud[777] = {1e6f, -1e6f, 1e6f};
  cloud[778] = {3e17f, 3e17f, -3e17f};
  for (std::size_t i = 0; i < cloud.size(); i += 70) cloud[i].y = kNan;
  expect_same(cloud, within_radius(0.02f, 16), "stray and invalid points");
  cloud = even;
  for (std::size_t i = 0; i < 300; ++i) cloud[5 * i] = {0.5f, 0.25f, 0.125f};
  for (std::size_t i = 0; i < 3000; ++i) cloud[5 * i + 1] = cloud[5 * i + 2];
  expect_same(cloud, within_radius(0.02f, 16), "identical points");
  for (const int count : {0, 1, 2, 3, 31, 32, 33, 65})
    expect_same(shapes::sphere(count), within_radius(0.7f, 4), "tiny");
  expect_same(std::vector<Point>(100, Point{kNan, 0, 0}), within_radius(0.7f), "nothing valid");
}

TEST_F(CudaRadii, equal_the_cpu_on_a_million_points) {
  expect_same(noisy_sphere(1000000, 21, 0.003), within_radius(0.008f, 16), "a million");
}

TEST_F(CudaRadii, of_the_default_run_equal_the_cpu) {
  const std::vector<Point> points = cut(noisy_sphere(60000, 22, 0.01));
  Pipeline cuda(Device::cuda), cpu(Device::cpu);
  EXPECT_EQ(difference(result_of(cuda, points), result_of(cpu, points)), "");
  EXPECT_EQ(cuda.report().params.radius.value, cpu.report().params.radius.value);
}

// Two workers and five tiles, whose halos are found on the card.
TEST_F(CudaRadii, of_a_cloud_in_tiles_equal_those_of_the_whole_on_the_cpu) {
  for (const std::vector<Point>& whole :
       {noisy_sphere(60000, 25, 0.01), shapes::with_noise(shapes::cube(60000), 0.003), uneven_sphere(60000, 20)}) {
    const std::vector<Point> points = cut(whole);
    std::vector<std::unique_ptr<Backend>> workers;
    for (int i = 0; i < 2; ++i) workers.push_back(make_cuda_backend(0));
    Pipeline tiles = PipelineAccess::make(make_tiled_backend(std::move(workers), {5}), {Device::cuda, "", ""});
    Pipeline cpu(Device::cpu);
    std::vector<Point> in_tiles(points.size()), on_cpu(points.size());
    tiles.load(points);
    cpu.load(points);
    for (const std::optional<double> flat_scale : {std::optional<double>(), std::optional<double>(1)}) {
      Params params{.flat_scale = flat_scale};
      tiles.run(params, in_tiles);
      cpu.run(params, on_cpu);
      EXPECT_EQ(difference(in_tiles, on_cpu), "") << flat_scale.value_or(0);
    }
  }
}

TEST_F(CudaRadii, equal_the_cpu_with_every_method) {
  for (const Method method : kOtherMethods) {
    const std::string name = "method " + std::to_string(int(method));
    StageSettings settings = with_method(with_neighbors(0, 0.02f), method);
    settings.neighbors.min_neighbors = 16;
    settings.fairing.closeness_sigma = 0.5f;
    settings.fairing.closeness_of_radius = true;
    settings.fairing.area_weight = AreaWeight::length;
    expect_same(noisy_sphere(50000, 20, 0.002), settings, name.c_str());
    settings.neighbors = {0, 0.03f};
    settings.fairing.closeness_sigma = 0.02f;
    settings.fairing.closeness_of_radius = false;
    expect_same(noisy_sphere(50000, 21, 0.002), settings, (name + ", one radius").c_str());
  }
}

}  // namespace
}  // namespace pointfair
