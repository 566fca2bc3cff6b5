// SPDX-License-Identifier: Apache-2.0
// Consistent signs of normals, on shapes whose normals are known, with noise: those of a whole run, and those of the
// shape with signs at random.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <random>

#include "io_files.h"
#include "pointfair/normals.hpp"
#include "pointfair/pipeline.hpp"
#include "pointfair/positions.hpp"

namespace pointfair::test {
namespace {

struct Shape {
  std::vector<Point> points, normals;
  void add(const std::array<double, 3>& p, const std::array<double, 3>& n) {
    points.push_back({float(p[0]), float(p[1]), float(p[2])});
    normals.push_back({float(n[0]), float(n[1]), float(n[2])});
  }
};

constexpr std::size_t kPoints = 12000;
constexpr double kTurn = 2 * std::numbers::pi;

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) { return low + (high - low) * double(engine_()) / 4294967296.0; }

 private:
  std::mt19937 engine_;
};

Shape torus(double major, double minor) {
  Shape shape;
  Random random(1);
  while (shape.points.size() < kPoints) {
    const double u = random.uniform(0, kTurn), v = random.uniform(0, kTurn);
    if (random.uniform(0, 1) > (major + minor * std::cos(v)) / (major + minor)) continue;
    const std::array<double, 3> n{std::cos(v) * std::cos(u), std::cos(v) * std::sin(u), std::sin(v)};
    shape.add({major * std::cos(u) + minor * n[0], major * std::sin(u) + minor * n[1], minor * n[2]}, n);
  }
  return shape;
}

// Two legs and the half circle between them, open at both ends.
Shape u_pipe() {
  constexpr double kRadius = 1, kBend = 3, kLeg = 8, kArc = std::numbers::pi * kBend;
  Shape shape;
  Random random(2);
  for (std::size_t i = 0; i < kPoints; ++i) {
    const double along = random.uniform(0, 2 * kLeg + kArc), v = random.uniform(0, kTurn);
    std::array<double, 2> center, side;
    if (along < kLeg) {
      center = {-kBend, along - kLeg};
      side = {-1, 0};
    } else if (along < kLeg + kArc) {
      const double turn = std::numbers::pi - (along - kLeg) / kBend;
      side = {std::cos(turn), std::sin(turn)};
      center = {kBend * side[0], kBend * side[1]};
    } else {
      center = {kBend, kLeg + kArc - along};
      side = {1, 0};
    }
    const std::array<double, 3> n{side[0] * std::cos(v), side[1] * std::cos(v), std::sin(v)};
    shape.add({center[0] + kRadius * n[0], center[1] + kRadius * n[1], kRadius * n[2]}, n);
  }
  return shape;
}

// The walls of a box, seen from outside or from inside.
Shape box(const std::array<double, 3>& size, bool inside) {
  Shape shape;
  Random random(3);
  const std::array<double, 3> area{size[1] * size[2], size[0] * size[2], size[0] * size[1]};
  for (std::size_t i = 0; i < kPoints; ++i) {
    double choice = random.uniform(0, area[0] + area[1] + area[2]);
    std::size_t axis = 0;
    while (axis < 2 && choice > area[axis]) choice -= area[axis++];
    const double side = random.uniform(-1, 1) < 0 ? -1 : 1;
    std::array<double, 3> p, n{};
    for (std::size_t a = 0; a < 3; ++a) p[a] = random.uniform(-size[a] / 2, size[a] / 2);
    p[axis] = side * size[axis] / 2;
    n[axis] = inside ? -side : side;
    shape.add(p, n);
  }
  return shape;
}

using Vec = std::array<double, 3>;
struct Block {
  Vec low, high;
};

// Whether something of a block is between two places.
bool is_between(const Block& block, const Vec& from, const Vec& to) {
  constexpr double kNear = 1e-6;
  double enters = 0, leaves = 1 - kNear;
  for (std::size_t a = 0; a < 3; ++a) {
    const double way = to[a] - from[a], first = (block.low[a] - from[a]) / way,
                 second = (block.high[a] - from[a]) / way;
    enters = std::max(enters, std::min(first, second));
    leaves = std::min(leaves, std::max(first, second));
  }
  return enters < leaves - kNear;
}

// A table of 1.6 x 0.8 in a room of 6 x 4 x 2.5, its top so thick, or down to the floor: what a scanner sees from a
// place.
Shape room_with_a_table(double thickness, unsigned seed, const Vec& sensor) {
  constexpr double kHeight = 0.75, kLeg = 0.1;
  Random random(seed);
  const double x = random.uniform(0.5, 2.5), y = random.uniform(0.5, 2.5);
  const Block room{{0, 0, 0}, {6, 4, 2.5}};
  std::vector<Block> blocks{{{x, y, kHeight - thickness}, {x + 1.6, y + 0.8, kHeight}}};
  for (const double dx : {0.0, 1.6 - kLeg})
    for (const double dy : {0.0, 0.8 - kLeg})
      if (thickness < kHeight)
        blocks.push_back({{x + dx, y + dy, 0}, {x + dx + kLeg, y + dy + kLeg, kHeight - thickness}});
  Shape shape;
  const auto add_sides = [&](const Block& block, bool inside) {
    constexpr double kPerArea = 200;
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const bool high : {false, true}) {
        const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        const double area = (block.high[u] - block.low[u]) * (block.high[v] - block.low[v]);
        for (int i = 0; i < int(kPerArea * area); ++i) {
          Vec p, n{};
          for (std::size_t a = 0; a < 3; ++a) p[a] = random.uniform(block.low[a], block.high[a]);
          p[axis] = high ? block.high[axis] : block.low[axis];
          n[axis] = high != inside ? 1 : -1;
          if (std::none_of(blocks.begin(), blocks.end(), [&](const Block& b) { return is_between(b, sensor, p); }))
            shape.add(p, n);
        }
      }
  };
  add_sides(room, true);
  for (const Block& block : blocks) add_sides(block, false);
  return shape;
}

double spacing_of_plate(double side) { return side / std::sqrt(kPoints / 2.0); }

Shape plate() { return box({10, 10, 3 * spacing_of_plate(10)}, false); }

Shape noisy(Shape shape, double noise) {
  std::mt19937 engine(7);
  std::normal_distribution<float> normal(0, float(noise));
  for (std::size_t i = 0; i < shape.points.size(); ++i) {
    const float d = normal(engine);
    Point& p = shape.points[i];
    const Point& n = shape.normals[i];
    p = {p.x + d * n.x, p.y + d * n.y, p.z + d * n.z};
  }
  return shape;
}

double share_right(const std::vector<Point>& found, const Shape& shape) {
  std::size_t right = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Point &a = found[i], &b = shape.normals[i];
    right += a.x * b.x + a.y * b.y + a.z * b.z > 0;
  }
  return double(right) / double(found.size());
}

// The share of the normals of a run that look where the shape's do.
double after_run(const Shape& shape, std::span<const Position> viewpoints = {}) {
  Cloud cloud{.points = shape.points};
  Pipeline pipeline(Device{Device::cpu});
  pipeline.load(cloud);
  cloud = pipeline.run();
  std::vector<Point> normals(cloud.points.size());
  pipeline.normals(normals);
  orient_normals(cloud, normals, viewpoints);
  return share_right(normals, shape);
}

}  // namespace

TEST(Orient, NormalsOfClosedShapesLookOut) {
  EXPECT_GE(after_run(noisy(torus(3, 1), 0.03)), 0.98);
  EXPECT_GE(after_run(noisy(torus(3, 0.4), 0.02)), 0.98);
  EXPECT_GE(after_run(noisy(u_pipe(), 0.03)), 0.98);
  EXPECT_GE(after_run(noisy(box({3, 2, 1}, false), 0.01)), 0.98);
}

TEST(Orient, TheTwoSidesOfAThinPlateAreToldApart) {
  const double spacing = spacing_of_plate(10);
  EXPECT_GE(after_run(plate()), 0.98);
  EXPECT_GE(after_run(noisy(plate(), 0.1 * spacing)), 0.98);
  EXPECT_GE(after_run(noisy(plate(), 0.25 * spacing)), 0.98);
}

TEST(Orient, NormalsOfARoomLookInWhereTheScannerStoodThere) {
  const Shape room = noisy(box({6, 4, 2.5}, true), 0.01);
  const std::vector<Position> inside = {{1, 0.5, -0.2}};
  EXPECT_GE(after_run(room, inside), 0.98);
  const double outside = after_run(room);  // consistent all the same
  EXPECT_GE(std::max(outside, 1 - outside), 0.98);
}

TEST(Orient, ATableStandsInARoomAsAScannerSeesIt) {
  for (const double thickness : {0.03, 0.1, 0.75})
    for (const unsigned seed : {1U, 2U}) {
      const Vec sensor{0.8 + seed, 3.3, 1.5};
      const Shape room = noisy(room_with_a_table(thickness, seed, sensor), 0.01);
      EXPECT_GE(after_run(room, std::vector<Position>{sensor}), 0.98) << thickness << " " << seed;
      const double unknown = after_run(room);
      EXPECT_GE(std::max(unknown, 1 - unknown), 0.98) << thickness << " " << seed;
    }
}

TEST(Orient, GroundLooksUpAndEveryPartHasItsOwnSide) {
  Shape shape;
  Random random(5);
  for (std::size_t i = 0; i < kPoints; ++i) {
    const double x = random.uniform(-20, 20), y = random.uniform(-20, 20);
    const std::array<double, 3> slope{-std::cos(x / 4), 0, 1};
    const double length = std::hypot(slope[0], slope[2]);
    shape.add({x, y, 4 * std::sin(x / 4)}, {slope[0] / length, 0, slope[2] / length});
  }
  EXPECT_GE(after_run(shape), 0.98);
  Shape both = torus(3, 1), other = torus(3, 1);
  for (std::size_t i = 0; i < other.points.size(); ++i) {
    const Point &p = other.points[i], &n = other.normals[i];
    both.add({p.x + 30, p.y, p.z + 11}, {n.x, n.y, n.z});
  }
  EXPECT_GE(after_run(both), 0.98);
}

TEST(Orient, NoOrderOfThePointsNoSignAndNoNumberOfThreadsMatters) {
  const Shape shape = noisy(torus(3, 0.5), 0.02);
  Cloud cloud{.points = shape.points};
  std::vector<Point> once = shape.normals;
  orient_normals(cloud, once);
  EXPECT_EQ(share_right(once, shape), 1);
  std::vector<std::size_t> order(shape.points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(3));
  Cloud shuffled;
  std::vector<Point> normals;
  for (const std::size_t i : order) {
    shuffled.points.push_back(shape.points[i]);
    const Point& n = shape.normals[i];
    normals.push_back(i % 3 == 0 ? Point{-n.x, -n.y, -n.z} : n);
  }
  orient_normals(shuffled, normals);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Point &a = normals[i], &b = once[order[i]];
    ASSERT_TRUE(a.x == b.x && a.y == b.y && a.z == b.z);
  }
}

// Ten at one place have no spacing, and each of them the others as its nearest.
TEST(Orient, ManyPointsAtOnePlaceLookAsOneOfThemDoes) {
  const Shape shape = noisy(torus(3, 0.5), 0.02);
  std::vector<Point> once = shape.normals;
  orient_normals({.points = shape.points}, once);
  std::vector<std::size_t> of;  // the point of the shape that each is
  for (std::size_t i = 0; i < shape.points.size(); ++i) of.insert(of.end(), i % 2 == 0 ? 10 : 1, i);
  for (unsigned seed = 1; seed < 4; ++seed) {
    std::shuffle(of.begin(), of.end(), std::mt19937(seed));
    Cloud cloud;
    std::vector<Point> normals;
    for (std::size_t i = 0; i < of.size(); ++i) {
      cloud.points.push_back(shape.points[of[i]]);
      const Point& n = shape.normals[of[i]];
      normals.push_back(i % 3 == 0 ? Point{-n.x, -n.y, -n.z} : n);
    }
    orient_normals(cloud, normals);
    std::size_t others = 0;
    for (std::size_t i = 0; i < of.size(); ++i) {
      const Point &a = normals[i], &b = once[of[i]];
      others += a.x != b.x || a.y != b.y || a.z != b.z;
    }
    EXPECT_EQ(others, 0u);
  }
}

TEST(Orient, OppositeNormalsAtOnePlaceHaveAnAgreement) {
  Cloud cloud;
  std::vector<Point> normals;
  Random random(4);
  for (int i = 0; i < 200; ++i) {  // all differ, so that each is a sample
    cloud.points.push_back({float(i / 20), 0, 0});
    normals.push_back({float(random.uniform(-0.1, 0.1)), float(random.uniform(-0.1, 0.1)), i % 2 == 0 ? 1.0F : -1.0F});
  }
  orient_normals(cloud, normals);
  for (const Point& n : normals) EXPECT_EQ(n.z, 1);
}

TEST(Orient, PointsWithoutANormalAndFewPointsAreNoTrouble) {
  Cloud cloud{.points = {{0, 0, 0}, {NAN, 0, 0}, {1, 0, 0}, {0, 0, 0}}};
  std::vector<Point> normals = {{0, 0, -1}, {0, 0, 1}, {0, 0, 0}, {0, 0, 1}};
  orient_normals(cloud, normals);
  EXPECT_EQ(normals[0].z, 1);
  EXPECT_EQ(normals[1].z, 1);
  EXPECT_EQ(normals[2].z, 0);
  EXPECT_EQ(normals[3].z, 1);
  normals.pop_back();
  EXPECT_EQ(thrown_by([&] { orient_normals(cloud, normals); }).kind, ErrorKind::usage);
}

}  // namespace pointfair::test
