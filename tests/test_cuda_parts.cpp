// SPDX-License-Identifier: Apache-2.0
// Clouds that come to a card in parts.
#include "cuda_backend_test.h"

namespace pointfair {
namespace {

// Slabs along z, as a scanner writes them.
std::vector<Point> in_order(std::vector<Point> points) {
  std::sort(points.begin(), points.end(), [](Point a, Point b) { return a.z < b.z; });
  return points;
}

TEST_F(CudaBackendTest, in_parts_equals_the_cpu_where_parts_lie_apart) {
  const std::vector<Point> even = in_order(noisy_sphere(100000, 31, 0.002));
  for (const int k : {3, 8, 16, 32, 40}) expect_same(even, with_neighbors(k), std::to_string(k).c_str());
  expect_same(even, with_neighbors(8, 0.01f), "radius");
  expect_same(even, with_neighbors(8, 0, true, 0.02f), "constraint");
  StageSettings settings = with_filter_and_both_planes(with_neighbors(8));
  settings.fairing.area_weight = AreaWeight::squared;
  settings.iterations = 2;
  expect_same(even, settings, "filtered, both planes, area weight, two iterations");
  settings = with_neighbors(8);
  settings.limits = {{0.001f, 0.002f}};
  expect_same(even, settings, "limits");
}

TEST_F(CudaBackendTest, in_parts_equals_the_cpu_on_hard_clouds) {
  const std::vector<Point> even = in_order(noisy_sphere(20000, 32, 0.002));
  std::vector<Point> cloud = even;
  for (std::size_t i = 0; i < cloud.size(); i += 3) cloud[i].x = kNan;
  for (std::size_t i = 8192; i < 16384; ++i) cloud[i].y = kNan;
  expect_same(cloud, with_neighbors(8), "invalid points, a part of nothing else");
  cloud = even;
  for (std::size_t i = 8192 - 40; i < 8192 + 40; ++i) cloud[i] = cloud[8192];
  for (std::size_t i = 0; i < cloud.size(); i += 100) cloud[i] = {0.5f, 0.25f, 0.125f};
  for (std::size_t i = 1; i < cloud.size(); i += 100) cloud[i] = cloud[(i * 7919) % cloud.size()];
  expect_same(cloud, with_neighbors(8), "identical points on both sides of a seam, and in all parts");
  cloud = even;
  cloud[777] = cloud[19000] = {1e6f, -1e6f, 1e6f};
  cloud[12000] = {-3e17f, 3e17f, 3e17f};
  expect_same(cloud, with_neighbors(8), "stray points");
  expect_same(std::vector<Point>(5000, Point{1, 2, 3}), with_neighbors(8), "all identical");
  cloud.clear();
  for (int turn = 0; turn < 8; ++turn)
    for (int i = 0; i < 2500; ++i) cloud.push_back(even[std::size_t(8 * i + turn)]);
  expect_same(cloud, with_neighbors(16), "each part all over the others");
  cloud = lattice(20);
  expect_same(cloud, with_neighbors(16), "a lattice, layer after layer");
  std::reverse(cloud.begin(), cloud.end());
  expect_same(cloud, with_neighbors(6), "the last layer first");
}

TEST_F(CudaBackendTest, in_parts_equals_the_cpu_for_every_size) {
  for (const int count : {1024, 1025, 1027, 1056, 2047, 2048, 2049, 3071, 3073, 4000})
    expect_same(in_order(noisy_sphere(count, 33, 0.01)), with_neighbors(8), std::to_string(count).c_str());
}

// What is cached from a run in parts serves later ones.
TEST_F(CudaBackendTest, in_parts_stages_repeat_alone) {
  const std::vector<Point> points = cut(in_order(noisy_sphere(20000, 34, 0.002)));
  Backend& backend = in_parts(points.size());
  StageSettings settings;
  const StageResults first = run(backend, points, settings, true);
  expect_equal(run(backend, points, settings), first, "after the upload");
  std::vector<Point> out(points.size());
  const auto fair = [&] {
    backend.fair(0, settings.fairing, {});
    backend.download(0, out, {}, {});
    return out;
  };
  settings.fairing.similarity_sigma = 0.01f;
  EXPECT_EQ(difference(fair(), run(*cpu_, points, settings).points), "");
  backend.overlap()->start_upload(points, IndexOrder::fastest);  // and before anything was asked for
  backend.build_index(0, {}, {});
  backend.find_neighbors(0, settings.neighbors, {});
  backend.estimate_normals(0, settings.normals, {});
  backend.fair(0, settings.fairing, {});
  settings.fairing.similarity_sigma = 0.02f;
  backend.estimate_normals(0, settings.normals, {});
  EXPECT_EQ(difference(fair(), run(*cpu_, points, settings).points), "");
  backend.overlap()->finish_upload();
  settings.neighbors.k = 12;
  backend.find_neighbors(0, settings.neighbors, {});
  backend.estimate_normals(0, settings.normals, {});
  EXPECT_EQ(difference(fair(), run(*cpu_, points, settings).points), "");
}

TEST_F(CudaBackendTest, in_parts_a_stop_is_an_interruption_and_the_next_run_is_whole) {
  const std::vector<Point> points = cut(in_order(noisy_sphere(20000, 35, 0.002)));
  Backend& backend = in_parts(points.size());
  StageSettings settings;
  backend.overlap()->start_upload(points, IndexOrder::fastest);
  backend.build_index(0, {}, {});
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(backend.find_neighbors(0, settings.neighbors, stop.get_token()), Error);
  backend.overlap()->finish_upload();
  backend.find_neighbors(0, settings.neighbors, std::stop_source().get_token());
  backend.estimate_normals(0, settings.normals, {});
  backend.fair(0, settings.fairing, {});
  std::vector<Point> out(points.size());
  backend.download(0, out, {}, {});
  EXPECT_EQ(difference(out, run(*cpu_, points, settings).points), "");
  backend.overlap()->start_upload(points, IndexOrder::fastest);  // with a stop that nobody asks for
  const std::stop_source unused;
  backend.build_index(0, {}, unused.get_token());
  backend.find_neighbors(0, settings.neighbors, unused.get_token());
  backend.estimate_normals(0, settings.normals, unused.get_token());
  backend.fair(0, settings.fairing, unused.get_token());
  backend.download(0, out, {}, {});
  backend.overlap()->finish_upload();
  EXPECT_EQ(difference(out, run(*cpu_, points, settings).points), "");
}

}  // namespace
}  // namespace pointfair
