// SPDX-License-Identifier: Apache-2.0
// On a card the same rows in another order give the same results, and clouds full of ties those of the CPU.
#include <cmath>

#include "cuda_backend_test.h"
#include "shuffled_rows.h"

namespace pointfair {
namespace {

class CudaShuffledRows : public CudaBackendTest {
 protected:
  static constexpr int kPoints = 6000;
  static std::vector<shuffled_rows::NamedCloud> clouds() {
    auto result = shuffled_rows::clouds(kPoints);
    for (auto& cloud : result) cloud.points = cut(std::move(cloud.points));
    return result;
  }
};

TEST_F(CudaShuffledRows, have_the_same_lists) {
  for (const auto& cloud : clouds()) {
    shuffled_rows::expect_the_same_lists(*cuda_, cloud);
    shuffled_rows::expect_the_same_lists(in_parts(cloud.points.size()), cloud);
  }
}

TEST_F(CudaShuffledRows, have_the_same_sums_over_one_radius) {
  for (const auto& cloud : clouds()) shuffled_rows::expect_the_same_sums(*cuda_, cloud);
  shuffled_rows::expect_the_same_sums(*cuda_, shuffled_rows::in_few_cells(int(slow_tools::most_points(kPoints))));
}

TEST_F(CudaShuffledRows, full_of_ties_equal_the_cpu) {
  for (const auto& cloud : clouds())
    for (const int k : shuffled_rows::kEveryK) {
      const std::string name = cloud.name + ", k " + std::to_string(k);
      StageSettings settings = with_neighbors(k);
      settings.normals.sigma = 1e25f;  // what is far counts, too
      expect_same(cloud.points, settings, name.c_str());
      expect_same(cloud.points, with_neighbors(k, 0.0625f), (name + ", within a radius").c_str());
      expect_same(cloud.points, with_neighbors(k, 0, true, 0.0625f), (name + ", constrained").c_str());
    }
}

TEST_F(CudaShuffledRows, in_few_cells_of_the_curve_equal_the_cpu) {
  StageSettings settings = with_neighbors(0, 0.07f);
  settings.frame = frame_over({0.1f, -0.2f, -0.3f}, 0.8f);
  for (const auto& cloud : clouds()) expect_same(cloud.points, settings, cloud.name.c_str());
  expect_same(shuffled_rows::in_few_cells(int(slow_tools::most_points(kPoints))).points, settings, "in few cells");
  settings.neighbors.radius = 1e3f;  // sums over what lies far outside of the cube
  expect_same(shuffled_rows::in_few_cells(int(slow_tools::most_points(2000))).points, settings, "in few cells, far");
}

// More different points in one cell than are sorted at once anywhere, and more identical ones.
TEST_F(CudaShuffledRows, of_which_most_share_a_cell_equal_the_cpu) {
  const std::size_t count = slow_tools::most_points(100000);
  std::vector<Point> points = noisy_sphere(int(count), 31, 0.002);
  for (std::size_t i = 0; i < count * 7 / 10; ++i) {
    const Point p = points[i];
    points[i] = {1e9f + 3e4f * p.x, -2e9f + 3e4f * p.y, 4e9f + 3e4f * p.z};
  }
  for (std::size_t i = count * 7 / 10; i < count * 8 / 10; ++i) points[i] = {0.5f, 0.5f, 0.5f};
  points = shapes::permuted(points, shapes::shuffle_order(points.size(), 1));
  StageSettings settings = with_neighbors(0, 0.02f);
  settings.frame = frame_over({-1, -1, -1}, 2);
  expect_same(points, settings, "the sphere");
  settings.neighbors.radius = 4e2f;
  std::erase_if(points, [](Point p) { return p.x == 0.5f; });
  expect_same(points, settings, "the far ones");
}

// Rows of samples are sorted by a block or by a warp, and from afar by one warp.
TEST_F(CudaShuffledRows, have_the_same_rows_of_samples_as_on_the_cpu) {
  for (const auto& cloud : clouds()) {
    std::vector<std::uint32_t> queries;
    for (std::size_t i = 0; i < cloud.points.size(); i += i + 100 < cloud.points.size() ? 37 : 1)
      queries.push_back(std::uint32_t(i));
    for (Backend* backend : {cuda_.get(), cpu_.get()}) {
      backend->upload(cloud.points, IndexOrder::fastest);
      backend->build_index(0, std::nullopt, {});
    }
    for (const int k : {1, 6, 31, 32, 33, 115, 300, 600, 1024}) {
      SCOPED_TRACE(cloud.name + ", k " + std::to_string(k));
      std::vector<Point> found(queries.size() * std::size_t(k + 1)), expected = found;
      cuda_->sampling().sample_neighborhoods(queries, k, found);
      cpu_->sampling().sample_neighborhoods(queries, k, expected);
      std::size_t differ = 0;
      for (std::size_t i = 0; i < found.size(); ++i) {
        const Point a = found[i], b = expected[i];
        const bool both_missing = std::isnan(a.x) && std::isnan(b.x);
        differ += !both_missing && !(a.x == b.x && a.y == b.y && a.z == b.z);  // zeros of either sign
      }
      EXPECT_EQ(differ, 0u);
    }
  }
}

// While such a large cloud arrives its parts are sorted apart and merged; loaded, it is sorted at once.
TEST_F(CudaShuffledRows, of_parts_that_are_merged_along_the_curve_equal_the_whole) {
  std::vector<Point> points = noisy_sphere(17'000'000, 41, 0.0005);
  if (cut(points).size() < points.size()) return;        // takes all of its points
  for (std::size_t i = 0; i < points.size(); i += 16) {  // a million in some cells
    const auto near = [](float at, float c) { return at + 0x1p-25f * std::round(20 * c); };
    points[i] = {near(0.25f, points[i].x), near(0.25f, points[i].y), near(0.125f, points[i].z)};
  }
  StageSettings settings = with_neighbors(0, 0x1p-24f);
  settings.frame = frame_over({-1, -1, -1}, 2);
  const StageResults merged = run(*cuda_, points, settings, true);
  cuda_->upload(points, IndexOrder::fastest);  // its index is not along the curve, and is made again
  cuda_->build_index(0, std::nullopt, {});
  cuda_->build_index(0, settings.frame, {});
  cuda_->find_neighbors(0, settings.neighbors, {});
  cuda_->estimate_normals(0, settings.normals, {});
  cuda_->fair(0, settings.fairing, {});
  std::vector<Point> at_once(points.size()), normals(points.size());
  cuda_->download(0, at_once, {}, {});
  cuda_->download_normals(0, normals, {});
  EXPECT_EQ(difference(merged.points, at_once), "");
  EXPECT_EQ(difference(merged.normals, normals), "");
}

}  // namespace
}  // namespace pointfair
