// SPDX-License-Identifier: Apache-2.0
// Where a camera stood, from an organised cloud: cameras, scenes and noise of known truth, and grids of no camera.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "io/camera_centre.hpp"
#include "io_files.h"
#include "pointfair/file_info.hpp"
#include "pointfair/viewpoint.hpp"

namespace pointfair::test {
namespace {

using io::PixelPoint;

constexpr int kWidth = 80, kHeight = 60;

struct Frame {
  std::vector<PixelPoint> points;
  Position place{};
};

using Depths = std::function<double(double x, double y)>;  // along the ray (x, y, 1)

// Random boxes before a wall.
Depths boxes(std::mt19937& random) {
  std::uniform_real_distribution<double> any(-0.5, 0.5), deep(1, 3);
  std::vector<std::array<double, 4>> all(6);
  for (auto& box : all) box = {any(random), any(random), .08 + .1 * std::abs(any(random)), deep(random)};
  return [all](double x, double y) {
    double depth = 3.5 + .4 * x - .2 * y;
    for (const auto& [bx, by, size, its] : all)
      if (std::abs(x - bx) < size && std::abs(y - by) < size) depth = std::min(depth, its);
    return depth;
  };
}

std::array<std::array<double, 3>, 3> random_turn(std::mt19937& random) {
  std::normal_distribution<double> normal;
  double w = normal(random), x = normal(random), y = normal(random), z = normal(random);
  const double length = std::sqrt(w * w + x * x + y * y + z * z);
  w /= length, x /= length, y /= length, z /= length;
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
           {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
           {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}

// A camera anywhere; noise along the rays, and off them.
Frame frame(std::mt19937& random, const Depths& depths, double along, double off) {
  std::uniform_real_distribution<double> any(-1, 1);
  std::normal_distribution<double> normal;
  const auto turn = random_turn(random);
  const double focal = 60 + 20 * any(random), cx = kWidth / 2. + 5 * any(random), cy = kHeight / 2. + 5 * any(random);
  Frame result;
  result.place = {5 * any(random), 5 * any(random), 5 * any(random)};
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if ((u * 7 + v * 13) % 11 == 0) continue;  // a hole
      const double x = (u - cx) / focal, y = (v - cy) / focal, depth = depths(x, y) * (1 + along * normal(random));
      const double own[3] = {x * depth + off * normal(random), y * depth + off * normal(random), depth};
      PixelPoint point{result.place, {double(u), double(v)}};
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t k = 0; k < 3; ++k) point.point[r] += turn[r][k] * own[k];
      result.points.push_back(point);
    }
  }
  return result;
}

double error_of(const Frame& its) {
  const std::optional<Position> found = io::camera_centre(its.points);
  if (!found) return std::numeric_limits<double>::infinity();
  return std::hypot((*found)[0] - its.place[0], (*found)[1] - its.place[1], (*found)[2] - its.place[2]);
}

}  // namespace

TEST(CameraCentre, IsWhereTheCameraStoodWhateverTheNoiseAlongTheRays) {
  std::mt19937 random(1);
  for (int i = 0; i < 40; ++i) {
    EXPECT_LT(error_of(frame(random, boxes(random), 0.03, 0)), 1e-6);
    // some 2 m away, moved off their rays by 1 mm
    EXPECT_LT(error_of(frame(random, boxes(random), 0.03, 0.001)), 0.02);
  }
}

TEST(CameraCentre, IsNotClaimedWhereNothingTells) {
  std::mt19937 random(2);
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(io::camera_centre(frame(
                                       random, [](double x, double y) { return 2 / (1 + .3 * x - .2 * y); }, 0, 1e-4)
                                       .points))
        << "a plane";
    std::vector<PixelPoint> parallel, turning;
    const Depths depths = boxes(random);
    const double step = .007 + .0004 * i;  // radians
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const double x = u / 60. - .6, y = v / 60. - .5, depth = depths(x, y);
        parallel.push_back({{x, y, depth}, {double(u), double(v)}});
        const double azimuth = u * step, elevation = (v - 30) * step;
        turning.push_back({{depth * std::cos(azimuth) * std::cos(elevation),
                            depth * std::sin(azimuth) * std::cos(elevation), depth * std::sin(elevation)},
                           {double(u), double(v)}});
      }
    }
    EXPECT_FALSE(io::camera_centre(parallel)) << "parallel rays";
    EXPECT_FALSE(io::camera_centre(turning)) << "a scanner that turns";
    std::vector<PixelPoint> shuffled = frame(random, depths, 0, 0).points;
    for (std::size_t k = 0; k + 1 < shuffled.size(); ++k)
      std::swap(shuffled[k].point, shuffled[k + random() % (shuffled.size() - k)].point);
    EXPECT_FALSE(io::camera_centre(shuffled)) << "points in no order";
  }
  EXPECT_FALSE(io::camera_centre(std::vector<PixelPoint>(100)));
  EXPECT_FALSE(io::camera_centre({}));
}

TEST(CameraCentre, IsTheViewpointOfAnOrganisedFileThatSaysNone) {
  std::mt19937 random(3);
  const Depths depths = boxes(random);
  const auto file = [&](const std::string& viewpoint, int width, int height, const Position& at = {10, -3, 0}) {
    std::string text = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " + std::to_string(width) +
                       "\nHEIGHT " + std::to_string(height) + "\nVIEWPOINT " + viewpoint + " 1 0 0 0\nPOINTS " +
                       std::to_string(kWidth * kHeight) + "\nDATA ascii\n";
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const double x = (u - 40) / 60., y = (v - 30) / 60., depth = depths(x, y);
        if (u == 7) {
          text += "nan nan nan\n";
        } else {
          text += std::to_string(x * depth + at[0]) + " " + std::to_string(y * depth + at[1]) + " " +
                  std::to_string(depth) + "\n";
        }
      }
    }
    return parse(text, "a.pcd");
  };
  const Cloud cloud = file("0 0 0", kWidth, kHeight);
  const std::vector<Position> found = file_viewpoints(cloud);
  ASSERT_EQ(found.size(), 1U);
  const Position wanted{10, -3, 0};
  for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_NEAR(found[0][axis], wanted[axis], 1e-3);
  const auto says_sensor = [](const Cloud& its) {
    return std::ranges::any_of(file_info(its).rows, [](const auto& row) { return row.name == "sensor"; });
  };
  EXPECT_TRUE(says_sensor(cloud));
  const FileInfo info = file_info(file("0 0 0", kWidth, kHeight, {}));  // in the camera's own coordinates
  EXPECT_TRUE(std::ranges::any_of(info.rows, [](const auto& row) { return row.value.starts_with("0, 0, 0, where"); }));
  EXPECT_EQ(file_viewpoints(file("1 2 3", kWidth, kHeight)),
            (std::vector<Position>{{1, 2, 3}}));  // what it says counts
  EXPECT_FALSE(says_sensor(file("1 2 3", kWidth, kHeight)));
  EXPECT_TRUE(file_viewpoints(file("0 0 0", kWidth * kHeight, 1)).empty());
}

}  // namespace pointfair::test
