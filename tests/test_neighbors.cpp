// SPDX-License-Identifier: Apache-2.0
// Neighbour lists and distances of the CPU backend: exact set and order, against brute force and nanoflann, on every
// instruction set that this processor has.
#include <gtest/gtest.h>
#include <pthread.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <nanoflann.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "backend_runs.h"
#include "cpu/index.h"
#include "every_kernel.h"
#include "pointfair/neighbors.hpp"
#include "reference.h"
#include "runs.h"
#include "seam/sampling.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using cpu::Index;
using shapes::Points;

// Lists of all points in upload order and numbering, as the neighbour stage computes them.
std::vector<reference::List> all_lists(const cpu::SpatialIndex& index, const cpu::Kernels& kernels, std::size_t points,
                                       int k, float squared_limit) {
  const cpu::IndexView view = index.view();
  std::vector<reference::List> lists(points);
  std::vector<Index> block(std::size_t(k) * cpu::kLeafSize);
  for (Index leaf = 0; leaf < view.leaves; ++leaf) {
    kernels.nearest(view, leaf, k, squared_limit, block.data());
    for (Index lane = 0; lane < Index(cpu::kLeafSize); ++lane) {
      const Index position = leaf * cpu::kLeafSize + lane;
      for (int s = 0; s < k && position < view.points; ++s) {
        const Index found = block[std::size_t(s) * cpu::kLeafSize + lane];
        if (found != point::kNoNeighbor) lists[view.original[position]].push_back(view.original[found]);
      }
    }
  }
  return lists;
}

// Whether the kernel gives the squared distances to the points of these lists, bit for bit.
void expect_distances(const Points& points, const cpu::SpatialIndex& index, const cpu::Kernels& kernels, int k,
                      const std::vector<reference::List>& expected, std::size_t step) {
  const cpu::IndexView view = index.view();
  std::vector<float> block(std::size_t(k) * cpu::kLeafSize, std::numeric_limits<float>::infinity());
  for (Index i = 0; i < view.points; ++i) {
    if (i % cpu::kLeafSize == 0) {  // whatever is said to be likely: a place of the leaf before
      const float likely = block[i / cpu::kLeafSize % block.size()];
      kernels.nearest_distances(view, i / cpu::kLeafSize, k, likely, block.data());
    }
    const Index query = view.original[i];
    for (std::size_t s = 0; s < std::size_t(k) && query % step == 0; ++s) {
      const auto& list = expected[query];
      const float squared = s < list.size() ? reference::squared_distance(points[query], points[list[s]])
                                            : std::numeric_limits<float>::infinity();
      ASSERT_EQ(block[s * cpu::kLeafSize + i % cpu::kLeafSize], squared)
          << "point " << query << ", place " << s << " of " << k << ", " << kernels.name;
    }
  }
}

// The same positions in the same order. Of identical points any may be listed, but none twice, and not the query.
std::string difference(const Points& points, std::size_t query, reference::List found,
                       const reference::List& expected) {
  if (found.size() != expected.size()) return std::to_string(found.size()) + " neighbours";
  for (std::size_t s = 0; s < found.size(); ++s) {
    const Point a = points[found[s]], b = points[expected[s]];
    if (a.x != b.x || a.y != b.y || a.z != b.z) return "another at place " + std::to_string(s);
  }
  std::sort(found.begin(), found.end());
  if (std::binary_search(found.begin(), found.end(), std::uint32_t(query))) return "itself";
  return std::adjacent_find(found.begin(), found.end()) == found.end() ? "" : "one twice";
}

void expect_exact_lists(const Points& points, int k, float radius = 0, std::size_t step = 1) {
  const float limit = radius > 0 ? radius * radius : std::numeric_limits<float>::max();
  std::vector<reference::List> expected(points.size());
  for (std::size_t i = 0; i < points.size(); i += step) {
    if (!reference::is_valid(points[i])) continue;
    expected[i] = reference::nearest(points, i, std::size_t(k));
    std::erase_if(expected[i], [&](auto j) { return reference::squared_distance(points[i], points[j]) > limit; });
  }
  for (const cpu::Kernels* kernels : available_kernels()) {
    cpu::MemoryMeter meter;
    cpu::SortSpace space(meter);
    cpu::SpatialIndex index(meter);
    index.build(points, {}, std::nullopt, space, *kernels, {});
    const auto found = all_lists(index, *kernels, points.size(), k, limit);
    for (std::size_t i = 0; i < points.size(); i += step)
      ASSERT_EQ(difference(points, i, found[i], expected[i]), "")
          << "point " << i << ", k " << k << ", radius " << radius << ", " << kernels->name;
    if (k <= 64 && radius == 0) expect_distances(points, index, *kernels, k, expected, step);
  }
}

constexpr int kEveryK[] = {1, 2, 3, 5, 8, 16, 20, 32, 64, 512};

TEST(Neighbors, are_exact_for_every_k_on_a_noisy_surface) {
  const Points points = shapes::with_noise(shapes::waves(1500), 0.01);
  for (const int k : kEveryK) expect_exact_lists(points, k);
}

TEST(Neighbors, are_exact_where_every_distance_ties) {
  for (const int k : kEveryK) expect_exact_lists(shapes::grid(9), k);
}

// Ties are ordered by the steps of a coarse grid, and within a step by the coordinates.
TEST(Neighbors, are_exact_where_ties_share_a_step_or_lie_on_both_sides_of_zero) {
  Points points = shapes::shifted(shapes::grid(9), {-4, -4, -4});
  for (const int k : {8, 16, 27, 32, 64}) expect_exact_lists(points, k);
  for (int i = 0; i < 200; ++i) {  // eighths of a step around one of the lattice's points
    const double x = 2 + i % 5 / 1024.0, y = 2 + i / 5 % 5 / 1024.0, z = 2 + i / 25 / 1024.0;
    points.push_back(shapes::make_point(x, y, z));
  }
  for (const int k : {8, 16, 32, 64}) expect_exact_lists(points, k);
}

TEST(Neighbors, are_exact_where_ties_and_distances_that_shortening_changes_meet) {
  Points points = shapes::grid(8);
  for (int i = 0; i < 300; ++i) points.push_back(shapes::make_point(i % 7 + 1e-6 * i, i / 7 % 7, 3 + 1e-5 * i));
  for (const int k : {8, 16, 32, 64}) expect_exact_lists(points, k);
}

TEST(Neighbors, are_exact_where_distances_differ_in_their_last_bits) {
  Points points = shapes::sphere(600);  // unit radius as far as rounding allows
  for (int i = 0; i < 20; ++i) points.push_back(shapes::make_point(1e-7 * i, -1e-7 * i, 0));
  for (const int k : kEveryK) expect_exact_lists(points, k);
}

// Along a spiral about the query every candidate is nearer than all before, and each is worth a place in the list for a
// while: more than a walk has numbers for.
TEST(Neighbors, at_the_centre_of_a_spiral_are_exact) {
  for (const double turn : {6.28, -6.28}) {
    Points points = {{0, 0, 0}};
    for (int i = 0; i < 4000; ++i) {
      const double t = i / 4000.0;
      points.push_back(shapes::make_point((1 - t / 2) * std::cos(turn * t), (1 - t / 2) * std::sin(turn * t), 0));
    }
    for (const int k : {8, 16, 32, 64}) expect_exact_lists(points, k, 0, 20);
  }
}

TEST(Neighbors, of_identical_points_are_others_at_their_place) {
  for (const int k : {1, 5, 8, 32, 64, 100}) expect_exact_lists(shapes::identical(300), k);
}

// Squared distances below the least number are zero.
TEST(Neighbors, at_different_places_whose_distance_rounds_to_zero_are_in_order_of_position) {
  Points points = shapes::scaled(shapes::cube(300), 1e-23f);
  for (int i = 0; i < 100; ++i) points.push_back(points[std::size_t(i)]);
  for (const int k : {1, 5, 8, 32, 64, 100}) expect_exact_lists(points, k);
  points = shapes::waves(300);
  for (int i = 0; i < 400; ++i) points.push_back({0.5f, 0, 0.25f});
  points.push_back({0.5f, -1e-30f, 0.25f});
  points.push_back({0.5f, 1e-30f, 0.25f});
  for (const int k : {1, 5, 8, 32, 64, 100}) expect_exact_lists(points, k);
}

TEST(Neighbors, are_exact_where_runs_of_identical_points_begin_and_end) {
  for (const int count : {9, 17, 24, 33, 70, 500}) {
    Points points = shapes::waves(500);
    points.insert(points.end(), std::size_t(count), Point{0.5f, 0.5f, 0.25f});
    points.insert(points.end(), std::size_t(count), points[7]);
    for (const int k : {1, 5, 8, 16, 32, 64}) expect_exact_lists(points, k);
  }
}

// All distances from a few points to all others round to few numbers.
TEST(Neighbors, from_afar_are_exact) {
  for (const float distance : {1e4f, 1e6f, 1e9f}) {
    Points points = shapes::with_noise(shapes::waves(1500), 0.01);
    for (int i = 0; i < 5; ++i) points.push_back({distance, distance * float(i), -distance});
    for (int i = 0; i < 3; ++i) points.push_back({-distance, float(i), 0});
    for (const int k : {1, 5, 8, 16, 31, 32, 33, 64, 100}) expect_exact_lists(points, k);
  }
}

// Many share a coordinate, so that boxes begin at the same one.
TEST(Neighbors, on_a_plane_across_each_axis_are_exact) {
  for (int axis = 0; axis < 3; ++axis) {
    Points points = shapes::flat_grid(30);
    for (Point& p : points) {
      float* const c = &p.x;
      std::swap(c[axis], c[2]);
    }
    for (int i = 0; i < 3; ++i) points.push_back({1e6f, 1e6f * float(i), -1e6f});
    for (const int k : {5, 8, 16, 33, 100}) expect_exact_lists(points, k, 0, 7);
  }
}

TEST(Neighbors, are_exact_when_many_points_are_doubles) {
  Points points = shapes::waves(400);
  points.insert(points.end(), points.begin(), points.end());
  points.insert(points.end(), points.begin(), points.begin() + 300);
  for (const int k : kEveryK) expect_exact_lists(points, k);
}

TEST(Neighbors, are_exact_at_1000_to_1_density) {
  const Points points = shapes::uneven(1500, 1000);
  for (const int k : {8, 32, 64}) expect_exact_lists(points, k);
}

TEST(Neighbors, are_exact_beside_a_stray_point) {
  for (const float distance : {1e3f, 1e6f, 1e17f})
    for (const int k : {8, 32, 64}) expect_exact_lists(shapes::with_stray(shapes::waves(700), distance), k);
}

TEST(Neighbors, do_not_include_invalid_points) {
  const Points points = shapes::with_invalid(shapes::sphere(900), 5);
  for (const int k : kEveryK) expect_exact_lists(points, k);
}

TEST(Neighbors, are_all_others_when_there_are_fewer_than_k) {
  for (int count = 0; count <= 40; ++count)
    for (const int k : {1, 8, 16, 33}) expect_exact_lists(shapes::sphere(count), k);
}

TEST(Neighbors, are_exact_for_every_number_of_points_around_a_leaf_and_a_node) {
  for (const int around : {16, 256, 4096})
    for (const int count : {around - 1, around, around + 1}) expect_exact_lists(shapes::cube(count), 8, 0, 13);
}

TEST(Neighbors, within_a_radius_are_the_nearest_that_lie_in_it) {
  const Points points = shapes::with_noise(shapes::waves(1500), 0.01);
  for (const float radius : {1e-6f, 0.02f, 0.05f, 0.2f, 3.0f})
    for (const int k : {1, 8, 32, 64}) expect_exact_lists(points, k, radius);
}

TEST(Neighbors, at_exactly_the_radius_belong_to_it) {
  for (const float radius : {1.0f, 2.0f, 3.0f}) expect_exact_lists(shapes::grid(7), 64, radius);
}

TEST(Neighbors, on_a_line_or_far_from_zero_or_at_tiny_scale_are_exact) {
  expect_exact_lists(shapes::line(900), 16);
  expect_exact_lists(shapes::shifted(shapes::waves(900), {4e5f, -5e6f, 300}), 16);  // rounded: full of ties
  expect_exact_lists(shapes::scaled(shapes::waves(900), 1e-15f), 16);
  expect_exact_lists(shapes::scaled(shapes::waves(900), 1e15f), 16);
}

#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// Runs `body` on a thread with this much stack; beyond it the program ends.
void run_on_stack_of(std::size_t bytes, std::function<void()> body) {
  pthread_attr_t attributes;
  ASSERT_EQ(pthread_attr_init(&attributes), 0);
  ASSERT_EQ(pthread_attr_setstacksize(&attributes, bytes), 0);
  const auto start = [](void* work) -> void* {
    (*static_cast<std::function<void()>*>(work))();
    return nullptr;
  };
  pthread_t thread;
  ASSERT_EQ(pthread_create(&thread, &attributes, start, &body), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&attributes);
}

// Packs of points from far apart are split again and again, each part with lists of its own.
TEST(Neighbors, of_the_largest_k_take_less_than_256_KiB_of_stack) {
  Points points = shapes::cube(40000);
  for (int i = 0; i < 64; ++i) points.push_back(shapes::make_point(1e6 * (i % 4), 1e6 * (i / 4 % 4), 1e6 * (i / 16)));
  for (const cpu::Kernels* kernels : available_kernels()) {
    cpu::MemoryMeter meter;
    cpu::SortSpace space(meter);
    cpu::SpatialIndex index(meter);
    index.build(points, {}, std::nullopt, space, *kernels, {});
    const cpu::IndexView view = index.view();
    constexpr int kMost = 512;
    std::vector<Index> block(std::size_t(kMost) * cpu::kLeafSize);
    run_on_stack_of(256 << 10, [&] {
      for (Index leaf = view.leaves - 5; leaf < view.leaves; ++leaf)
        kernels->nearest(view, leaf, kMost, std::numeric_limits<float>::max(), block.data());
    });
  }
}
#endif

struct NanoflannPoints {
  const Points& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const { return (&points[i].x)[axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

TEST(Neighbors, have_the_distances_that_nanoflann_finds) {
  using Metric = nanoflann::L2_Simple_Adaptor<float, NanoflannPoints>;
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<Metric, NanoflannPoints, 3, std::uint32_t>;
  constexpr int kCount = 30000, kNeighbors = 17;
  const Points points = shapes::with_noise(shapes::uneven(kCount, 50), 0.003);
  const NanoflannPoints adaptor{points};
  Tree tree(3, adaptor);
  cpu::MemoryMeter meter;
  cpu::SortSpace space(meter);
  cpu::SpatialIndex index(meter);
  index.build(points, {}, std::nullopt, space, cpu::best_kernels(), {});
  const auto found =
      all_lists(index, cpu::best_kernels(), points.size(), kNeighbors, std::numeric_limits<float>::max());
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::uint32_t ids[kNeighbors + 1];
    float squared[kNeighbors + 1];  // the point itself comes first
    ASSERT_EQ(tree.knnSearch(&points[i].x, kNeighbors + 1, ids, squared), std::size_t(kNeighbors + 1));
    for (std::size_t s = 0; s < kNeighbors; ++s)
      ASSERT_EQ(reference::squared_distance(points[i], points[found[i][s]]), squared[s + 1]) << "point " << i;
  }
}

constexpr int kLargestSample = 1024;

// The row that sample_neighborhoods promises for a query with the largest k, by brute force; invalid places are NaN.
std::vector<Point> expected_row(const Points& points, std::uint32_t query) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<Point> row;
  if (reference::is_valid(points[query])) {
    row.push_back(points[query]);
    for (const std::uint32_t j : reference::nearest(points, query, kLargestSample)) row.push_back(points[j]);
  }
  row.resize(kLargestSample + 1, Point{nan, nan, nan});
  return row;
}

bool same_or_both_nan(Point a, Point b) {
  return (std::isnan(a.x) && std::isnan(b.x)) || (a.x == b.x && a.y == b.y && a.z == b.z);
}

TEST(SampleNeighborhoods, returns_each_query_and_its_nearest_in_order) {
  for (const Points& points :
       {shapes::with_noise(shapes::waves(2000), 0.01), shapes::with_invalid(shapes::sphere(500), 4), shapes::grid(8),
        shapes::sphere(5), shapes::identical(40)}) {
    const std::unique_ptr<Backend> backend = make_cpu_backend(2);
    backend->upload(points, IndexOrder::fastest);
    backend->build_index(0, {}, {});
    std::vector<std::uint32_t> queries;
    std::vector<std::vector<Point>> expected;
    for (std::uint32_t i = 0; i < points.size(); i += 3) {
      queries.push_back(std::uint32_t(points.size()) - 1 - i);
      expected.push_back(expected_row(points, queries.back()));
    }
    for (const int k : {1, 6, 24, 100, kLargestSample}) {
      const std::size_t width = std::size_t(k) + 1;
      std::vector<Point> rows(queries.size() * width);
      backend->sampling().sample_neighborhoods(queries, k, rows);
      for (std::size_t i = 0; i < rows.size(); ++i)
        ASSERT_TRUE(same_or_both_nan(rows[i], expected[i / width][i % width]))
            << "place " << i % width << " of query " << queries[i / width] << ", k " << k;
    }
  }
}

TEST(CloudSample, bounds_hold_exactly_the_valid_points) {
  for (const Points& points :
       {shapes::with_invalid(shapes::sphere(500), 4), shapes::with_stray(shapes::plane(50), 1e6f)}) {
    Bounds expected{{1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f}, 0};
    for (const Point p : points) {
      if (!reference::is_valid(p)) continue;
      expected.min = {std::min(expected.min.x, p.x), std::min(expected.min.y, p.y), std::min(expected.min.z, p.z)};
      expected.max = {std::max(expected.max.x, p.x), std::max(expected.max.y, p.y), std::max(expected.max.z, p.z)};
      ++expected.valid;
    }
    const std::unique_ptr<Backend> backend = make_cpu_backend(2);
    backend->upload(points, IndexOrder::fastest);
    const Bounds found = backend->sampling().sample_cloud(1).bounds;
    EXPECT_EQ(found.valid, expected.valid);
    EXPECT_TRUE(same_or_both_nan(found.min, expected.min));
    EXPECT_TRUE(same_or_both_nan(found.max, expected.max));
  }
}

TEST(Neighbors, that_a_stop_leaves_without_an_answer_are_none) {
  std::stop_source source;
  source.request_stop();
  for (const int count : {1, 1000, 100000})
    expect_error(ErrorKind::interrupted, "interrupted",
                 [&] { nearest_neighbors(shapes::sphere(count), 8, source.get_token()); });
}

// the operator new of sanitizers ends the program where memory lacks
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
TEST(Neighbors, DISABLED_that_do_not_fit_into_memory_are_refused) {
#else
TEST(Neighbors, that_do_not_fit_into_memory_are_refused) {
#endif
  const std::vector<Point> points = shapes::sphere(1000);
  for (const std::size_t k : {std::size_t(1) << 50, std::numeric_limits<std::size_t>::max()})
    expect_error(ErrorKind::memory, "nearest of each of 1000 points", [&] { nearest_neighbors(points, k); });
}

}  // namespace
}  // namespace pointfair
