// SPDX-License-Identifier: Apache-2.0
// Zones of wide clouds: which clouds need them, and that a cloud is the same points from wherever it is seen.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <string>
#include <tuple>

#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "scale/kept_leaves.hpp"
#include "scale/stored_cloud.hpp"
#include "scale/zones.hpp"

namespace pointfair::scale {
namespace {

namespace fs = std::filesystem;

// Two towns of ground, so far apart, points every `spacing`.
std::vector<Position> towns(double apart, double spacing, std::size_t side = 40) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> aside(-0.3, 0.3);
  std::vector<Position> points;
  for (std::size_t i = 0; i < 2 * side * side; ++i) {
    const double x = spacing * (double(i % side) + aside(generator));
    const double y = spacing * (double(i / side % side) + aside(generator));
    points.push_back({5e5 + x + (i % 2 == 0 ? apart : 0), 5.4e6 + y, 100 + spacing * aside(generator)});
  }
  return points;
}
double side_of(const std::vector<Position>& points, double step, std::uint64_t all = 0) {
  return zone_side(points, all == 0 ? points.size() : all, io::choose_origin(points), step);
}

TEST(Zones, a_cloud_needs_zones_where_floats_are_coarse_against_its_file_and_its_spacing) {
  EXPECT_EQ(side_of(towns(1e4, 0.25), 0.001), 0);  // half a millimetre at 5 km
  EXPECT_EQ(side_of(towns(4e4, 0.4), 0.001), 0);   // 2 mm at 20 km, less than 1/128 of the spacing
  EXPECT_EQ(side_of(towns(1e5, 0.25), 0.01), 0);   // not coarser than the file
  EXPECT_GT(side_of(towns(1e5, 0.25), 0.001), 0);  // 4 mm at 50 km
  EXPECT_EQ(side_of(towns(1e5, 0.25), 0), 0);      // a file that does not say its steps
  EXPECT_GT(side_of(towns(4e5, 0.25), 0), 0);      // 16 mm at 200 km
  EXPECT_EQ(side_of(towns(1e5, 0.25), 1e-7), 0);   // steps so fine say as little
  EXPECT_EQ(side_of(towns(4e5, 0.25), std::numeric_limits<double>::infinity()), 0);  // floats as they are
  EXPECT_EQ(side_of({}, 0), 0);
}

TEST(Zones, the_unit_of_length_does_not_matter) {
  for (const double unit : {0x1p-20, 0x1p10}) {
    std::vector<Position> points = towns(4e5, 0.25);
    const double side = side_of(points, 0.001);
    for (Position& p : points)
      for (double& c : p) c *= unit;
    EXPECT_EQ(side_of(points, 0.001 * unit), side * unit);
  }
}

TEST(Zones, floats_in_a_zone_are_at_least_eight_times_as_fine_as_those_that_are_too_coarse) {
  for (const double apart : {1e5, 4e5, 1e8}) {
    const std::vector<Position> points = towns(apart, 0.25);
    const Zones zones{io::choose_origin(points), side_of(points, 0.001)};
    ASSERT_GT(zones.side, 0);
    EXPECT_LE(zones.float_step(), 0.25 / 128 / 8);
    EXPECT_EQ(std::exp2(std::round(std::log2(zones.side))), zones.side);
    for (const Position& p : points) {
      const Position middle = zones.middle_of(zones.zone_of(p));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double offset = p[axis] - middle[axis];
        EXPECT_LE(std::abs(offset), zones.side / 2);
        EXPECT_LE(std::abs(double(float(offset)) - offset), zones.float_step() / 2);
      }
    }
  }
}

TEST(Zones, a_position_that_is_not_finite_or_very_far_has_a_zone) {
  const Zones zones{{}, 8192};
  const double nan = std::numeric_limits<double>::quiet_NaN(), far = 1e300;
  EXPECT_EQ(zones.zone_of({nan, far, -far}), (Zone{-(1 << 30), 1 << 30, -(1 << 30)}));
  EXPECT_EQ(zones.zone_of({-1, 0, 8192}), (Zone{-1, 0, 1}));
}

TEST(Zones, neither_the_order_of_points_nor_a_few_strays_decide) {
  std::vector<Position> points = towns(4e5, 0.25);
  const double side = side_of(points, 0.001);
  std::shuffle(points.begin(), points.end(), std::mt19937(2));
  EXPECT_EQ(side_of(points, 0.001), side);
  std::vector<Position> narrow = towns(100, 0.25);
  for (std::size_t i = 0; i < narrow.size() / 200; ++i) narrow[i * 200] = {0, 0, 0};  // "no return"
  EXPECT_EQ(side_of(narrow, 0.001), 0);
  EXPECT_EQ(side_of(std::vector<Position>(1000, Position{1, 2, 3}), 0), 0);
}

// Points in two leaves and several zones, as a task leaves them.
class WideCloud : public testing::Test {
 protected:
  WideCloud() {
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> coordinate(-300, 300);
    for (int i = 0; i < 3000; ++i)
      points_.push_back({5e5 + coordinate(generator), 5.4e6 + coordinate(generator), coordinate(generator)});
    for (std::size_t half = 0; half < 2; ++half) store(half);
  }

  fs::path path(std::size_t half) const { return folder_ / std::to_string(half); }
  StoredCloud cloud() const { return StoredCloud({path(0), path(1)}, 2, zones_); }
  std::uint32_t tree_leaf(std::size_t i) const { return points_[i][0] < 5e5 ? 0 : 1; }
  Point stored(std::size_t i) const {
    const Position offset = difference(points_[i], zones_.middle_of(zones_.zone_of(points_[i])));
    return {float(offset[0]), float(offset[1]), float(offset[2])};
  }
  // From another origin.
  Point seen(std::size_t i, const Position& origin) const {
    return shifted(stored(i), difference(zones_.middle_of(zones_.zone_of(points_[i])), origin));
  }

  const test::Folder folder_;
  const Zones zones_{{500000, 5400000, 0}, 256};
  std::vector<Position> points_;

 private:
  void store(std::size_t half) const {
    std::vector<std::uint32_t> order;
    for (std::size_t i = half; i < points_.size(); i += 2) order.push_back(std::uint32_t(i));
    const auto key = [&](std::uint32_t i) { return std::tuple(tree_leaf(i), zones_.zone_of(points_[i])); };
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return key(a) < key(b); });
    std::vector<Section> sections;
    std::vector<Point> sorted;
    for (const std::uint32_t i : order) {
      const auto [leaf, zone] = key(i);
      if (sections.empty() || sections.back().key != leaf || sections.back().zone != zone)
        sections.push_back({leaf, zone, 0, kNoBounds.min, kNoBounds.max});
      Bounds bounds{sections.back().min, sections.back().max, 0};
      include(bounds, stored(i));
      sections.back() = {leaf, zone, sections.back().count + 1, bounds.min, bounds.max};
      sorted.push_back(stored(i));
    }
    PointsWriter writer(path(half), {}, sections, {});
    writer.write(std::span(sorted));
    writer.write(std::span(order));
    writer.finish();
  }
};

using Set = std::multiset<std::tuple<float, float, float>>;
Set set_of(std::span<const Point> points) {
  Set set;
  for (const Point& p : points) set.insert({p.x, p.y, p.z});
  return set;
}

TEST_F(WideCloud, is_the_same_points_from_wherever_it_is_seen) {
  const StoredCloud cloud = this->cloud();
  EXPECT_GT(cloud.leaves().size(), 12u);
  for (const Position& origin : {zones_.origin, zones_.middle_of(zones_.zone_of(points_[7])), Position{0, 0, 0}}) {
    const StoredCloud here = cloud.seen_from(origin);
    std::vector<Point> all, visited;
    Bounds bounds = kNoBounds;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      all.push_back(seen(i, origin));
      include(bounds, all.back());
    }
    EXPECT_EQ(here.bounds().valid, points_.size());
    EXPECT_EQ(std::tie(here.bounds().min.x, here.bounds().max.y), std::tie(bounds.min.x, bounds.max.y));
    here.for_all([&](std::span<const Point> some) { visited.insert(visited.end(), some.begin(), some.end()); });
    EXPECT_EQ(set_of(visited), set_of(all));
    for (std::uint32_t tile = 0; tile < 2; ++tile) {
      std::vector<Point> points;
      std::vector<std::uint64_t> indices;
      here.read(here.leaves_of({tile, tile + 1}), points);
      here.read_stored(here.leaves_of({tile, tile + 1}), nullptr, &indices);
      ASSERT_EQ(points.size(), indices.size());
      for (std::size_t i = 0; i < points.size(); ++i) {
        ASSERT_EQ(tree_leaf(indices[i]), tile);
        ASSERT_EQ(set_of({&points[i], 1}), set_of({&all[indices[i]], 1}));
      }
    }
    const point::Region region{to_vec3(here.seen_from(origin).bounds().min), to_vec3(all[5])};
    std::vector<Point> found, kept, expected;
    for (const Point& p : all)
      if (point::is_inside(region, to_vec3(p))) expected.push_back(p);
    std::vector<std::uint32_t> copies;
    ASSERT_TRUE(here.append(region, {}, points_.size(), found, copies));
    EXPECT_EQ(set_of(found), set_of(expected));
    EXPECT_TRUE(copies.empty());
    KeptLeaves leaves(cloud, points_.size());
    for (int look = 0; look < 2; ++look) {
      ASSERT_TRUE(leaves.load(here, region, points_.size(), kept));
      EXPECT_EQ(set_of(kept), set_of(expected));
    }
  }
}

TEST_F(WideCloud, computes_few_points_of_a_zone_with_the_fullest_beside_them) {
  const StoredCloud cloud = this->cloud();
  std::map<Zone, std::uint64_t> counts;
  for (const Position& p : points_) ++counts[zones_.zone_of(p)];
  std::size_t with_others = 0;
  for (std::uint32_t leaf = 0; leaf < cloud.leaves().size(); ++leaf) {
    const Zone& own = cloud.zone_of(leaf);
    if (counts[own] >= kFewestOfZone) {
      EXPECT_EQ(cloud.origin_for(leaf), zones_.middle_of(own));
      continue;
    }
    ++with_others;
    std::uint64_t most = 0;
    for (const auto& [zone, count] : counts) {
      const bool is_beside =
          std::abs(zone[0] - own[0]) < 2 && std::abs(zone[1] - own[1]) < 2 && std::abs(zone[2] - own[2]) < 2;
      if (is_beside) most = std::max(most, count);
    }
    ASSERT_GE(most, kFewestOfZone);
    const Position middle = cloud.origin_for(leaf);
    EXPECT_EQ(counts[zones_.zone_of(middle)], most);
    EXPECT_EQ(zones_.middle_of(zones_.zone_of(middle)), middle);
  }
  EXPECT_GT(with_others, 0u);
}

TEST_F(WideCloud, keeps_the_bits_of_a_zone_that_is_seen_from_its_middle) {
  const StoredCloud cloud = this->cloud();
  for (std::uint32_t leaf = 0; leaf < cloud.leaves().size(); ++leaf) {
    const StoredCloud here = cloud.seen_from(zones_.middle_of(cloud.zone_of(leaf)));
    std::vector<Point> stored, points;
    here.read_stored({leaf, leaf + 1}, &stored, nullptr);
    here.read({leaf, leaf + 1}, points);
    EXPECT_EQ(set_of(stored), set_of(points));
  }
}

TEST(Zones, settings_of_a_zone_hold_at_the_same_places) {
  const Zones zones{{5e5, 5.4e6, 0}, 8192};
  FramedSettings stages;
  NoiseLevels levels;
  levels.levels.assign(8, 2.0f);
  levels.nodes = 2;
  levels.first = {-1000, -2000, 0};
  levels.nodes_per_unit = 0.25f;
  stages.neighbors.levels = std::make_shared<const NoiseLevels>(levels);
  stages.fairing.sensors = std::make_shared<const SensorPlaces>(SensorPlaces{{{100, 200, 2}}});
  const Position middle = zones.middle_of(zones.zone_of({7e5, 5.2e6, 0}));
  const FramedSettings moved = relative_to(middle, stages, zones);
  EXPECT_NEAR(moved.neighbors.levels->first.x + middle[0], 5e5 - 1000, 0.02);
  EXPECT_NEAR(moved.fairing.sensors->places[0].y + middle[1], 5.4e6 + 200, 0.02);
  EXPECT_EQ(moved.neighbors.levels->levels, levels.levels);
  EXPECT_EQ(stages.neighbors.levels->first.x, -1000);
  EXPECT_FALSE(moved.frame.has_value());
  const FramedSettings same = relative_to(zones.origin, stages, zones);
  EXPECT_EQ(same.neighbors.levels, stages.neighbors.levels);
}

// A run in tiles on disk, which is what the program does with a survey, is the oracle of one in memory.
TEST(Zones, a_pipeline_and_a_run_in_tiles_write_the_same_bytes) {
  const test::Folder folder;
  int tried = 0, in_zones = 0;
  for (const double spacings : {1e4, 1e5, 1e6, 1e7}) {
    const double spacing = 0.25;
    std::vector<Position> points = towns(spacings * spacing, spacing);
    points[7] = {std::numeric_limits<double>::quiet_NaN(), 5.4e6, 100};
    if (spacings == 1e6)  // a part is there twice
      for (std::size_t i = 0; i < 900; ++i) points.push_back(points[3 * i]);
    std::shuffle(points.begin(), points.end(), std::mt19937(4));
    for (const char* const extension : {".ply", ".las"}) {
      SCOPED_TRACE(std::to_string(spacings) + extension);
      const auto named = [&](const char* name) { return folder / (name + std::string(extension)); };
      std::vector<Position> written = points;
      if (extension == std::string(".las")) std::erase_if(written, [](const Position& p) { return !(p[0] == p[0]); });
      Cloud cloud = make_cloud(written);
      WriteOptions options{.overwrite = true};
      write(named("in"), cloud, options);
      cloud = read(named("in"));
      Pipeline pipeline = loaded(cloud);
      const Cloud denoised = pipeline.run({});
      write(named("memory"), denoised, options);
      TiledJob job{.inputs = {named("in")}, .output = named("tiles")};
      job.write.overwrite = true;
      job.least_tiles = 5;
      TiledRun::plan(job, folder / "work");
      TiledRun(folder / "work", Device::cpu).run_all();
      fs::remove_all(folder / "work");
      EXPECT_TRUE(test::file_bytes(named("memory")) == test::file_bytes(named("tiles")));
      EXPECT_TRUE(test::file_bytes(named("memory")) != test::file_bytes(named("in")));
      std::vector<Position> now(written.size());
      positions(denoised, now);
      EXPECT_EQ(denoised.points.size(), written.size());
      ++tried;
      in_zones += TiledRun::float_step_in_zones(cloud) > 0;
    }
  }
  EXPECT_EQ(tried, 8);
  EXPECT_GE(in_zones, 4);
}

// Two squares, so far apart that floats around one origin step by more than points are apart.
Cloud far_squares() {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.02);
  std::uniform_real_distribution<double> place(0, 7);
  std::vector<Position> points;
  for (const double x : {0.0, 1e7})
    for (int i = 0; i < 20000; ++i) points.push_back({x + place(random), place(random), noise(random)});
  return make_cloud(points);
}

TEST(Zones, resolved_parameters_are_those_of_a_run_in_zones) {
  for (const Cloud& cloud : {far_squares(), make_cloud(towns(4e5, 0.25))}) {
    for (const Params& asked : {Params{}, Params{.k = 12}, Params{.noise = Length(0.1, Length::Unit::spacing)}}) {
      Pipeline pipeline = loaded(cloud);
      const Params resolved = pipeline.resolve(asked);
      pipeline.run(asked);
      ASSERT_EQ(pipeline.report().stages.front().name, "zones");
      EXPECT_EQ(resolved, pipeline.report().params);
    }
  }
}

TEST(Zones, normals_that_would_mean_nothing_are_refused_before_the_run) {
  const Cloud cloud = far_squares();
  Pipeline pipeline = loaded(cloud);
  EXPECT_THROW(pipeline.check_normals(), Error);
  pipeline.run({});
  std::vector<Point> normals(cloud.points.size());
  EXPECT_THROW(pipeline.normals(normals), Error);
  pipeline.check_normals({.method = Method::implicit});  // is computed around one origin
  Pipeline near = loaded(make_cloud(towns(4e5, 0.25)));
  near.check_normals();
  near.run({});
  near.normals(normals = std::vector<Point>(near.report().points));
}

TEST(Zones, one_system_of_equations_holds_the_points_of_all) {
  const Cloud cloud = make_cloud(towns(1e7, 0.25));
  Pipeline pipeline = loaded(cloud);
  pipeline.run(Params{});
  EXPECT_EQ(pipeline.report().stages.front().name, "zones");
  pipeline.run({.method = Method::implicit});
  EXPECT_GT(pipeline.report().solver.iterations, 0u);
}

TEST(Zones, arrays_of_doubles_give_what_a_file_of_them_gives) {
  const std::vector<Position> points = towns(4e5, 0.25);
  const test::Folder folder;
  const fs::path path = folder / "array.ply";
  const Cloud array = make_cloud(points);
  write(path, array);
  const Cloud file = read(path);
  std::vector<std::vector<Position>> results;
  for (const Cloud* const cloud : {&array, &file}) {
    Pipeline pipeline = loaded(*cloud);
    EXPECT_LT(pipeline.estimates().float_step, 0.002);
    Cloud moved = pipeline.run({});
    apply_limits({.box = Box{{5e5 - 10, 0, 0}, {5e5 + 10, 6e6, 200}}}, *cloud, moved);
    positions(moved, results.emplace_back(points.size()));
  }
  EXPECT_EQ(results[0], results[1]);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points.size(); ++i) kept += results[0][i] == points[i];
  EXPECT_GE(kept, points.size() / 2);
  EXPECT_LT(kept, points.size());
}

}  // namespace
}  // namespace pointfair::scale
