// SPDX-License-Identifier: Apache-2.0
#include "scale/tasks.hpp"

#include <utility>

#include "estimate/automatic.hpp"
#include "io/file_bytes.hpp"
#include "io/streamed.hpp"
#include "io/unfinished_files.hpp"
#include "options/outlier_values.hpp"
#include "pipeline/devices.hpp"
#include "platform/path_text.hpp"
#include "pointfair/empty_files.hpp"
#include "scale/given.hpp"
#include "scale/ingest.hpp"
#include "scale/outlier_edits.hpp"
#include "seam/stop.hpp"
#include "tiles/choice.hpp"
#include "tiles/feeders.hpp"
#include "tiles/tile_run.hpp"

namespace pointfair::scale {
namespace fs = std::filesystem;
namespace {

// What TiledRun::report reads of a file that was written: the counts, the step between coordinates, then what a
// MoveTally holds.
void write_tally(const fs::path& path, const TaskCounts& counts, double coordinate_step, const MoveTally& moves) {
  std::vector<double> numbers{coordinate_step};
  const std::vector<double> its = moves.numbers();
  numbers.insert(numbers.end(), its.begin(), its.end());
  PointsWriter(path, {.counts = counts}, {}, numbers).finish();
}

}  // namespace

Tasks::Tasks(const fs::path& work, const std::vector<Device>& devices)
    : folder_(work), tree_(work / "leaves"), inputs_(folder_.plan.files, devices[0].threads) {
  for (const Device& device : devices) workers_.push_back({device, nullptr});
  remove_abandoned_files(work);
  take_zones();
}

Tasks::Tasks(const MemoryFolder& work, Plan plan, LeafTree tree, std::shared_ptr<Source> source,
             std::optional<GivenNoise> noise, Backend& backend)
    : folder_(work.path(), std::move(plan)),
      tree_(std::move(tree)),
      inputs_(folder_.plan.files, 0),
      noise_(std::move(noise)) {
  workers_.push_back({{}, nullptr, &backend});
  inputs_.give(0, std::move(source));
}

Backend& Tasks::Worker::backend() {
  if (given) return *given;
  DeviceInfo info;
  if (!made) made = make_backend(device, info);
  return *made;
}

void Tasks::run(const WorkStep& step, std::size_t task, const std::stop_token& stop) {
  throw_if_stopped(stop);
  if (folder_.is_done(step, task)) return;
  try {
    get_ready(step);
    do_task(step, task, stop);
  } catch (const Error& error) {
    // another process may have done it meanwhile, and have removed what it is made of
    if (error.kind() != ErrorKind::file || !folder_.is_done(step, task)) throw;
  }
}

void Tasks::run_all(const WorkStep& step, const std::stop_token& stop, const std::function<void(std::size_t)>& begin) {
  if (step.kind == WorkStep::Kind::denoise) return run_tiles(step, stop, begin);
  for (std::size_t task = 0; task < folder_.tasks_of(step); ++task) {
    begin(task);
    run(step, task, stop);
  }
}

// Tiles are a queue for the workers.
void Tasks::run_tiles(const WorkStep& step, const std::stop_token& stop,
                      const std::function<void(std::size_t)>& begin) {
  const std::size_t tasks = folder_.tasks_of(step);
  TaskQueue<std::size_t> queue;
  for (std::size_t task = 0; task < tasks; ++task) queue.put(task);
  const auto next = [&](bool tells) -> std::optional<TileWork> {
    while (const auto task = queue.take(false)) {
      if (tells) begin(*task);
      throw_if_stopped(stop);
      if (!folder_.is_done(step, *task)) return tile_work(step, *task);
    }
    return std::nullopt;
  };
  try {
    if (folder_.count_done(step) < tasks) get_ready(step);
    on_feeders(workers_.size(), [&](std::size_t worker) {
      try {
        denoise_all([&] { return next(worker == 0); }, workers_[worker].backend(), stop);
      } catch (...) {
        queue.close();
        throw;
      }
    });
  } catch (const Error& error) {
    // another process may have done them meanwhile, and have removed what they are made of
    if (error.kind() != ErrorKind::file || folder_.count_done(step) < tasks) throw;
  }
}

// What the tasks of a step share, and only read.
void Tasks::get_ready(const WorkStep& step) {
  take_zones();
  if (step.kind != WorkStep::Kind::denoise) return;
  settings();
  if (input_ && input_iteration_ == step.iteration) return;
  const WorkStep before =
      step.iteration == 0 ? WorkStep{WorkStep::Kind::ingest} : WorkStep{WorkStep::Kind::denoise, step.iteration - 1};
  input_.reset();
  input_.emplace(folder_.files_of(before), tree_.leaves(), folder_.plan.zones);
  input_iteration_ = step.iteration;
}

void Tasks::do_task(const WorkStep& step, std::size_t task, const std::stop_token& stop) {
  switch (step.kind) {
    case WorkStep::Kind::ingest:
      return run_ingest(step, task, stop);
    case WorkStep::Kind::measure:
      return run_measure(step, stop);
    case WorkStep::Kind::denoise:
      return run_denoise(step, task, stop);
    case WorkStep::Kind::heights:
      return run_heights(step, stop);
    case WorkStep::Kind::emit:
      return run_emit(step, task, stop);
  }
}

void Tasks::run_ingest(const WorkStep& step, std::size_t task, const std::stop_token& stop) {
  const InputChunk& chunk = folder_.plan.chunks[task];
  ingest(inputs_.open(chunk.file), chunk, folder_.plan, tree_, threads(), folder_.file_of(step, task), stop);
}

// Where the points show another origin than the one that was guessed, or other zones, they are taken in again.
void Tasks::run_measure(const WorkStep& step, const std::stop_token& stop) {
  const WorkStep before{WorkStep::Kind::ingest};
  const auto take_in_again = [&] {
    for (const fs::path& path : folder_.files_before_recut()) remove_stored(path);
    for (std::size_t task = 0; task < folder_.plan.chunks.size(); ++task) run(before, task, stop);
  };
  if (folder_.is_recut) take_in_again();  // what a process that was killed meanwhile has left to do
  const Zones zones = folder_.plan.is_placed ? folder_.plan.zones : zones_of(folder_.files_of(before), folder_.plan);
  if (zones != folder_.plan.zones) {
    if (folder_.is_recut) throw Error(ErrorKind::failed, "the input shows another origin each time; plan again");
    NewFile file(folder_.path / "origin", sizeof zones);
    file.write(&zones, sizeof zones);
    file.finish();
    take_zones();
    take_in_again();
  }
  const StoredCloud cloud(folder_.files_of(before), tree_.leaves(), zones);
  std::optional<GivenNoise> given = noise_;
  if (!folder_.plan.noise_attribute.empty()) given = noise_of_attribute(inputs_, folder_.plan, threads(), stop);
  save(measure(cloud, folder_.plan, given, workers_[0].backend(), stop), folder_.file_of(step, 0));
}

void Tasks::run_denoise(const WorkStep& step, std::size_t task, const std::stop_token& stop) {
  std::optional<TileWork> tile(tile_work(step, task));
  denoise_all([&] { return std::exchange(tile, std::nullopt); }, workers_[0].backend(), stop);
}

TileWork Tasks::tile_work(const WorkStep& step, std::size_t task) const {
  FramedSettings settings{resolved_->settings, {}};
  if (sums_within_radius(folder_.plan.params)) settings.frame = measured_->frame;
  settings.fairing.is_further = step.iteration > 0;
  if (step.iteration == 0) settings.copies = measured_->copies;  // later ones are stored
  const bool is_last = step.iteration + 1 == folder_.plan.iterations;
  std::optional<Counts> first_counts;
  if (step.iteration > 0)
    first_counts = PointsFile(folder_.file_of({step.kind, step.iteration - 1}, task)).header().counts.points;
  return {
      *input_,     {tree_.tile_begin(task), tree_.tile_begin(task + 1)},     folder_.file_of(step, task),
      settings,    points_of_tile(folder_.plan.memory, folder_.plan.params), is_last ? &folder_.plan.chunks : nullptr,
      first_counts};
}

void Tasks::run_heights(const WorkStep& step, const std::stop_token& stop) {
  HeightGrid heights(folder_.plan.points);
  for (std::size_t file = 0; file < folder_.plan.files.size(); ++file) {
    if (folder_.plan.files[file].points == 0) continue;
    const auto source = inputs_.open(file);
    source->place_at(folder_.plan.zones.origin);
    add_heights(results(file, source, stop), threads(), heights);
  }
  heights.finish();
  save(heights, folder_.file_of(step, 0));
}

void Tasks::run_emit(const WorkStep& step, std::size_t task, const std::stop_token& stop) {
  const InputFile& file = folder_.plan.files[task];
  const fs::path begun = folder_.begun_mark(task);
  if (!folder_.plan.write.overwrite && fs::exists(file.output) && !fs::exists(begun))
    io::fail(platform::text_of(file.output), "exists already, which it did not when this was planned; move it away");
  mark(begun);
  WriteOptions options = folder_.plan.write;
  options.overwrite = true;
  options.sync = true;
  options.threads = threads();
  fs::create_directories(file.output.parent_path());
  io::remove_abandoned(file.output.parent_path(), io::kUnfinishedOutput);
  if (file.points == 0) {
    inputs_.check_unchanged(task);
    copy_without_points(file.path, file.output, options);
    return write_tally(folder_.file_of(step, task), {}, 0, {});
  }
  const auto source = inputs_.open(task);
  source->place_at(folder_.plan.zones.origin);
  const TileResults results = this->results(task, source, stop);
  const HeightGrid heights = needs_heights(folder_.plan.outlier_action)
                                 ? load_heights(folder_.file_of({WorkStep::Kind::heights}, 0))
                                 : HeightGrid(0);
  OutlierEdits outliers = outlier_edits(results, folder_.plan, source, heights, threads());
  io::write_moved(file.output, source, results, options, std::move(outliers.added), outliers.removed);
  TaskCounts counts{.held = results.held_by_limits(), .outcome = outliers.outcome};
  counts.points.unmoved.outliers_by_reason = results.held_back();
  const double coordinate_step = options.las_scale.value_or(source->info().step);
  write_tally(folder_.file_of(step, task), counts, coordinate_step, results.moves());
}

TileResults Tasks::results(std::size_t file, std::shared_ptr<const Source> source, const std::stop_token& stop) {
  return {folder_.files_of({WorkStep::Kind::denoise, folder_.plan.iterations - 1}),
          folder_.plan,
          file,
          std::move(source),
          settings().limits,
          stop};
}

Counts Tasks::counts() const {
  Counts all;
  for (const fs::path& path : folder_.files_of({WorkStep::Kind::denoise, folder_.plan.iterations - 1}))
    add(all, PointsFile(path).header().counts.points);
  if (resolved_ && !moves_along_normal(resolved_->params.method)) all.unmoved.no_normal = 0;
  all.unmoved.non_finite = folder_.plan.points - measured_->bounds.valid - measured_->ignored;
  return all;
}

void Tasks::run_steps(WorkStep::Kind last, const std::stop_token& stop, const ProgressFunction& progress) {
  const std::vector<WorkStep> steps = folder_.steps();
  for (std::size_t s = 0; s < steps.size() && steps[s].kind <= last; ++s) {
    const std::size_t tasks = folder_.tasks_of(steps[s]);
    folder_.check_room(steps[s]);
    run_all(steps[s], stop, [&](std::size_t task) {
      if (progress) progress((double(s) + double(task) / double(tasks)) / double(steps.size()), steps[s].name());
    });
    if (steps[s].kind != WorkStep::Kind::denoise) continue;
    // what this step read is not needed any more
    const WorkStep before = steps[s].iteration == 0 ? steps[0] : steps[s - 1];
    if (!is_stored(folder_.end_mark(before)))
      mark(folder_.end_mark(before));  // after it, all names of this step are on the disk
    input_.reset();
    for (const fs::path& path : folder_.files_of(before)) remove_stored(path);
  }
}

// Those that were found in place of the plan's, maybe by another process.
void Tasks::take_zones() {
  if (folder_.is_recut || !is_stored(folder_.path / "origin")) return;
  Zones zones;
  StoredFile(folder_.path / "origin").read(0, &zones, sizeof zones);
  tree_.move(difference(zones.origin, folder_.plan.zones.origin));
  folder_.plan.zones = zones;
  folder_.is_recut = true;
}

const Settings& Tasks::settings() {
  if (!resolved_) {
    measured_ = load_measured(folder_.path / "measured");
    resolved_ = resolve(folder_.plan, *measured_);
  }
  return resolved_->settings;
}

}  // namespace pointfair::scale
