// SPDX-License-Identifier: Apache-2.0
#include "scale/wide_cloud.hpp"

#include <algorithm>
#include <utility>

#include "io/edits.hpp"
#include "io/offset.hpp"
#include "io/parallel.hpp"
#include "io/placed_source.hpp"
#include "platform/free_memory.hpp"
#include "tiles/choice.hpp"

namespace pointfair::scale {
namespace {

constexpr std::size_t kKeptSample = 1 << 18;
constexpr std::size_t kBlock = 1 << 14;

std::vector<Position> positions_of(const Cloud& cloud) {
  std::vector<Position> result(cloud.points.size());
  positions(cloud, result);
  return result;
}

}  // namespace

WideCloud::WideCloud(const Cloud& cloud, const Zones& zones, std::unique_ptr<Backend> backend)
    : zones_(zones),
      coordinate_step_(coordinate_step(*cloud.source)),
      source_(std::make_shared<io::PlacedSource>(nullptr, positions_of(cloud))),
      backend_(std::move(backend)) {
  const std::size_t step = cloud.points.size() / kKeptSample + 1;
  for (std::size_t i = 0; i < cloud.points.size(); i += step)
    if (is_indexed(cloud.points[i])) sample_.push_back(cloud.points[i]);
}

bool WideCloud::can_run(const Params& params, bool has_one_sensor) {
  return why_not_in_parts(params).empty() && (params.along != Along::ray || has_one_sensor);
}

std::unique_ptr<Tasks> WideCloud::tasks_of(const WideJob& job, const MemoryFolder& work) {
  Plan plan;
  plan.params = job.params;
  plan.sensor = job.sensor;
  plan.seeks_sensor = job.seeks_sensor;
  plan.memory = HostMemory{.free = platform::free_memory()}.usable();
  plan.points = source_->size();
  plan.iterations = iterations_of(job.params);
  plan.zones = zones_;
  plan.coordinate_step = coordinate_step_;
  plan.is_placed = true;
  plan.files.push_back({{}, {}, {}, plan.points, 0});
  add_chunks(*source_, plan);
  std::vector<Point> sample = sample_;  // which the tree sorts
  LeafTree tree = cut_into_tiles(plan, sample, 1);
  return std::make_unique<Tasks>(work, std::move(plan), std::move(tree), source_, job.noise, *backend_);
}

WideMeasured WideCloud::measure(const WideJob& job, const std::stop_token& stop) {
  const MemoryFolder work;
  const std::unique_ptr<Tasks> tasks = tasks_of(job, work);
  tasks->run_steps(WorkStep::Kind::measure, stop, {});
  tasks->settings();
  return {tasks->measured(), tasks->params()};
}

WideResult WideCloud::run(const WideJob& job, const std::stop_token& stop, const ProgressFunction& progress) {
  const MemoryFolder work;
  const std::unique_ptr<Tasks> tasks = tasks_of(job, work);
  tasks->run_steps(WorkStep::Kind::denoise, stop, progress);
  const TileResults moved = tasks->results(0, source_, stop);
  WideResult result;
  Report& report = result.report;
  report.points = source_->size();
  report.params = tasks->params();
  if (report.params.outliers == Outliers::mark) {
    result.outliers.resize(static_cast<std::size_t>(source_->size()));
    moved.visit_outliers(0, [&](const SomeOutliers& some) {
      std::ranges::copy(some.marks, result.outliers.begin() + std::ptrdiff_t(some.first));
    });
  }
  Cloud shell{.origin = zones_.origin};
  io::Edits edits{shell, {}, {}, {}};
  edits.moved = &moved;
  result.positions.resize(source_->size());
  io::for_each_block(source_->block_count(), [&](std::size_t block) {
    const Moves moves = source_->moves(block, edits);
    std::ranges::copy(moves.values, result.positions.begin() + std::ptrdiff_t(source_->block_begin(block)));
  });
  const Counts counts = tasks->counts();
  report.unmoved = counts.unmoved;
  report.unmoved.outliers_by_reason = moved.held_back();
  report.unmoved.outliers = report.unmoved.outliers_by_reason.total();
  report.short_neighborhoods = counts.short_neighborhoods;
  report.copies = counts.copies;
  report.pulled = counts.pulled;
  report.without_surface = tasks->without_surface();
  report.tiles = tasks->folder().plan.tiles;
  if (!job.sensor) report.found_sensor = one_sensor(tasks->settings(), tasks->measured().origin);
  return result;
}

void apply_limits_in_zones(const Zones& zones, const Limits& limits, std::span<const std::uint8_t> movable,
                           std::span<const Position> before, std::span<Position> after) {
  io::for_each_block((after.size() + kBlock - 1) / kBlock, [&](std::size_t block) {
    const std::size_t begin = block * kBlock, count = std::min(kBlock, after.size() - begin);
    std::vector<Position> middles;
    std::vector<Point> from, to;
    for (std::size_t i = begin; i < begin + count; ++i) {
      const Position &p = before[i], &q = after[i];
      const Position& middle = middles.emplace_back(zones.middle_of(zones.zone_of(p)));
      const Point& f = from.emplace_back(offset(p, middle));
      to.push_back(moved_offset(f, p, q));
    }
    apply_limits(limits, movable.empty() ? movable : movable.subspan(begin, count), from, to);
    for (std::size_t i = 0; i < count; ++i) {
      const float was[3] = {from[i].x, from[i].y, from[i].z}, is[3] = {to[i].x, to[i].y, to[i].z};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double own = before[begin + i][axis];
        after[begin + i][axis] =
            io::same_bits(was[axis], is[axis]) ? own : io::moved_value(own, was[axis], is[axis], middles[i][axis], 0);
      }
    }
  });
}

}  // namespace pointfair::scale
