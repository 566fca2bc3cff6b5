// SPDX-License-Identifier: Apache-2.0
// The CUDA backend against the CPU backend, bit for bit, and both against brute force. Skipped where no card can be
// used. POINTFAIR_TEST_POINTS=N cuts the clouds that both backends are compared on to N points, for compute-sanitizer.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <map>

#include "backend.hpp"
#include "point/fairing.h"
#include "point/neighbors.h"
#include "point/normal.h"
#include "pointfair/pointfair.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

struct Settings {
  NeighborSettings neighbors{8, 0, false, 0};
  NormalSettings normals{true, 0.1f};
  FairingSettings fairing{Method::bilateral, AreaWeight::none, 0.1f, 0.05f};
  int passes = 1;
  DisplacementLimits limits;
  bool leaving = false;  // the download is announced
};

struct Result {
  std::vector<Point> points, normals;
  Counts counts;
  std::uint64_t held_back = 0;
};

// `while_arriving`: stages are started before the upload has ended.
Result run(Backend& backend, const std::vector<Point>& points, const Settings& settings, bool while_arriving = false) {
  if (while_arriving) {
    backend.start_upload(points);
  } else {
    backend.upload(points);
  }
  for (int pass = 0; pass < settings.passes; ++pass) {
    backend.begin_pass(pass);
    backend.build_index({});
    backend.find_neighbors(settings.neighbors, {});
    backend.estimate_normals(settings.normals, {});
    if (settings.leaving) backend.expect_download();
    backend.fair(settings.fairing, {});
  }
  Result result{std::vector<Point>(points.size()), std::vector<Point>(points.size()), {}, 0};
  result.held_back = backend.download(result.points, settings.limits, {});
  backend.finish_upload();
  backend.download_normals(result.normals);
  result.counts = backend.counts();
  return result;
}

// Places where two clouds differ in a bit, the first of them in words.
std::string difference(const std::vector<Point>& a, const std::vector<Point>& b) {
  std::size_t count = 0, first = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (std::memcmp(&a[i], &b[i], sizeof(Point)) != 0 && count++ == 0) first = i;
  if (count == 0) return "";
  const Point p = a[first], q = b[first];
  char text[200];
  std::snprintf(text, sizeof text, "%zu of %zu differ, first %zu: %.9g %.9g %.9g and %.9g %.9g %.9g", count, a.size(),
                first, double(p.x), double(p.y), double(p.z), double(q.x), double(q.y), double(q.z));
  return text;
}

class CudaBackendTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string reason;
    for (const DeviceStatus& status : list_cuda_devices()) {
      if (status.usable) reason = "usable";
      if (reason.empty()) reason = status.info.reason;
    }
    if (reason != "usable") GTEST_SKIP() << reason;
    cuda_ = make_cuda_backend(0);
    cpu_ = make_cpu_backend(0);
  }

  static std::vector<Point> cut(std::vector<Point> points) {
    if (const char* limit = std::getenv("POINTFAIR_TEST_POINTS"))
      points.resize(std::min<std::size_t>(points.size(), std::strtoull(limit, nullptr, 10)));
    return points;
  }

  void expect_same(const std::vector<Point>& whole, const Settings& settings, const char* what) {
    SCOPED_TRACE(what);
    const std::vector<Point> points = cut(whole);
    const Result cpu = run(*cpu_, points, settings);
    expect_equal(run(*cuda_, points, settings), cpu, "whole");
    if (points.size() > 1024 && !cube_)
      expect_equal(run(in_parts(points.size()), points, settings, true), cpu, "in parts");
  }
  static void expect_equal(const Result& cuda, const Result& cpu, const char* what) {
    SCOPED_TRACE(what);
    EXPECT_EQ(difference(cuda.normals, cpu.normals), "") << "normals";
    EXPECT_EQ(difference(cuda.points, cpu.points), "") << "faired points";
    EXPECT_EQ(cuda.counts.unmoved, cpu.counts.unmoved);
    EXPECT_EQ(cuda.counts.short_neighborhoods, cpu.counts.short_neighborhoods);
    EXPECT_EQ(cuda.held_back, cpu.held_back);
  }

  // A backend to which so many points come in three to eight parts.
  Backend& in_parts(std::size_t points) {
    std::size_t part = 1 << 20;
    while (part > 1024 && points <= 2 * part) part /= part > (1 << 15) ? 8 : 4;
    std::unique_ptr<Backend>& backend = in_parts_[part];
    if (backend == nullptr) backend = make_cuda_backend(0, part);
    return *backend;
  }

  std::unique_ptr<Backend> cuda_, cpu_;
  std::map<std::size_t, std::unique_ptr<Backend>> in_parts_;
  bool cube_ = false;  // points are in the order of balls
};

Settings with_neighbors(int k, float radius = 0, bool constraint = false, float reach = 0) {
  Settings settings;
  settings.neighbors = {k, radius, constraint, reach};
  return settings;
}

std::vector<Point> noisy_sphere(int count, std::uint64_t seed, double noise) {
  std::vector<Point> points = shapes::sphere(count, seed);
  shapes::Random random(seed + 1);
  for (Point& p : points) {
    const float r = float(1 + noise * random.normal());
    p = {p.x * r, p.y * r, p.z * r};
  }
  return points;
}

std::vector<Point> lattice(int side) {
  std::vector<Point> points;
  for (int i = 0; i < side * side * side; ++i)
    points.push_back({float(i % side), float(i / side % side), float(i / side / side)});
  return points;
}

// One axis is warped so that density varies by the square of the ratio of its ends.
std::vector<Point> uneven_sphere(int count, double ratio) {
  std::vector<Point> points = noisy_sphere(count, 3, 0.001);
  for (Point& p : points) {
    const double size = 1 / (1 + (ratio - 1) * (double(p.z) + 1.1) / 2.2);
    p = {float(p.x * size), float(p.y * size), float(p.z * size)};
  }
  return points;
}

// By the definition: all other points ordered by squared distance, then by index.
Result by_brute_force(const std::vector<Point>& points, const Settings& settings) {
  using point::Vec3;
  const auto vec = [](Point p) { return Vec3<float>{p.x, p.y, p.z}; };
  Result result{points, std::vector<Point>(points.size()), {}};
  const auto weights = point::normal_weights(settings.normals.weighted, settings.normals.sigma);
  const auto bilateral = point::bilateral_weights(settings.fairing.closeness_sigma, settings.fairing.similarity_sigma);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::vector<std::pair<float, std::size_t>> order;
    for (std::size_t j = 0; j < points.size(); ++j)
      if (j != i) order.emplace_back(point::squared_length(vec(points[j]) - vec(points[i])), j);
    const std::size_t k = std::min(order.size(), std::size_t(settings.neighbors.k));
    std::partial_sort(order.begin(), order.begin() + std::ptrdiff_t(k), order.end());
    point::CentroidSum<float> centroid;
    for (std::size_t n = 0; n < k; ++n) centroid.add(vec(points[order[n].second]) - vec(points[i]), true, weights);
    point::CovarianceSum<float> covariance;
    for (std::size_t n = 0; n < k; ++n)
      covariance.add(vec(points[order[n].second]) - vec(points[i]), centroid.centroid(), true, weights);
    const Vec3<float> normal = k < point::kLeastNeighbors ? Vec3<float>{} : covariance.normal().unit;
    point::BilateralSum<float> sum;
    for (std::size_t n = 0; n < k; ++n)
      sum.add(vec(points[order[n].second]) - vec(points[i]), normal, 1.0f, true, bilateral);
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
      const Settings settings = with_neighbors(k);
      const Result cuda = run(*cuda_, points, settings), expected = by_brute_force(points, settings);
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
  Settings with_area = with_neighbors(16, 0.01f);
  with_area.fairing.area_weight = AreaWeight::squared;
  expect_same(points, with_area, "radius and area weight");
}

TEST_F(CudaBackendTest, equals_the_cpu_where_points_leave_in_parts) {
  std::vector<Point> cloud = noisy_sphere(100000, 19, 0.002);
  for (std::size_t i = 0; i < cloud.size(); i += 9) cloud[i].z = kNan;
  Settings settings;
  settings.leaving = true;
  for (const int count : {100000, 257, 5, 1, 0})
    for (const int k : {2, 8, 12, 40}) {
      settings.neighbors.k = k;
      expect_same({cloud.begin(), cloud.begin() + count}, settings, "in parts");
    }
  settings.fairing.area_weight = AreaWeight::squared;
  expect_same(cloud, settings, "an area weight, at once");
}

TEST_F(CudaBackendTest, equals_the_cpu_with_every_switch) {
  const std::vector<Point> points = noisy_sphere(100000, 8, 0.002);
  for (const AreaWeight area : {AreaWeight::length, AreaWeight::squared}) {
    for (const int k : {3, 8}) {
      Settings settings = with_neighbors(k);
      settings.fairing.area_weight = area;
      settings.normals.weighted = k == 3;
      expect_same(points, settings, "area weight");
    }
  }
}

TEST_F(CudaBackendTest, equals_the_cpu_with_the_constraint) {
  for (const auto& points : {noisy_sphere(100000, 9, 0.002), uneven_sphere(50000, 10)}) {
    for (const float reach : {0.004f, 0.008f, 0.02f}) {
      Settings settings = with_neighbors(8, 0, true, reach);
      settings.fairing.area_weight = AreaWeight::squared;
      expect_same(points, settings, "constraint");
    }
    expect_same(points, with_neighbors(24, 0, true, 0.01f), "k 24");
    expect_same(points, with_neighbors(8, 0.02f, true, 0.01f), "with a radius");
  }
}

// What the default run does to balls, over lists too.
Settings with_filter_and_both_planes(Settings settings) {
  settings.normals.filter_rounds = 2;
  settings.normals.filter_angle = 25;
  settings.fairing.two_planes = true;
  settings.fairing.facing_angle = 45;
  settings.fairing.strength = 0.9f;
  return settings;
}

TEST_F(CudaBackendTest, equals_the_cpu_with_filtered_normals_and_both_planes) {
  const std::vector<Point> points = noisy_sphere(100000, 17, 0.002);
  for (const int k : {5, 8, 30}) {
    Settings settings = with_filter_and_both_planes(with_neighbors(k));
    expect_same(points, settings, "both planes");
    settings.fairing.two_planes = false;
    settings.fairing.area_weight = AreaWeight::length;
    expect_same(points, settings, "own plane");
  }
}

Settings with_balls(float radius, int widening = 0) {
  Settings settings = with_filter_and_both_planes(with_neighbors(0, radius));
  settings.neighbors.widening = widening;
  if (widening == 0) return settings;
  settings.normals.sigma = 1.4f;
  settings.normals.of_radius = true;
  settings.fairing.closeness_sigma = 0.6f;
  settings.fairing.closeness_of_radius = true;
  return settings;
}

// Sums over balls run along one curve.
constexpr Method kOtherMethods[] = {Method::laplacian, Method::taubin, Method::hc_laplacian,
                                    Method::mls,       Method::wiener, Method::mollified};

Settings with_method(Settings settings, Method method) {
  settings.fairing.method = method;
  settings.fairing.strength = 0.63f;
  settings.fairing.similarity_sigma = 0.003f;
  return settings;
}

TEST_F(CudaBackendTest, equals_the_cpu_with_every_method) {
  std::vector<Point> points = noisy_sphere(100000, 19, 0.002);
  points[777] = {5, 5, 5};
  points[778].x = kNan;
  for (const Method method : kOtherMethods) {
    const std::string name = "method " + std::to_string(int(method));
    for (const int k : {2, 5, 8, 30}) {
      Settings settings = with_method(with_neighbors(k), method);
      settings.normals.filter_rounds = 1;  // mollified: no angle
      expect_same(points, settings, name.c_str());
      settings.fairing.area_weight = AreaWeight::squared;
      if (k == 8) expect_same(points, settings, (name + ", area weight").c_str());
    }
    Settings settings = with_method(with_neighbors(12, 0, true, 0.02f), method);
    settings.passes = 3;
    expect_same(points, settings, (name + ", constraint, passes").c_str());
    expect_same(std::vector<Point>(500, Point{1, 2, 3}), settings, (name + ", identical points").c_str());
    expect_same({}, settings, (name + ", no points").c_str());
  }
}

class CudaBalls : public CudaBackendTest {
 protected:
  void SetUp() override {
    CudaBackendTest::SetUp();
    if (IsSkipped()) return;
    cuda_->order_along(kCube);
    cpu_->order_along(kCube);
    cube_ = true;
  }
  static constexpr CurveCube kCube{{-1.2f, -1.1f, -1.0f}, 2.1f};  // a part of the unit sphere lies outside
};

TEST_F(CudaBalls, equal_the_cpu) {
  const std::vector<Point> points = noisy_sphere(50000, 10, 0.002);
  expect_same(points, with_neighbors(0, 0.03f), "one radius");
  expect_same(points, with_balls(0.03f), "one radius, filtered, both planes");
  Settings settings = with_balls(0.03f);
  settings.fairing.area_weight = AreaWeight::squared;
  expect_same(points, settings, "area weight");
}

TEST_F(CudaBalls, that_follow_the_density_equal_the_cpu) {
  for (const int widening : {4, 16, 40}) {
    Settings settings = with_balls(0.02f, widening);
    expect_same(noisy_sphere(50000, 10, 0.002), settings, "sphere");
    expect_same(uneven_sphere(50000, 7), settings, "uneven");
    settings.passes = 3;
    expect_same(noisy_sphere(50000, 12, 0.002), settings, "three passes");
  }
}

TEST_F(CudaBalls, that_are_thinned_equal_the_cpu) {
  expect_same(noisy_sphere(50000, 18, 0.002), with_balls(0.2f, 8), "thinned");
}

TEST_F(CudaBalls, that_are_too_large_to_be_collected_equal_the_cpu) {
  expect_same(noisy_sphere(5000, 19, 0.002), with_balls(1.5f), "most of the sphere");
}

TEST_F(CudaBalls, of_hard_clouds_equal_the_cpu) {
  const std::vector<Point> even = noisy_sphere(30000, 20, 0.002);
  std::vector<Point> cloud = even;
  cloud[777] = {1e6f, -1e6f, 1e6f};
  cloud[778] = {3e17f, 3e17f, -3e17f};
  for (std::size_t i = 0; i < cloud.size(); i += 70) cloud[i].y = kNan;
  expect_same(cloud, with_balls(0.02f, 16), "stray and invalid points");
  cloud = even;
  for (std::size_t i = 0; i < 300; ++i) cloud[5 * i] = {0.5f, 0.25f, 0.125f};
  for (std::size_t i = 0; i < 3000; ++i) cloud[5 * i + 1] = cloud[5 * i + 2];
  expect_same(cloud, with_balls(0.02f, 16), "identical points");
  for (const int count : {0, 1, 2, 3, 31, 32, 33, 65}) expect_same(shapes::sphere(count), with_balls(0.7f, 4), "tiny");
  expect_same(std::vector<Point>(100, Point{kNan, 0, 0}), with_balls(0.7f), "nothing valid");
}

TEST_F(CudaBalls, equal_the_cpu_on_a_million_points) {
  expect_same(noisy_sphere(1000000, 21, 0.003), with_balls(0.008f, 16), "a million");
}

TEST_F(CudaBalls, of_the_default_run_equal_the_cpu) {
  const std::vector<Point> points = cut(noisy_sphere(60000, 22, 0.01));
  Pipeline cuda(Device::cuda), cpu(Device::cpu);
  std::vector<Point> on_card(points.size()), on_cpu(points.size());
  cuda.load(points);
  cuda.run({}, on_card);
  cpu.load(points);
  cpu.run({}, on_cpu);
  EXPECT_EQ(difference(on_card, on_cpu), "");
  EXPECT_EQ(cuda.report().params.radius.value, cpu.report().params.radius.value);
}

TEST_F(CudaBalls, equal_the_cpu_with_every_method) {
  for (const Method method : kOtherMethods) {
    const std::string name = "method " + std::to_string(int(method));
    Settings settings = with_method(with_neighbors(0, 0.02f), method);
    settings.neighbors.widening = 16;
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

TEST_F(CudaBackendTest, equals_the_cpu_on_outliers) {
  std::vector<Point> points = noisy_sphere(100000, 21, 0.002);
  for (std::size_t i = 0; i < points.size(); i += 100) {
    const float lift = 1 + 0.0001f * float(i % 7919);
    points[i] = {points[i].x * lift, points[i].y * lift, points[i].z * lift};
  }
  points[5].y = std::numeric_limits<float>::quiet_NaN();
  for (const int passes : {1, 2, 3}) {
    Settings settings = with_filter_and_both_planes(with_neighbors(24));
    settings.passes = passes;
    settings.fairing.outlier_distance = 0.01f;
    settings.fairing.pull_outliers = passes == 2;
    settings.limits = {0.006f, 0.01f};
    expect_same(points, settings, "held back");
  }
}

TEST_F(CudaBackendTest, equals_the_cpu_over_passes) {
  Settings settings;
  settings.passes = 3;
  expect_same(noisy_sphere(100000, 11, 0.002), settings, "3 passes");
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

// Cells of the curve that hold more points than a leaf, and more than a block of leaves; points in its last cells,
// beside invalid ones, which must still be sorted behind all others.
TEST_F(CudaBackendTest, equals_the_cpu_where_cells_are_dense) {
  for (const float size : {0.05f, 1e-3f}) {
    std::vector<Point> cloud = noisy_sphere(50000, 16, 0.002);
    for (std::size_t i = 0; i < 10000; ++i) {
      Point& p = cloud[5 * i];
      p = {0.3f + size * p.x, 0.2f + size * p.y, size * p.z};
    }
    for (std::size_t i = 0; i < 2000; ++i) cloud[7 * i].z = kNan;
    for (std::size_t i = 0; i < 800; ++i)
      cloud[11 * i] = {i % 2 == 0 ? -9.0f : 9.0f, i / 2 % 2 == 0 ? -9.0f : 9.0f,
                       (i / 4 % 2 == 0 ? -9.0f : 9.0f) + float(i) * 1e-5f};
    expect_same(cloud, with_neighbors(8), size < 0.01f ? "dense" : "a little dense");
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
  Settings settings = with_filter_and_both_planes(with_neighbors(8));
  settings.fairing.area_weight = AreaWeight::squared;
  settings.passes = 2;
  expect_same(even, settings, "filtered, both planes, area weight, two passes");
  settings = with_neighbors(8);
  settings.limits = {0.001f, 0.002f};
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
  Settings settings;
  const Result first = run(backend, points, settings, true);
  expect_equal(run(backend, points, settings), first, "after the upload");
  std::vector<Point> out(points.size());
  const auto fair = [&] {
    backend.fair(settings.fairing, {});
    backend.download(out, {}, {});
    return out;
  };
  settings.fairing.similarity_sigma = 0.01f;
  EXPECT_EQ(difference(fair(), run(*cpu_, points, settings).points), "");
  backend.start_upload(points);  // and before anything was asked for
  backend.begin_pass(0);
  backend.build_index({});
  backend.find_neighbors(settings.neighbors, {});
  backend.estimate_normals(settings.normals, {});
  backend.fair(settings.fairing, {});
  settings.fairing.similarity_sigma = 0.02f;
  backend.estimate_normals(settings.normals, {});
  EXPECT_EQ(difference(fair(), run(*cpu_, points, settings).points), "");
  backend.finish_upload();
  settings.neighbors.k = 12;
  backend.find_neighbors(settings.neighbors, {});
  backend.estimate_normals(settings.normals, {});
  EXPECT_EQ(difference(fair(), run(*cpu_, points, settings).points), "");
}

TEST_F(CudaBackendTest, in_parts_a_stop_is_an_interruption_and_the_next_run_is_whole) {
  const std::vector<Point> points = cut(in_order(noisy_sphere(20000, 35, 0.002)));
  Backend& backend = in_parts(points.size());
  Settings settings;
  backend.start_upload(points);
  backend.begin_pass(0);
  backend.build_index({});
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(backend.find_neighbors(settings.neighbors, stop.get_token()), Error);
  backend.finish_upload();
  backend.find_neighbors(settings.neighbors, std::stop_source().get_token());
  backend.estimate_normals(settings.normals, {});
  backend.fair(settings.fairing, {});
  std::vector<Point> out(points.size());
  backend.download(out, {}, {});
  EXPECT_EQ(difference(out, run(*cpu_, points, settings).points), "");
  backend.start_upload(points);  // with a stop that nobody asks for
  backend.begin_pass(0);
  const std::stop_source unused;
  backend.build_index(unused.get_token());
  backend.find_neighbors(settings.neighbors, unused.get_token());
  backend.estimate_normals(settings.normals, unused.get_token());
  backend.fair(settings.fairing, unused.get_token());
  backend.download(out, {}, {});
  backend.finish_upload();
  EXPECT_EQ(difference(out, run(*cpu_, points, settings).points), "");
}

TEST_F(CudaBackendTest, bounds_and_samples_equal_the_cpu) {
  std::vector<Point> cloud = noisy_sphere(20000, 14, 0.01);
  cloud[3].x = kNan;
  const std::vector<std::uint32_t> queries = {0, 1, 2, 3, 19999, 77};
  for (Backend* backend : {cuda_.get(), cpu_.get(), &in_parts(cloud.size())}) {
    backend->upload(cloud);
    backend->begin_pass(0);
    backend->build_index({});
    const Bounds a = backend->bounds(), b = cuda_->bounds();
    EXPECT_EQ(difference({a.min, a.max}, {b.min, b.max}), "");
    EXPECT_EQ(a.valid, b.valid);
  }
  for (const int k : {1, 30, 300, 1024}) {
    std::vector<Point> rows(queries.size() * std::size_t(k + 1)), expected = rows;
    cuda_->sample_neighborhoods(queries, k, rows);
    cpu_->sample_neighborhoods(queries, k, expected);
    std::vector<Point> from_parts = rows;
    in_parts(cloud.size()).sample_neighborhoods(queries, k, from_parts);
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

TEST_F(CudaBackendTest, runs_repeat_to_the_bit_and_stages_repeat_alone) {
  const std::vector<Point> points = noisy_sphere(100000, 15, 0.002);
  Settings settings;
  const Result once = run(*cuda_, points, settings), again = run(*cuda_, points, settings);
  EXPECT_EQ(difference(once.points, again.points), "");
  settings.fairing.similarity_sigma = 0.01f;
  cuda_->fair(settings.fairing, {});
  std::vector<Point> changed(points.size());
  cuda_->download(changed, {}, {});
  EXPECT_EQ(difference(changed, run(*cpu_, points, settings).points), "");
}

TEST_F(CudaBackendTest, a_stop_is_an_interruption) {
  cuda_->upload(shapes::sphere(1000));
  cuda_->begin_pass(0);
  std::stop_source stop;
  stop.request_stop();
  try {
    cuda_->build_index(stop.get_token());
    FAIL() << "not interrupted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::interrupted);
  }
}

// Kernels that run when a stop comes give up.
TEST_F(CudaBackendTest, a_stop_ends_kernels_that_run) {
  const std::vector<Point> points = cut(noisy_sphere(100000, 17, 0.002));
  const NeighborSettings neighbors{0, 1.0f};  // a quarter of all points
  std::stop_source stop;
  cuda_->upload(points);
  cuda_->begin_pass(0);
  cuda_->build_index(stop.get_token());
  cuda_->find_neighbors(neighbors, stop.get_token());
  cuda_->estimate_normals({true, 0.1f}, stop.get_token());
  stop.request_stop();
  if (points.size() == 100000) {  // else the normals, a tenth of a second's work here, may be done
    EXPECT_THROW(cuda_->finish(), Error);
    EXPECT_EQ(cuda_->take_stopped(), Stage::normals);
  }
  cuda_->take_stopped();
  EXPECT_EQ(cuda_->take_stopped(), std::nullopt);
  const Settings settings;
  EXPECT_EQ(difference(run(*cuda_, points, settings).points, run(*cpu_, points, settings).points), "");
}

// Stopped after one of its stage calls and then asked for all: what kernels gave up is never used.
TEST_F(CudaBackendTest, a_stopped_run_can_be_repeated) {
  const std::vector<Point> points = cut(noisy_sphere(30000, 18, 0.002));
  Params balls, lists, constrained;
  balls.radius = 0.3;
  lists.k = 100;
  constrained.k = 20;
  constrained.constraint = true;
  for (Params params : {balls, lists, constrained, Params{}}) {
    params.passes = 2;
    std::vector<Point> expected(points.size()), out(points.size());
    Pipeline fresh(Device::cuda), pipeline(Device::cuda);
    fresh.load(points);
    fresh.run(params, expected);
    for (const int calls : {2, 3, 4, 7}) {
      pipeline.load(points);
      std::stop_source stop;
      int made = 0;
      try {
        pipeline.run(params, out, stop.get_token(), [&](double, std::string_view) {
          if (++made == calls) stop.request_stop();
        });
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::interrupted);
      }
      pipeline.run(params, out);
      EXPECT_EQ(difference(out, expected), "") << "k " << params.k << ", stopped after call " << calls;
    }
  }
}

TEST(CudaDevices, a_card_that_is_not_there_is_refused_with_a_reason) {
  try {
    make_cuda_backend(99);
    FAIL() << "card 99 exists";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::device);
    EXPECT_GT(std::string(error.what()).size(), 20u);
  }
}

}  // namespace
}  // namespace pointfair
