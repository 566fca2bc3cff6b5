// SPDX-License-Identifier: Apache-2.0
#include "scale/ingest.hpp"

#include <algorithm>
#include <atomic>
#include <limits>

#include "io/parallel.hpp"
#include "scale/given.hpp"
#include "scale/points_file.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair::scale {
namespace {

constexpr std::uint32_t kNoLeaf = std::numeric_limits<std::uint32_t>::max();

struct Taken {
  std::vector<Point> points;
  std::vector<std::uint32_t> leaves;  // kNoLeaf: not valid
  std::vector<double> shown;          // of the origin: io::OriginSample::state()
  std::uint64_t ignored = 0;
};

Taken take(const std::shared_ptr<Source>& source, const InputChunk& chunk, const Plan& plan, const LeafTree& tree,
           const std::stop_token& stop) {
  Taken taken;
  taken.points.resize(chunk.points);
  taken.leaves.resize(chunk.points);
  const std::size_t blocks = chunk.end_block - chunk.first_block;
  std::vector<io::OriginSample> offered(blocks, io::OriginSample(plan.points));
  const std::uint64_t first = source->block_begin(chunk.first_block);
  std::atomic<std::uint64_t> ignored = 0;
  io::for_each_block(blocks, [&](std::size_t i) {
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    const std::size_t block = chunk.first_block + i;
    const std::size_t at = source->block_begin(block) - first, count = source->block_size(block);
    ignored += place_seen(source, block, plan.limits, std::span(taken.points).subspan(at, count), offered[i]);
    for (std::size_t p = at; p < at + count; ++p)
      taken.leaves[p] = is_indexed(taken.points[p]) ? tree.leaf_of(taken.points[p]) : kNoLeaf;
  });
  taken.ignored = ignored;
  io::OriginSample all(plan.points);
  for (const io::OriginSample& some : offered) all.offer_all(some);
  for (const Position& position : all.state()) taken.shown.insert(taken.shown.end(), position.begin(), position.end());
  return taken;
}

std::vector<Section> sections_of(const Taken& taken, std::size_t leaves) {
  std::vector<Bounds> bounds(leaves, kNoBounds);
  for (std::size_t i = 0; i < taken.points.size(); ++i)
    if (taken.leaves[i] != kNoLeaf) include(bounds[taken.leaves[i]], taken.points[i]);
  std::vector<Section> sections;
  for (std::uint32_t leaf = 0; leaf < leaves; ++leaf)
    if (bounds[leaf].valid > 0) sections.push_back({leaf, 0, bounds[leaf].valid, bounds[leaf].min, bounds[leaf].max});
  return sections;
}

// Places of the points, leaf after leaf, in their order within each.
std::vector<std::uint32_t> order_by_leaf(const Taken& taken, const std::vector<Section>& sections, std::size_t leaves) {
  std::vector<std::uint64_t> next(leaves, 0);
  std::uint64_t total = 0;
  for (const Section& section : sections) {
    next[section.key] = total;
    total += section.count;
  }
  std::vector<std::uint32_t> order(total);
  for (std::size_t i = 0; i < taken.leaves.size(); ++i)
    if (taken.leaves[i] != kNoLeaf) order[next[taken.leaves[i]]++] = static_cast<std::uint32_t>(i);
  return order;
}

}  // namespace

void ingest(const std::shared_ptr<Source>& source, const InputChunk& chunk, const Plan& plan, const LeafTree& tree,
            unsigned threads, const std::filesystem::path& path, const std::stop_token& stop) {
  source->place_at(plan.origin);
  const Taken taken = io::with_threads(threads, [&] { return take(source, chunk, plan, tree, stop); });
  const std::vector<Section> sections = sections_of(taken, tree.leaves());
  const std::vector<std::uint32_t> order = order_by_leaf(taken, sections, tree.leaves());
  PointsHeader header;
  header.first_index = chunk.first_point;
  header.counts[kNonFinite] = chunk.points - order.size();
  header.counts[kIgnored] = taken.ignored;
  PointsWriter writer(path, header, sections, taken.shown);
  std::vector<Point> some;
  constexpr std::size_t kSome = 1 << 16;
  for (std::size_t begin = 0; begin < order.size(); begin += kSome) {
    some.clear();
    for (std::size_t i = begin; i < std::min(order.size(), begin + kSome); ++i) some.push_back(taken.points[order[i]]);
    writer.write(std::span(some));
  }
  writer.write(std::span(order));
  writer.finish();
}

Position origin_of(const std::vector<std::filesystem::path>& ingested, std::uint64_t points_of_cloud) {
  io::OriginSample all(points_of_cloud);
  for (const std::filesystem::path& path : ingested) {
    const std::vector<double> shown = PointsFile(path).numbers();
    std::vector<Position> state(shown.size() / 3);
    for (std::size_t i = 0; i < shown.size(); ++i) state[i / 3][i % 3] = shown[i];
    all.offer_state(state);
  }
  return io::choose_origin(std::move(all).take());
}

}  // namespace pointfair::scale
