// SPDX-License-Identifier: Apache-2.0
// The CUDA backend against the CPU backend, bit for bit, and both against brute force.
#include <tuple>

#include "cuda_backend_test.h"
#include "point/fairing.h"
#include "point/neighbors.h"
#include "point/normal.h"

namespace pointfair {
namespace {

// By the definition: all other points ordered by squared distance, then by position.
StageResults by_brute_force(const std::vector<Point>& points, const StageSettings& settings) {
  using point::Vec3;
  const auto vec = [](Point p) { return Vec3<float>{p.x, p.y, p.z}; };
  StageResults result{points, std::vector<Point>(points.size()), {}};
  const auto weights = point::normal_weights(settings.normals.sigma);
  const auto bilateral = point::bilateral_weights(settings.fairing.closeness_sigma, settings.fairing.similarity_sigma);
  for (std::size_t i = 0; i < points.size(); ++i) {
    using Place = std::tuple<float, float, float>;
    std::vector<std::tuple<float, Place, std::size_t>> order;
    for (std::size_t j = 0; j < points.size(); ++j)
      if (j != i)
        order.emplace_back(point::squared_length(vec(points[j]) - vec(points[i])),
                           Place{points[j].x, points[j].y, points[j].z}, j);
    const std::size_t k = std::min(order.size(), std::size_t(settings.neighbors.k));
    std::partial_sort(order.begin(), order.begin() + std::ptrdiff_t(k), order.end());
    point::CentroidSum<float> centroid;
    for (std::size_t n = 0; n < k; ++n)
      centroid.add(vec(points[std::get<2>(order[n])]) - vec(points[i]), true, weights);
    point::CovarianceSum<float> covariance;
    for (std::size_t n = 0; n < k; ++n)
      covariance.add(vec(points[std::get<2>(order[n])]) - vec(points[i]), centroid.centroid(), true, weights);
    const Vec3<float> normal = k < point::kLeastNeighbors ? Vec3<float>{} : covariance.normal().unit;
    point::BilateralSum<float> sum;
    for (std::size_t n = 0; n < k; ++n)
      sum.add(vec(points[std::get<2>(order[n])]) - vec(points[i]), normal, 1.0f, true, bilateral);
    const Vec3<float> moved = point::moved(vec(points[i]), normal, sum.distance());
    result.normals[i] = {normal.x, normal.y, normal.z};
    result.points[i] = {moved.x, moved.y, moved.z};
  }
  return result;
}

TEST_F(CudaBackendTest, equals_brute_force) {
  for (const auto& points : {noisy_sphere(3000, 1, 0.01), lattice(13), shapes::sphere(33), shapes::sphere(9)}) {
    for (const int k : {1, 3, 5, 8, 13, 16, 31, 32, 33, 100}) {
      SCOPED_TRACE(std::to_string(points.size()) + " points, k " + std::to_string(k));
      const StageSettings settings = with_neighbors(k);
      const StageResults cuda = run(*cuda_, points, settings), expected = by_brute_force(points, settings);
      EXPECT_EQ(difference(cuda.normals, expected.normals), "");
      EXPECT_EQ(difference(cuda.points, expected.points), "");
    }
  }
}

TEST_F(CudaBackendTest, equals_the_cpu_for_every_k) {
  const std::vector<Point> points = noisy_sphere(200000, 2, 0.002);
  for (const int k : {1, 2, 5, 8, 12, 16, 24, 32, 64})
    expect_same(points, with_neighbors(k), std::to_string(k).c_str());
  expect_same(noisy_sphere(20000, 2, 0.002), with_neighbors(512), "512");
}

TEST_F(CudaBackendTest, equals_the_cpu_on_a_million_points) {
  const std::vector<Point> points = noisy_sphere(1000000, 5, 0.001);
  for (const int k : {8, 16, 32}) expect_same(points, with_neighbors(k), std::to_string(k).c_str());
}

TEST_F(CudaBackendTest, equals_the_cpu_on_a_cloud_larger_than_the_cache) {
  std::vector<Point> points = noisy_sphere(4000000, 6, 0.0005);
  points[12345].z = kNan;
  expect_same(points, with_neighbors(8), "4 million");
}

TEST_F(CudaBackendTest, equals_the_cpu_with_a_radius) {
  const std::vector<Point> points = noisy_sphere(100000, 7, 0.002);
  for (const float radius : {0.001f, 0.01f, 0.02f, 0.5f}) expect_same(points, with_neighbors(16, radius), "radius");
  StageSettings with_area = with_neighbors(16, 0.01f);
  with_area.fairing.area_weight = AreaWeight::squared;
  expect_same(points, with_area, "radius and area weight");
}

TEST_F(CudaBackendTest, equals_the_cpu_with_every_switch) {
  const std::vector<Point> points = noisy_sphere(100000, 8, 0.002);
  for (const AreaWeight area : {AreaWeight::length, AreaWeight::squared}) {
    for (const int k : {3, 8}) {
      StageSettings settings = with_neighbors(k);
      settings.fairing.area_weight = area;
      if (k == 3) settings.normals.sigma = 1e25f;  // equal weights
      expect_same(points, settings, "area weight");
    }
  }
}

TEST_F(CudaBackendTest, equals_the_cpu_with_the_constraint) {
  for (const auto& points : {noisy_sphere(100000, 9, 0.002), uneven_sphere(50000, 10)}) {
    for (const float reach : {0.004f, 0.008f, 0.02f}) {
      StageSettings settings = with_neighbors(8, 0, true, reach);
      settings.fairing.area_weight = AreaWeight::squared;
      expect_same(points, settings, "constraint");
    }
    expect_same(points, with_neighbors(24, 0, true, 0.01f), "k 24");
    expect_same(points, with_neighbors(8, 0.02f, true, 0.01f), "with a radius");
  }
}

TEST_F(CudaBackendTest, equals_the_cpu_with_filtered_normals_and_both_planes) {
  const std::vector<Point> points = noisy_sphere(100000, 17, 0.002);
  for (const int k : {5, 8, 30}) {
    StageSettings settings = with_filter_and_both_planes(with_neighbors(k));
    expect_same(points, settings, "both planes");
    settings.fairing.symmetric = false;
    settings.fairing.area_weight = AreaWeight::length;
    expect_same(points, settings, "own plane");
  }
}

TEST_F(CudaBackendTest, equals_the_cpu_with_every_method) {
  std::vector<Point> points = noisy_sphere(100000, 19, 0.002);
  points[777] = {5, 5, 5};
  points[778].x = kNan;
  for (const Method method : kOtherMethods) {
    const std::string name = "method " + std::to_string(int(method));
    for (const int k : {2, 5, 8, 30}) {
      StageSettings settings = with_method(with_neighbors(k), method);
      settings.normals.filter_rounds = 1;  // mollified: no angle
      expect_same(points, settings, name.c_str());
      settings.fairing.area_weight = AreaWeight::squared;
      if (k == 8) expect_same(points, settings, (name + ", area weight").c_str());
    }
    StageSettings settings = with_method(with_neighbors(12, 0, true, 0.02f), method);
    settings.iterations = 3;
    expect_same(points, settings, (name + ", constraint, iterations").c_str());
    expect_same(std::vector<Point>(500, Point{1, 2, 3}), settings, (name + ", identical points").c_str());
    expect_same({}, settings, (name + ", no points").c_str());
  }
}

TEST_F(CudaBackendTest, equals_the_cpu_on_outliers) {
  std::vector<Point> points = noisy_sphere(100000, 21, 0.002);
  for (std::size_t i = 0; i < points.size(); i += 100) {
    const float lift = 1 + 0.0001f * float(i % 7919);
    points[i] = {points[i].x * lift, points[i].y * lift, points[i].z * lift};
  }
  points[5].y = std::numeric_limits<float>::quiet_NaN();
  for (const int iterations : {1, 2, 3}) {
    StageSettings settings = with_filter_and_both_planes(with_neighbors(24));
    settings.iterations = iterations;
    settings.fairing.outlier_distance = 0.01f;
    settings.fairing.pull_outliers = iterations == 2;
    settings.limits = {{0.006f, 0.01f}};
    expect_same(points, settings, "held back");
  }
}

// One sensor for all points, and one for each, over lists and radius neighbourhoods.
TEST_F(CudaBackendTest, equals_the_cpu_where_a_sensor_is_known) {
  std::vector<Point> points = cut(noisy_sphere(100000, 23, 0.002));
  for (std::size_t i = 0; i < points.size(); i += 100) {
    const float lift = 1 + 0.0001f * float(i % 7919);
    points[i] = {points[i].x * lift, points[i].y * lift, points[i].z * lift};
  }
  points[5].y = kNan;
  SensorPlaces one{{{0.5f, 0.25f, 3.0f}}}, each;
  for (std::size_t i = 0; i < points.size(); ++i) each.places.push_back({2, float(i % 7), i % 50 == 0 ? kNan : -3.0f});
  for (const SensorPlaces& places : {one, each})
    for (const bool listed : {true, false})
      for (const bool along : {true, false}) {
        StageSettings settings = with_filter_and_both_planes(with_neighbors(listed ? 24 : 0));
        if (!listed) {
          settings.neighbors = {0, 0.03f};
          settings.neighbors.min_neighbors = 16;
          settings.frame = frame_over({-1.5f, -1.5f, -1.5f}, 3);
        }
        settings.iterations = along ? 3 : 2;
        settings.fairing.sensors = std::make_shared<const SensorPlaces>(places);
        settings.fairing.along_ray = along;
        settings.fairing.farthest = along ? 0.006f : 0.0f;
        settings.fairing.beam_width = 0.004f;
        settings.fairing.outlier_distance = 0.01f;
        settings.limits = {{0.03f, 0.05f}};
        expect_same(points, settings, listed ? "lists" : "radius");
        settings.fairing.outlier_distance = 0;
        expect_same(points, settings, "without outliers");
        settings.fairing.outlier_distance = 0.01f;
        settings.fairing.pull_outliers = true;
        expect_same(points, settings, "pulled in");
        for (const Method method : {Method::mls, Method::wiener}) {
          StageSettings other = with_method(settings, method);
          other.fairing.pull_outliers = false;
          expect_same(points, other, "another method");
        }
      }
}

TEST_F(CudaBackendTest, equals_the_cpu_over_iterations) {
  expect_same(noisy_sphere(100000, 11, 0.002), {.iterations = 3}, "3 iterations");
}

TEST_F(CudaBackendTest, equals_the_cpu_on_hard_clouds) {
  const std::vector<Point> even = noisy_sphere(100000, 12, 0.002);
  expect_same(uneven_sphere(100000, 7), with_neighbors(8), "density 50:1");
  expect_same(uneven_sphere(100000, 32), with_neighbors(8), "density 1000:1");
  std::vector<Point> cloud = even;
  cloud[777] = {1e6f, -1e6f, 1e6f};
  expect_same(cloud, with_neighbors(8), "a stray point");
  cloud = even;
  for (std::size_t i = 0; i < 20000; ++i) cloud[5 * i] = {0.5f, 0.25f, 0.125f};
  expect_same(cloud, with_neighbors(8), "20000 identical");
  expect_same(std::vector<Point>(5000, Point{1, 2, 3}), with_neighbors(8), "all identical");
  cloud = even;
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud[i].z = 0, cloud[i].y = i % 2 == 0 ? 0 : cloud[i].y;
  expect_same(cloud, with_neighbors(8), "a plane and a line");
  cloud = even;
  for (Point& p : cloud) p = {std::round(p.x * 200) / 200, std::round(p.y * 200) / 200, std::round(p.z * 200) / 200};
  expect_same(cloud, with_neighbors(8), "quantised");
  expect_same(lattice(40), with_neighbors(16), "a lattice");
}

// So far from the origin that the sheet's points lie in planes, as far apart as a leaf is wide.
TEST_F(CudaBackendTest, equals_the_cpu_where_floats_are_coarse_against_the_spacing) {
  for (const float step : {0.03125f, 0.0078125f, 0.0009765625f}) {
    std::vector<Point> cloud = noisy_sphere(6000, 29, 0.002);
    for (std::size_t i = 0; i < cloud.size(); i += 2) {
      Point& p = cloud[i];
      p = {0.5f * p.x + 9e6f * step, 0.5f * p.y + 3e6f * step, 0.1f * p.z};
    }
    for (const int k : {5, 8, 16, 32, 64}) expect_same(cloud, with_neighbors(k), "coarse floats");
  }
}

// Cells of the curve that hold more points than a leaf, and more than a block of leaves; points in its last cells,
// beside invalid ones, which must still be sorted behind all others.
TEST_F(CudaBackendTest, equals_the_cpu_where_cells_are_dense) {
  for (const float size : {0.05f, 1e-3f}) {
    const std::size_t count = slow_tools::most_points(50000);
    std::vector<Point> cloud = noisy_sphere(int(count), 16, 0.002);
    for (std::size_t i = 0; i < count / 5; ++i) {
      Point& p = cloud[5 * i];
      p = {0.3f + size * p.x, 0.2f + size * p.y, size * p.z};
    }
    for (std::size_t i = 0; i < count / 25; ++i) cloud[7 * i].z = kNan;
    for (std::size_t i = 0; i < count / 60; ++i)
      cloud[11 * i] = {i % 2 == 0 ? -9.0f : 9.0f, i / 2 % 2 == 0 ? -9.0f : 9.0f,
                       (i / 4 % 2 == 0 ? -9.0f : 9.0f) + float(i) * 1e-5f};
    expect_same(cloud, with_neighbors(8), size < 0.01f ? "dense" : "a little dense");
  }
}

// Cells of many groups of leaves, which are put in order once more, and cells of these: two scans far apart with many
// points in one place, and points ever denser towards one place. Large clouds are sorted by all bits of their keys.
TEST_F(CudaBackendTest, equals_the_cpu_where_cells_are_very_dense) {
  std::vector<Point> cloud = noisy_sphere(int(slow_tools::most_points(60000)), 17, 0.002);
  for (std::size_t i = 0; i < cloud.size(); i += 2) cloud[i].x += 1000;
  for (std::size_t i = 0; i < cloud.size(); i += 3) cloud[i] = {0.125f, 0, 0.25f};
  expect_same(cloud, with_neighbors(8), "two scans");
  for (const std::size_t count : {80000, (1 << 21) + 5000}) {
    cloud = noisy_sphere(int(slow_tools::most_points(count)), 18, 0.002);
    for (Point& p : cloud) {
      const float r = std::pow(std::abs(p.x), 7.0f);
      p = {p.x * r, p.y * r, p.z * r};
    }
    expect_same(cloud, with_neighbors(8), "denser and denser");
  }
}

TEST_F(CudaBackendTest, equals_the_cpu_on_invalid_and_tiny_clouds) {
  std::vector<Point> cloud = noisy_sphere(50000, 13, 0.002);
  for (std::size_t i = 0; i < cloud.size(); i += 7)
    cloud[i].y = i % 2 == 0 ? kNan : std::numeric_limits<float>::infinity();
  cloud[8] = {1e30f, 0, 0};
  expect_same(cloud, with_neighbors(8), "invalid points");
  expect_same(cloud, with_neighbors(40), "invalid points, long lists");
  for (const int count : {0, 1, 2, 3, 5, 8, 9, 31, 32, 33, 64, 65, 1023, 1025})
    for (const int k : {2, 8, 32, 50}) expect_same(shapes::sphere(count), with_neighbors(k), "tiny");
  expect_same(std::vector<Point>(100, Point{kNan, 0, 0}), with_neighbors(8), "nothing valid");
}

TEST_F(CudaBackendTest, bounds_and_samples_equal_the_cpu) {
  std::vector<Point> cloud = noisy_sphere(20000, 14, 0.01);
  cloud[3].x = kNan;
  const std::vector<std::uint32_t> queries = {0, 1, 2, 3, 19999, 77};
  for (Backend* backend : {cuda_.get(), cpu_.get(), &in_parts(cloud.size())}) {
    backend->upload(cloud, IndexOrder::fastest);
    backend->build_index(0, {}, {});
    for (const std::size_t count : {10, 1000, 30000}) {
      const CloudSample a = backend->sampling().sample_cloud(count), b = cuda_->sampling().sample_cloud(count);
      EXPECT_EQ(difference({a.bounds.min, a.bounds.max}, {b.bounds.min, b.bounds.max}), "");
      EXPECT_EQ(a.bounds.valid, b.bounds.valid);
      EXPECT_EQ(difference(a.points, b.points), "") << count;
    }
  }
  for (const int k : {1, 30, 300, 1024}) {
    std::vector<Point> rows(queries.size() * std::size_t(k + 1)), expected = rows;
    cuda_->sampling().sample_neighborhoods(queries, k, rows);
    cpu_->sampling().sample_neighborhoods(queries, k, expected);
    std::vector<Point> from_parts = rows;
    in_parts(cloud.size()).sampling().sample_neighborhoods(queries, k, from_parts);
    EXPECT_EQ(std::memcmp(from_parts.data(), rows.data(), rows.size() * sizeof(Point)), 0);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (std::isnan(expected[i].x)) {
        EXPECT_TRUE(std::isnan(rows[i].x)) << i;
        rows[i] = expected[i];
      }
    }
    EXPECT_EQ(difference(rows, expected), "") << k;
  }
}

TEST(CudaDevices, a_card_that_is_not_there_is_refused_with_a_reason) {
  const test::Thrown thrown = test::thrown_by([] { make_cuda_backend(99); });
  EXPECT_EQ(thrown.kind, ErrorKind::device);
  EXPECT_GT(thrown.message.size(), 20u);
}

}  // namespace
}  // namespace pointfair
