// SPDX-License-Identifier: Apache-2.0
// How a cloud is divided on its way to a card.
#include <algorithm>
#include <limits>

#include "cuda/runtime/parts.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

using Points = std::vector<Point>;

void expect_whole(const Parts& parts, std::size_t count) {
  ASSERT_FALSE(parts.ends.empty());
  EXPECT_TRUE(std::is_sorted(parts.ends.begin(), parts.ends.end()));
  EXPECT_EQ(parts.ends.back(), count);
}

// A sphere, cell after cell of a grid, the cells in Morton order.
Points in_morton_order(Points points) {
  const auto cell = [](Point p) {
    std::uint32_t key = 0;
    const float v[3] = {p.x, p.y, p.z};
    for (int axis = 0; axis < 3; ++axis)
      for (int bit = 0; bit < 6; ++bit)
        key |= (std::uint32_t((v[axis] + 1.5f) / 3 * 64) >> bit & 1u) << (3 * bit + axis);
    return key;
  };
  std::stable_sort(points.begin(), points.end(), [&](Point a, Point b) { return cell(a) < cell(b); });
  return points;
}
Points along_z(Points points) {
  std::sort(points.begin(), points.end(), [](Point a, Point b) { return a.z < b.z; });
  return points;
}
Points shuffled(Points points) {
  shapes::Random random(5);
  for (std::size_t i = points.size(); i > 1; --i)
    std::swap(points[i - 1], points[std::size_t(random.uniform() * double(i))]);
  return points;
}

TEST(Parts, of_one_size_cover_the_cloud) {
  for (const std::size_t count : {0, 1, 1023, 1024, 1025, 5000}) {
    const Parts parts = Parts::of(count, 1024);
    expect_whole(parts, count);
    EXPECT_EQ(parts.count(), count == 0 ? 1 : (count + 1023) / 1024);
    for (std::size_t part = 0; part + 1 < parts.count(); ++part) EXPECT_EQ(parts.size(part), 1024u);
  }
}

TEST(Parts, lie_apart_in_spatial_order_only) {
  const Points sphere = shuffled(shapes::sphere(1000000));
  EXPECT_EQ(plan_parts(sphere, true).count(), 1u);
  for (const Points& cloud : {along_z(sphere), in_morton_order(sphere)}) {
    const Parts parts = plan_parts(cloud, true);
    EXPECT_GT(parts.count(), 1u);
    expect_whole(parts, cloud.size());
    for (std::size_t part = 0; part + 1 < parts.count(); ++part) EXPECT_EQ(parts.size(part) % (1 << 15), 0u);
    EXPECT_EQ(plan_parts(cloud, false).count(), 1u);
  }
  Points twice = along_z(Points(sphere.begin(), sphere.begin() + 500000));
  twice.insert(twice.end(), twice.begin(), twice.begin() + 500000);
  expect_whole(plan_parts(twice, true), twice.size());
}

TEST(Parts, of_small_and_of_invalid_clouds_are_not_apart) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const int count : {0, 1, 1000, 300000}) {
    const Parts parts = plan_parts(along_z(shapes::sphere(count)), true);
    expect_whole(parts, std::size_t(count));
    EXPECT_EQ(parts.count(), 1u);
  }
  expect_whole(plan_parts(Points(1000000, Point{nan, 0, 0}), true), 1000000);
  EXPECT_EQ(plan_parts(Points(1000000, Point{1, 2, 3}), true).count(), 1u);
}

}  // namespace
}  // namespace pointfair
