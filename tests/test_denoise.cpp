// SPDX-License-Identifier: Apache-2.0
// Tiles one after the other: what a kill may cost.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include "forwarding_backend.h"
#include "runs.h"
#include "scale/denoise.hpp"
#include "scale/points_file.hpp"
#include "shapes.h"

namespace pointfair::scale {
namespace {

namespace fs = std::filesystem;

// Tells when the computing of a tile begins.
class Watched : public ForwardingBackend {
 public:
  explicit Watched(std::function<void()> begin) : ForwardingBackend(make_cpu_backend(2)), begin_(std::move(begin)) {}
  void upload(std::span<const Point> points, IndexOrder expected) override {
    begin_();
    ForwardingBackend::upload(points, expected);
  }

 private:
  std::function<void()> begin_;
};

FramedSettings list_stages() {
  FramedSettings stages;
  stages.neighbors.k = 8;
  stages.normals.sigma = stages.fairing.closeness_sigma = stages.fairing.similarity_sigma = 2;
  return stages;
}

// Points of a plane in strips, each a leaf and a tile.
void store_strips(const fs::path& path, std::uint32_t strips) {
  std::vector<Point> points;
  std::vector<std::uint32_t> indices;
  std::vector<Section> sections;
  for (std::uint32_t strip = 0; strip < strips; ++strip) {
    Bounds bounds = kNoBounds;
    for (int i = 0; i < 4000; ++i) {
      points.push_back({float(20 * strip + i % 20), float(i / 20), 0});
      indices.push_back(std::uint32_t(indices.size()));
      include(bounds, points.back());
    }
    sections.push_back({strip, {}, bounds.valid, bounds.min, bounds.max});
  }
  PointsWriter writer(path, {}, sections, {});
  writer.write(std::span(points));
  writer.write(std::span(indices));
  writer.finish();
}

TEST(Denoise, a_tile_is_computed_when_all_that_were_computed_before_are_on_the_disk) {
  constexpr std::uint32_t kTiles = 12;
  const test::Folder folder;
  store_strips(folder / "input", kTiles);
  const StoredCloud input({folder / "input"}, kTiles);
  const auto path_of = [&](std::uint32_t tile) { return folder / std::to_string(tile); };
  std::uint32_t given = 0, done = 0;
  const FramedSettings stages = list_stages();
  const auto next = [&]() -> std::optional<TileWork> {
    if (given == kTiles) return std::nullopt;
    const std::uint32_t tile = given++;
    return TileWork{input, {tile, tile + 1}, path_of(tile), stages, 1 << 20};
  };
  Watched backend([&] {
    while (done < kTiles && fs::exists(path_of(done))) ++done;
    EXPECT_EQ(given, std::min(kTiles, done + 2));  // this one, and one that is read
  });
  denoise_all(next, backend, {});
  for (std::uint32_t tile = 0; tile < kTiles; ++tile) EXPECT_TRUE(fs::exists(path_of(tile)));
}

TEST(Denoise, a_tile_that_the_device_has_no_room_for_is_computed_in_halves) {
  const test::Folder folder;
  store_strips(folder / "input", 3);
  const StoredCloud input({folder / "input"}, 3);
  const auto denoise = [&](SmallBackend& backend, const fs::path& path) {
    std::optional<TileWork> tile(TileWork{input, {1, 2}, path, list_stages(), 1 << 20});
    denoise_all([&] { return std::exchange(tile, std::nullopt); }, backend, {});
  };
  SmallBackend large(1 << 20), small(3000), tiny(500);
  denoise(large, folder / "whole");
  denoise(small, folder / "halves");
  EXPECT_EQ(large.uploads, 1);
  EXPECT_GT(small.uploads, 1);
  EXPECT_EQ(read_text(folder / "whole"), read_text(folder / "halves"));
  // smaller parts than these need as much
  expect_error(ErrorKind::memory, "no room", [&] { denoise(tiny, folder / "none"); });
}

}  // namespace
}  // namespace pointfair::scale
