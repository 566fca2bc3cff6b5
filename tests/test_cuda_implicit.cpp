// SPDX-License-Identifier: Apache-2.0
// Method::implicit on a card against the CPU, bit for bit, with as many iterations (test_implicit.cpp has the oracle).
#include <cmath>

#include "cuda_backend_test.h"
#include "pointfair/pipeline.hpp"

namespace pointfair {
namespace {

constexpr ImplicitWeights kWeights[] = {ImplicitWeights::uniform, ImplicitWeights::scale, ImplicitWeights::curvature};

StageSettings implicit(int k, ImplicitWeights weights, double lambda) {
  StageSettings settings = with_neighbors(k);
  settings.frame = frame_over({-1.5f, -1.5f, -1.5f}, 3);
  settings.fairing.method = Method::implicit;
  settings.fairing.implicit_weights = weights;
  settings.fairing.implicit_lambda = lambda;
  settings.fairing.closeness_sigma = 0.01f;
  settings.fairing.strength = 0.9f;
  return settings;
}

TEST_F(CudaBackendTest, implicit_equals_the_cpu_for_all_weights) {
  std::vector<Point> points = noisy_sphere(100000, 31, 0.002);
  points[777] = {1.4f, 1.4f, 1.4f};
  points[778].x = kNan;
  for (const ImplicitWeights weights : kWeights)
    for (const int k : {2, 8, 20})
      for (const double lambda : {0.5, 30.0}) {
        StageSettings settings = implicit(k, weights, lambda);
        settings.iterations = k == 8 ? 2 : 1;
        expect_same(points, settings, ("weights " + std::to_string(int(weights)) + ", k " + std::to_string(k)).c_str());
      }
  StageSettings limited = implicit(8, ImplicitWeights::scale, 5);
  limited.neighbors.radius = 0.01f;
  expect_same(points, limited, "lists within a radius");
}

TEST_F(CudaBackendTest, implicit_equals_the_cpu_on_a_million_points) {
  expect_same(noisy_sphere(1000000, 32, 0.001), implicit(8, ImplicitWeights::curvature, 5), "a million");
}

TEST_F(CudaBackendTest, implicit_equals_the_cpu_on_a_cloud_larger_than_the_cache) {
  std::vector<Point> points = noisy_sphere(3500000, 33, 0.0005);  // whose points go back by way of a sort
  points[12345].z = kNan;
  expect_same(points, implicit(6, ImplicitWeights::uniform, 3), "3.5 million");
}

TEST_F(CudaBackendTest, implicit_equals_the_cpu_on_hard_clouds) {
  for (const ImplicitWeights weights : kWeights) {
    const StageSettings settings = implicit(8, weights, 5);
    expect_same(uneven_sphere(50000, 32), settings, "density 1000:1");
    std::vector<Point> cloud = noisy_sphere(50000, 34, 0.002);
    for (std::size_t i = 0; i < slow_tools::most_points(10000); ++i)
      cloud[5 * i % cloud.size()] = {0.5f, 0.25f, 0.125f};
    expect_same(cloud, settings, "10000 identical, some of which all others list");
    for (Point& p : cloud) p = {std::round(p.x * 100) / 100, std::round(p.y * 100) / 100, std::round(p.z * 100) / 100};
    expect_same(cloud, settings, "quantised");
    for (std::size_t i = 0; i < cloud.size(); i += 7) cloud[i].y = kNan;
    expect_same(cloud, settings, "invalid points");
    expect_same(std::vector<Point>(5000, Point{1, 0.5f, 0.25f}), settings, "all identical");
    expect_same(std::vector<Point>(100, Point{kNan, 0, 0}), settings, "nothing valid");
    for (const int count : {0, 1, 2, 3, 4, 9, 32, 33, 2047, 2049}) expect_same(shapes::sphere(count), settings, "tiny");
  }
}

TEST_F(CudaBackendTest, implicit_can_be_stopped_and_repeated) {
  const std::vector<Point> points = cut(noisy_sphere(30000, 35, 0.002));
  Params params{.method = Method::implicit, .iterations = 2};
  std::vector<Point> expected(points.size()), out(points.size());
  Pipeline cpu(Device::cpu), cuda(Device::cuda);
  cpu.load(points);
  cpu.run(params, expected);
  cuda.load(points);
  for (const int calls : {1, 4, 5}) {  // before the index, and, where that is known, in the second iteration
    std::stop_source stop;
    int made = 0;
    EXPECT_THROW(cuda.run(params, out, stop.get_token(),
                          [&](double, std::string_view) {
                            if (++made == calls) stop.request_stop();
                          }),
                 Error)
        << calls;
    cuda.run(params, out);
    EXPECT_EQ(difference(out, expected), "") << "stopped before stage " << calls;
    EXPECT_EQ(cuda.report().solver.iterations, cpu.report().solver.iterations);
    EXPECT_GT(cuda.report().solver.iterations, 4u);
    params.implicit_lambda = double(calls);
    cpu.run(params, expected);
  }
}

}  // namespace
}  // namespace pointfair
