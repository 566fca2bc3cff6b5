// SPDX-License-Identifier: Apache-2.0
#include "scale/ingest.hpp"

#include <atomic>
#include <map>
#include <utility>

#include "io/parallel.hpp"
#include "scale/given.hpp"
#include "scale/points_file.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/stop.hpp"

namespace pointfair::scale {
namespace {

// Points that are stored together: those of one leaf of the tree in one zone.
using Group = std::pair<std::uint32_t, Zone>;
using Numbers = std::map<Group, std::uint32_t>;

struct Taken {
  std::vector<Point> points;
  std::vector<Group> groups;
  std::vector<std::uint32_t> group_of;  // of each point; Grouped::kNone: not valid
  std::vector<double> shown;            // of the origin: io::OriginSample::state()
  std::uint64_t ignored = 0;
};

// Points of a block by group, and relative to the middles of their zones. Groups are numbered as they are met.
Numbers group_block(const Source& source, std::size_t block, const Zones& zones, const LeafTree& tree,
                    std::span<Point> points, std::span<std::uint32_t> group_of) {
  Numbers numbers;
  std::vector<Position> values(points.size());
  source.positions(block, values);
  for (std::size_t i = 0; i < points.size(); ++i) {
    group_of[i] = is_indexed(points[i]) ? 0 : Grouped::kNone;
    if (group_of[i] == 0) points[i] = offset(values[i], zones.middle_of(zones.zone_of(values[i])));
  }
  // Leaves go by what is stored, so that points at one place are in one leaf. In a loop of its own: where GCC 12 has
  // the double at hand that became the float, it leaves out that this rounded it.
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (group_of[i] == Grouped::kNone) continue;
    const Zone zone = zones.zone_of(values[i]);
    const Group group{tree.leaf_of(shifted(points[i], difference(zones.middle_of(zone), zones.origin))), zone};
    group_of[i] = numbers.try_emplace(group, std::uint32_t(numbers.size())).first->second;
  }
  return numbers;
}

// All groups in their order, and points by their numbers in it.
void number_groups(const std::vector<Numbers>& of_blocks, const Source& source, const InputChunk& chunk, Taken& taken) {
  Numbers all;
  for (const Numbers& numbers : of_blocks)
    for (const auto& [group, number] : numbers) all.emplace(group, 0);
  for (auto& [group, number] : all) {
    number = std::uint32_t(taken.groups.size());
    taken.groups.push_back(group);
  }
  std::size_t at = 0;
  for (std::size_t b = 0; b < of_blocks.size(); ++b) {
    std::vector<std::uint32_t> renumbered(of_blocks[b].size());
    for (const auto& [group, number] : of_blocks[b]) renumbered[number] = all[group];
    for (const std::size_t end = at + source.block_size(chunk.first_block + b); at < end; ++at)
      if (taken.group_of[at] != Grouped::kNone) taken.group_of[at] = renumbered[taken.group_of[at]];
  }
}

Taken take(const std::shared_ptr<Source>& source, const InputChunk& chunk, const Plan& plan, const LeafTree& tree,
           const std::stop_token& stop) {
  Taken taken;
  taken.points.resize(chunk.points);
  taken.group_of.resize(chunk.points);
  const std::size_t blocks = chunk.end_block - chunk.first_block;
  std::vector<io::OriginSample> offered(blocks, io::OriginSample(plan.points));
  std::vector<Numbers> numbers(plan.zones.are_several() ? blocks : 0);
  const std::uint64_t first = source->block_begin(chunk.first_block);
  std::atomic<std::uint64_t> ignored = 0;
  io::for_each_block(blocks, [&](std::size_t i) {
    throw_if_stopped(stop);
    const std::size_t block = chunk.first_block + i;
    const std::size_t at = source->block_begin(block) - first, count = source->block_size(block);
    const auto points = std::span(taken.points).subspan(at, count);
    ignored += place_seen(source, block, plan.limits, points, offered[i]);
    if (!numbers.empty()) {
      numbers[i] = group_block(*source, block, plan.zones, tree, points, std::span(taken.group_of).subspan(at, count));
      return;
    }
    for (std::size_t p = at; p < at + count; ++p)
      taken.group_of[p] = is_indexed(taken.points[p]) ? tree.leaf_of(taken.points[p]) : Grouped::kNone;
  });
  taken.ignored = ignored;
  if (numbers.empty()) {
    for (std::uint32_t leaf = 0; leaf < tree.leaves(); ++leaf) taken.groups.push_back({leaf, {}});
  } else {
    number_groups(numbers, *source, chunk, taken);
  }
  io::OriginSample all(plan.points);
  for (const io::OriginSample& some : offered) all.offer_all(some);
  for (const Position& position : all.state()) taken.shown.insert(taken.shown.end(), position.begin(), position.end());
  return taken;
}

std::vector<Section> sections_of(const Taken& taken) {
  std::vector<Bounds> bounds(taken.groups.size(), kNoBounds);
  for (std::size_t i = 0; i < taken.points.size(); ++i)
    if (taken.group_of[i] != Grouped::kNone) include(bounds[taken.group_of[i]], taken.points[i]);
  std::vector<Section> sections;
  for (std::size_t g = 0; g < bounds.size(); ++g) {
    const auto& [leaf, zone] = taken.groups[g];
    if (bounds[g].valid > 0) sections.push_back({leaf, zone, bounds[g].valid, bounds[g].min, bounds[g].max});
  }
  return sections;
}

}  // namespace

void ingest(const std::shared_ptr<Source>& source, const InputChunk& chunk, const Plan& plan, const LeafTree& tree,
            unsigned threads, const std::filesystem::path& path, const std::stop_token& stop) {
  source->place_at(plan.zones.origin);
  const Taken taken = io::with_threads(threads, [&] { return take(source, chunk, plan, tree, stop); });
  const std::vector<Section> sections = sections_of(taken);
  const std::vector<std::uint32_t> order = Grouped(taken.group_of, taken.groups.size()).order;
  PointsWriter writer(path, {.first_index = chunk.first_point, .counts = {.ignored = taken.ignored}}, sections,
                      taken.shown);
  writer.write<Point>(order, [&](std::uint32_t i) { return taken.points[i]; });
  writer.write(std::span(order));
  writer.finish();
}

Zones zones_of(const std::vector<std::filesystem::path>& ingested, const Plan& plan) {
  io::OriginSample all(plan.points);
  for (const std::filesystem::path& path : ingested) {
    const std::vector<double> shown = PointsFile(path).numbers();
    std::vector<Position> state(shown.size() / 3);
    for (std::size_t i = 0; i < shown.size(); ++i) state[i / 3][i % 3] = shown[i];
    all.offer_state(state);
  }
  std::vector<Position> sample = std::move(all).take();
  const Position origin = io::choose_origin(sample);
  return {origin, zone_side(std::move(sample), plan.points, origin, plan.coordinate_step)};
}

}  // namespace pointfair::scale
