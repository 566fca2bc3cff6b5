// SPDX-License-Identifier: Apache-2.0
// Runs in tiles on disk: what is stored is found again, all of it, and nothing half-written is.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <locale>
#include <random>

#include "io/unfinished_files.hpp"
#include "pointfair/positions.hpp"
#include "pointfair/tiled_run.hpp"
#include "runs.h"
#include "scale/kept_leaves.hpp"
#include "scale/leaf_tree.hpp"
#include "scale/measure.hpp"
#include "scale/points_file.hpp"
#include "scale/stored_cloud.hpp"
#include "scale/tiled_run_access.hpp"
#include "scale/work_file.hpp"
#include "shapes.h"

namespace pointfair::scale {
namespace {

namespace fs = std::filesystem;
using test::Folder;

std::vector<Point> random_points(std::size_t count, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<float> coordinate(-1, 1);
  std::vector<Point> points(count);
  for (Point& p : points) p = {coordinate(generator), coordinate(generator), 0.1f * coordinate(generator)};
  return points;
}

// The points of one file, by leaf; indices count from `first`.
void store(const fs::path& path, const LeafTree& tree, const std::vector<Point>& points, std::uint64_t first) {
  std::vector<std::uint32_t> order(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = std::uint32_t(i);
  const auto leaf = [&](std::uint32_t i) { return tree.leaf_of(points[i]); };
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return leaf(a) < leaf(b); });
  std::vector<Bounds> bounds(tree.leaves(), kNoBounds);
  for (const std::uint32_t i : order) include(bounds[leaf(i)], points[i]);
  std::vector<Section> sections;
  for (std::uint32_t l = 0; l < bounds.size(); ++l)
    if (bounds[l].valid > 0) sections.push_back({l, {}, bounds[l].valid, bounds[l].min, bounds[l].max});
  PointsWriter writer(path, {.first_index = first}, sections, {});
  std::vector<Point> sorted;
  for (const std::uint32_t i : order) sorted.push_back(points[i]);
  writer.write(std::span(sorted));
  writer.write(std::span(order));
  writer.finish();
}

bool before(const Point& a, const Point& b) { return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z); }
bool same(const Point& a, const Point& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

TEST(Scale, leaves_of_a_tree_share_the_points_and_those_of_a_tile_follow_each_other) {
  for (const std::size_t tiles : {1, 2, 7, 60}) {
    std::vector<Point> points = random_points(20000, 1);
    LeafTree tree(points, tiles, 16);
    ASSERT_EQ(tree.tiles(), tiles);
    ASSERT_EQ(tree.leaves(), tiles * 16);
    std::vector<std::size_t> counts(tree.leaves());
    for (const Point& p : points) ++counts.at(tree.leaf_of(p));
    EXPECT_LE(*std::max_element(counts.begin(), counts.end()), 20000 / tree.leaves() * 2 + 2);
    for (std::size_t t = 0; t < tiles; ++t) EXPECT_LT(tree.tile_begin(t), tree.tile_begin(t + 1));
  }
}

TEST(Scale, a_tree_of_identical_points_is_one_leaf_and_a_saved_tree_is_the_same) {
  std::vector<Point> identical(100, Point{1, 2, 3});
  EXPECT_EQ(LeafTree(identical, 5, 16).leaves(), 1u);
  EXPECT_EQ(LeafTree(std::span<Point>(), 5, 16).leaves(), 1u);
  const Folder folder;
  std::vector<Point> points = random_points(5000, 2);
  const LeafTree tree(points, 3, 8);
  tree.save(folder / "tree");
  const LeafTree loaded(folder / "tree");
  ASSERT_EQ(loaded.tiles(), tree.tiles());
  for (const Point& p : points) ASSERT_EQ(loaded.leaf_of(p), tree.leaf_of(p));
}

TEST(Scale, leaves_that_are_kept_give_the_same_points_and_are_not_read_again) {
  const Folder folder;
  std::vector<Point> sample = random_points(3000, 3);
  const LeafTree tree(sample, 1, 40);
  const std::vector<Point> all = random_points(4000, 4);
  const std::vector<Point> first(all.begin(), all.begin() + 1500), second(all.begin() + 1500, all.end());
  store(folder / "a", tree, first, 0);
  store(folder / "b", tree, second, first.size());
  const StoredCloud cloud({folder / "a", folder / "b"}, tree.leaves());
  const point::Region region = {{-0.3f, -0.2f, -kUnbounded}, {0.7f, 0.25f, 0.05f}};
  std::vector<Point> expected;
  for (const Point& p : all)
    if (point::is_inside(region, to_vec3(p))) expected.push_back(p);
  std::sort(expected.begin(), expected.end(), before);
  for (const std::uint64_t most : {0, 700, 4000}) {
    KeptLeaves leaves(cloud, most);
    for (int look = 0; look < 2; ++look) {
      std::vector<Point> found;
      ASSERT_TRUE(leaves.load(cloud, region, expected.size(), found));
      std::sort(found.begin(), found.end(), before);
      EXPECT_TRUE(std::equal(found.begin(), found.end(), expected.begin(), expected.end(), same));
      std::uint64_t met = 0;
      leaves.for_all([&](std::span<const Point> points) { met += points.size(); });
      EXPECT_EQ(met, all.size());
      EXPECT_LE(leaves.kept(), most);
      if (most == all.size()) {
        EXPECT_EQ(leaves.kept(), most);
      }
    }
    if (most == all.size()) {  // what would be read again is not there
      fs::resize_file(folder / "a", 100);
      fs::resize_file(folder / "b", 100);
      std::vector<Point> found;
      EXPECT_TRUE(leaves.load(cloud, region, expected.size(), found));
      EXPECT_EQ(found.size(), expected.size());
      EXPECT_FALSE(leaves.load(cloud, region, expected.size() - 1, found));
      EXPECT_EQ(leaves.kept(), 0U);
    }
  }
}

TEST(Scale, what_dead_processes_left_unfinished_is_removed_and_what_live_ones_write_is_not) {
  const Folder folder;
  const std::string mine = io::unfinished_name(".pointfair-");
  const std::string owner = std::to_string(::getpid()) + "-";
  const std::string head = mine.substr(0, mine.rfind(owner));
  const auto named = [&](const std::string& process, unsigned number) {
    return head + process + "-" + std::to_string(number);
  };
  const std::string dead = std::to_string(1 << 30), parent = std::to_string(::getppid());
  const std::vector<std::string> kept = {mine, named(parent, 3), ".pointfair-elsewhere-" + dead + "-1", head + "notes",
                                         "out.ply"};
  const std::vector<std::string> removed = {named(dead, 0), named(std::to_string(::getpid()), 1U << 31)};
  for (const auto& names : {kept, removed})
    for (const std::string& name : names) std::ofstream(folder / name) << "some";
  fs::create_directory(folder / named(dead, 7));
  std::ofstream(folder / named(dead, 7) / "plan.txt") << "some";
  io::remove_abandoned(folder / "", ".pointfair-");
  for (const std::string& name : kept) EXPECT_TRUE(fs::exists(folder / name)) << name;
  for (const std::string& name : removed) EXPECT_FALSE(fs::exists(folder / name)) << name;
  EXPECT_EQ(folder.names().size(), kept.size());
}

TEST(Scale, a_file_that_is_not_finished_never_appears) {
  const Folder folder;
  {
    NewFile file(folder / "a");
    file.write("text", 4);
    EXPECT_FALSE(fs::exists(folder / "a"));
  }
  EXPECT_EQ(folder.names().size(), 0u);
  NewFile file(folder / "a");
  file.write("text", 4);
  file.finish();
  EXPECT_EQ(read_text(folder / "a"), "text");
}

// Whatever was in memory before, also between the members.
Noise noise_over(unsigned char before) {
  alignas(Noise) unsigned char bytes[sizeof(Noise)];
  std::memset(bytes, before, sizeof bytes);
  ::new (static_cast<void*>(bytes)) Noise{0.5, 1, 3, 4, 0.5, true, 5, 6, 7, true};
  Noise noise;
  std::memcpy(static_cast<void*>(&noise), bytes, sizeof noise);
  return noise;
}

TEST(Scale, what_was_measured_is_loaded_as_it_was_and_its_file_has_the_same_bytes_each_time) {
  const Folder folder;
  for (const unsigned char before : {'\0', '\xff'}) {
    Measured measured;
    const Noise noise = noise_over(before);
    std::memcpy(static_cast<void*>(&measured.estimate.noise), &noise, sizeof noise);
    measured.origin = {1, 2, 3};
    measured.frame.side = 8;
    measured.estimate.spacing.rho = 9;
    measured.ignored = 10;
    save(measured, folder / (before == 0 ? "a" : "b"));
  }
  const Measured loaded = load_measured(folder / "b");
  EXPECT_EQ(loaded.estimate.noise.sigma, 0.5);
  EXPECT_EQ(loaded.estimate.noise.gap, 4);
  EXPECT_TRUE(loaded.estimate.noise.depth_has_steps);
  EXPECT_EQ(loaded.estimate.noise.repeats, 7);
  EXPECT_TRUE(loaded.estimate.noise.is_shared);
  EXPECT_EQ(loaded.origin, (Position{1, 2, 3}));
  EXPECT_EQ(loaded.frame.side, 8);
  EXPECT_EQ(loaded.estimate.spacing.rho, 9);
  EXPECT_EQ(loaded.ignored, 10u);
  EXPECT_TRUE(read_text(folder / "a") == read_text(folder / "b"));
}

TEST(Scale, files_of_a_work_folder_that_hold_something_else_have_another_number) {
  const Folder folder;
  save(Measured{}, folder / "measured");
  EXPECT_EQ(std::tuple(kWorkFiles, sizeof(PointsHeader), sizeof(Section), fs::file_size(folder / "measured")),
            std::tuple(6, 232, 56, 432))
      << "raise kWorkFiles, and write the sizes here";
}

struct Grouped : std::numpunct<char> {
  char do_thousands_sep() const override { return '.'; }
  char do_decimal_point() const override { return ','; }
  std::string do_grouping() const override { return "\3"; }
};

TEST(Scale, plans_are_the_same_in_each_locale) {
  Plan plan;
  plan.memory = 1234567890123;
  plan.points = 1234567;
  plan.tiles = 12345;
  plan.zones = {.origin = {-0.1, 1234.5, 0}, .side = 1e-310};
  plan.coordinate_step = 0.001;
  plan.metres_per_unit = 0.3048;
  plan.sensor = Position{-12345.678, -0.0, 1e300};
  plan.files = {{.path = "a.las", .output = "b.las", .fingerprint = "f", .points = 1234567}};
  plan.chunks = {{.file = 0, .first_block = 0, .end_block = 1234, .first_point = 0, .points = 1234567}};
  const std::string text = text_of(plan);
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new Grouped));
  const std::string grouped = text_of(plan);
  const Plan read = plan_of(text, "plan");
  std::locale::global(before);
  EXPECT_EQ(grouped, text);
  EXPECT_EQ(text_of(read), text);
  EXPECT_EQ(std::tuple(read.points, read.zones.side, read.zones.origin, read.coordinate_step, read.sensor),
            std::tuple(plan.points, plan.zones.side, plan.zones.origin, plan.coordinate_step, plan.sensor));
  EXPECT_EQ(read.chunks.back().points, 1234567u);
}

TEST(Scale, a_damaged_file_of_points_is_refused) {
  const Folder folder;
  std::vector<Point> points = random_points(100, 6);
  const LeafTree tree(points, 1, 4);
  store(folder / "a", tree, points, 0);
  const auto size = fs::file_size(folder / "a");
  for (const auto cut : {size - 1, size / 2, std::uintmax_t{3}}) {
    fs::resize_file(folder / "a", cut);
    EXPECT_THROW(PointsFile{folder / "a"}, Error) << cut;
  }
}

// Spatial order, of which a guess sees only some places, and coordinates far from zero in all of them.
TEST(Scale, the_origin_is_that_of_the_whole_file_where_the_guess_is_another) {
  const Folder folder;
  std::mt19937 generator(7);
  std::normal_distribution<double> noise(0, 0.01);
  std::ofstream text(folder / "in.xyz");
  text.precision(12);
  for (int i = 0; i < 60000; ++i) {
    const double x = 1000 + (i % 300) * 0.1, y = 5000 + (i / 300) * 0.1;
    text << x << " " << y << " " << noise(generator) << "\n";
  }
  text.close();
  const Cloud whole = read(folder / "in.xyz");
  Pipeline pipeline = loaded(whole);
  write(folder / "whole.xyz", pipeline.run());
  TiledRun::plan({.inputs = {folder / "in.xyz"}, .output = folder / "out.xyz", .least_tiles = 3}, folder / "work");
  // as if another had been guessed
  const std::string plan = read_text(folder / "work/plan.txt");
  std::string other = plan;
  const auto at = other.find("\norigin ") + 8;
  other.replace(at, other.find('\n', at) - at, "0x1.f4p+9 0x1.388p+12 0x0p+0");
  std::ofstream(folder / "work/plan.txt") << other;
  {
    TiledRun run(folder / "work", Device::cpu);
    run.run("ingest", 0);
    fs::copy_file(folder / "work/chunk-00000", folder / "chunk");
    run.run("measure", 0);
    EXPECT_TRUE(fs::exists(folder / "work/origin"));
    EXPECT_FALSE(fs::exists(folder / "work/chunk-00000"));
  }
  // as if it had been killed before it removed what it had taken in first
  fs::remove(folder / "work/measured");
  fs::remove(folder / "work/recut-00000");
  fs::rename(folder / "chunk", folder / "work/chunk-00000");
  TiledRun run(folder / "work", Device::cpu);
  run.run("measure", 0);
  run.run_all();
  EXPECT_EQ(read_text(folder / "out.xyz"), read_text(folder / "whole.xyz"));
  EXPECT_FALSE(fs::exists(folder / "work/chunk-00000"));
}

// Two CPUs stand for the cards of a machine.
TEST(Scale, several_workers_share_the_tiles_and_leave_the_bits_of_one) {
  const Folder folder;
  write(folder / "in.ply", {.points = shapes::with_noise(shapes::sphere(30000), 0.004)});
  Pipeline pipeline = loaded(read(folder / "in.ply"));
  write(folder / "whole.ply", pipeline.run());
  TiledJob job{.inputs = {folder / "in.ply"},
               .output = folder / "out.ply",
               .memory = std::uint64_t{1} << 30,
               .least_tiles = 9,
               .workers = 2};
  TiledRun::plan(job, folder / "work");
  EXPECT_NE(read_text(folder / "work/plan.txt").find("\nmemory 536870912\n"), std::string::npos) << "they share it";
  TiledRun run = TiledRunAccess::make(folder / "work", {Device::cpu, Device::cpu});
  run.run_all();
  EXPECT_EQ(read_text(folder / "out.ply"), read_text(folder / "whole.ply"));
  EXPECT_EQ(run.report().tiles, 9u);
}

// As it would otherwise be tried again with ever smaller parts of the tile.
TEST(Scale, a_place_with_more_points_than_fit_is_an_error_that_names_one_of_them) {
  const Folder folder;
  Cloud cloud{.points = random_points(1000, 8)};
  cloud.points.resize(400000, Point{0.25f, 0.5f, 0});
  write(folder / "in.ply", cloud);
  TiledJob job{.inputs = {folder / "in.ply"}, .output = folder / "out.ply", .memory = std::uint64_t{64} << 20};
  job.params.k = 8;
  job.params.normal_sigma = job.params.closeness_sigma = job.params.similarity_sigma = 0.1;
  job.params.outliers = Outliers::off;
  TiledRun::plan(job, folder / "work");
  TiledRun run(folder / "work", Device::cpu);
  expect_error(ErrorKind::memory, "point ", [&] { run.run_all(); });
  EXPECT_FALSE(fs::exists(folder / "out.ply"));
}

}  // namespace
}  // namespace pointfair::scale
