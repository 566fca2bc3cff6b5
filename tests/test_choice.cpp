// SPDX-License-Identifier: Apache-2.0
// Whether a cloud is computed in memory or in tiles on disk: the rule, and what jobs ask for.
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "shapes.h"
#include "tiles/choice.hpp"

namespace pointfair {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kGiB = std::uint64_t{1} << 30;

TEST(Choice, is_tiles_where_a_cloud_takes_more_than_half_of_what_is_free) {
  const std::uint64_t points = 10'000'000;
  const std::uint64_t needed = bytes_in_memory(points, {}, Device::cpu);
  EXPECT_GE(needed, points * 174);
  EXPECT_FALSE(needs_tiles(points, {}, Device::cpu, {.free = 2 * needed}));
  EXPECT_TRUE(needs_tiles(points, {}, Device::cpu, {.free = 2 * needed - 2}));
}

TEST(Choice, goes_by_the_memory_that_is_given_whatever_is_free) {
  const std::uint64_t needed = bytes_in_memory(1'000'000, {}, Device::cpu);
  EXPECT_FALSE(needs_tiles(1'000'000, {}, Device::cpu, {.given = needed, .free = 1}));
  EXPECT_TRUE(needs_tiles(1'000'000, {}, Device::cpu, {.given = needed - 1, .free = 1000 * kGiB}));
}

TEST(Choice, counts_lists_of_neighbours_and_what_a_card_holds_in_its_own_memory) {
  Params list{.k = 100};
  EXPECT_GT(bytes_in_memory(1000, list, Device::cpu), bytes_in_memory(1000, {}, Device::cpu) + 799'999);
  EXPECT_LT(bytes_in_memory(1000, list, Device::cuda), bytes_in_memory(1000, {}, Device::cpu));
}

TEST(Choice, says_which_parameters_need_the_whole_cloud) {
  Params mesh, implicit, learned;
  mesh.connectivity = Connectivity::mesh;
  implicit.method = Method::implicit;
  learned.method = Method::learned;
  for (const auto& [params, flag] : {std::pair(mesh, "--connectivity mesh"), std::pair(implicit, "--method implicit"),
                                     std::pair(learned, "--method learned")})
    EXPECT_TRUE(why_not_in_parts(params).starts_with(flag)) << why_not_in_parts(params);
  EXPECT_EQ(why_not_in_parts(mesh, true).find("the memory"), std::string::npos);
  EXPECT_EQ(why_not_in_parts({}), "");
}

TEST(Choice, is_several_cards_for_clouds_that_are_worth_it) {
  const Cards two{2, 1000};
  EXPECT_FALSE(share({1, 1000}, 5000));
  EXPECT_FALSE(share(two, 999));
  EXPECT_TRUE(share(two, 1000));
  EXPECT_EQ(tiles_of(two, 1000), 4u);   // two for each card at least
  EXPECT_EQ(tiles_of(two, 2500), 10u);  // else four of as many points as are worth dividing
  EXPECT_EQ(tiles_of(two, 1 << 20), 16u);
}

TEST(Choice, is_more_tiles_until_they_are_too_small_to_help) {
  EXPECT_EQ(more_tiles({}, 8000, 1), 4u);
  EXPECT_EQ(more_tiles({}, 7999, 1), 0u);
  EXPECT_EQ(more_tiles({}, 1 << 20, 4), 8u);
  EXPECT_EQ(more_tiles({}, 15999, 4), 0u);
  EXPECT_EQ(more_tiles({3}, 1 << 20, 1), 24u);  // of several cards, as many as they are fed with
}

TEST(Choice, is_as_many_tiles_on_disk_as_the_memory_holds_with_their_halos) {
  const std::uint64_t points = 10'000'000, memory = std::uint64_t{200} << 20;
  const std::uint64_t tiles = tiles_on_disk(points, {}, memory);
  EXPECT_LE(bytes_of_tile(points, tiles, {}, memory), memory);
  EXPECT_EQ(bytes_of_tile(points, tiles - 1, {}, memory), memory) << "fewer tiles would fit";
  EXPECT_GT(tiles_on_disk(points, {.k = 100}, memory), 4 * tiles);
}

class ChoiceOfJobs : public testing::Test {
 protected:
  ChoiceOfJobs() {
    write(folder_ / "in.ply", {.points = shapes::sphere(2000, 3)});
    job_.inputs = {folder_ / "in.ply"};
    job_.output = folder_ / "out.ply";
  }

  bool in_tiles(const fs::path& work = {}) const { return TiledRun::choose(job_, work, Device(Device::cpu)).in_tiles; }

  const test::Folder folder_;
  TiledJob job_;
};

TEST_F(ChoiceOfJobs, a_small_file_is_computed_in_memory) { EXPECT_FALSE(in_tiles()); }

TEST_F(ChoiceOfJobs, tiles_that_are_asked_for_are_used) {
  EXPECT_TRUE(in_tiles(folder_ / "work"));
  job_.least_tiles = 2;
  EXPECT_TRUE(in_tiles());
}

TEST_F(ChoiceOfJobs, a_memory_that_does_not_suffice_means_tiles) {
  job_.memory = 2000 * 100;
  EXPECT_TRUE(in_tiles());
  job_.memory = 2000 * 1000;
  EXPECT_FALSE(in_tiles());
}

TEST_F(ChoiceOfJobs, standard_input_has_no_size_that_a_memory_could_be_compared_with) {
  job_.inputs = {"-"};
  EXPECT_FALSE(in_tiles());
  job_.memory = kGiB;
  EXPECT_THROW(in_tiles(), Error);
}

}  // namespace
}  // namespace pointfair
