// SPDX-License-Identifier: Apache-2.0
// The tasks of a run, and when each is done: a task is done when its file is there.
#include "pointfair/tiled_run.hpp"

#include <fcntl.h>

#include <algorithm>
#include <new>
#include <utility>

#include "estimate/automatic.hpp"
#include "io/file_bytes.hpp"
#include "io/streamed.hpp"
#include "pipeline/devices.hpp"
#include "pipeline/stage_settings.hpp"
#include "scale/denoise.hpp"
#include "scale/emit.hpp"
#include "scale/ingest.hpp"
#include "scale/measure.hpp"
#include "scale/plan.hpp"

namespace pointfair {
namespace fs = std::filesystem;
using namespace scale;
namespace {

std::string numbered(const char* name, std::size_t number) {
  std::string digits = std::to_string(number);
  if (digits.size() < 5) digits.insert(0, 5 - digits.size(), '0');
  return name + ("-" + digits);
}

template <class Work>
auto with_one_kind_of_error(const Work& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::memory, "out of host memory: plan with less --memory, or close other programs");
  } catch (const fs::filesystem_error& error) {
    throw Error(ErrorKind::file, error.what());
  }
}

}  // namespace

// The names in the folder: chunk-..., of each chunk of the input; measured; tile-<iteration>-..., of each tile; and of
// each output begun-... and written-..., which are marks. What is called done-... says that a step was finished whose
// files are not needed any more.
struct TiledRun::State {
  State(const fs::path& folder, Device its_device)
      : work(folder),
        wanted(its_device),
        plan(read_plan(folder)),
        tree(work / "leaves"),
        inputs(plan.files, its_device.threads) {
    if (fs::exists(work / "origin")) use_origin(load_origin());
  }

  enum class Kind { ingest, measure, denoise, emit };
  struct StepKind {
    Kind kind;
    int iteration = 0;
    std::string name() const {
      switch (kind) {
        case Kind::ingest:
          return "ingest";
        case Kind::measure:
          return "measure";
        case Kind::denoise:
          return "denoise-" + std::to_string(iteration + 1);
        case Kind::emit:
          break;
      }
      return "emit";
    }
  };

  std::vector<StepKind> all_steps() const {
    std::vector<StepKind> steps{{Kind::ingest}, {Kind::measure}};
    for (int i = 0; i < plan.iterations; ++i) steps.push_back({Kind::denoise, i});
    steps.push_back({Kind::emit});
    return steps;
  }
  std::size_t tasks_of(const StepKind& step) const {
    switch (step.kind) {
      case Kind::ingest:
        return plan.chunks.size();
      case Kind::measure:
        return 1;
      case Kind::denoise:
        return plan.tiles;
      case Kind::emit:
        break;
    }
    return plan.files.size();
  }
  fs::path file_of(const StepKind& step, std::size_t task) const {
    switch (step.kind) {
      case Kind::ingest:
        return work / numbered(corrected ? "recut" : "chunk", task);
      case Kind::measure:
        return work / "measured";
      case Kind::denoise:
        return work / numbered(("tile-" + std::to_string(step.iteration + 1)).c_str(), task);
      case Kind::emit:
        break;
    }
    return work / numbered("written", task);
  }
  std::vector<fs::path> files_of(const StepKind& step) const {
    std::vector<fs::path> files;
    for (std::size_t task = 0; task < tasks_of(step); ++task) files.push_back(file_of(step, task));
    return files;
  }
  fs::path end_mark(const StepKind& step) const { return work / ("done-" + step.name()); }

  bool is_done(const StepKind& step, std::size_t task) const {
    return fs::exists(file_of(step, task)) || fs::exists(end_mark(step));
  }
  std::size_t count_done(const StepKind& step) const {
    if (fs::exists(end_mark(step))) return tasks_of(step);
    std::size_t done = 0;
    for (std::size_t task = 0; task < tasks_of(step); ++task) done += fs::exists(file_of(step, task));
    return done;
  }

  // Before hours are spent on what will not fit.
  void check_room(const StepKind& step) const {
    if (step.kind != Kind::ingest && step.kind != Kind::denoise) return;
    const double left = 1 - double(count_done(step)) / double(tasks_of(step));
    const std::uint64_t bytes_of_point = step.kind == Kind::ingest || step.iteration + 1 == plan.iterations ? 16 : 20;
    const auto needed = static_cast<std::uint64_t>(left * double(plan.points * bytes_of_point));
    const std::uint64_t free = fs::space(work).available;
    if (free < needed)
      io::fail(work.string(), "step " + step.name() + " needs " + std::to_string(needed) + " bytes, which is " +
                                  std::to_string(needed - free) +
                                  " bytes more than are free: free some space and run again, what is finished is kept");
  }

  void run(const StepKind& step, std::size_t task, const std::stop_token& stop) {
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    if (!corrected && fs::exists(work / "origin")) use_origin(load_origin());
    if (is_done(step, task)) return;
    try {
      do_task(step, task, stop);
    } catch (const Error& error) {
      // another process may have done it meanwhile, and have removed what it is made of
      if (error.kind() != ErrorKind::file || !is_done(step, task)) throw;
    }
  }

  void do_task(const StepKind& step, std::size_t task, const std::stop_token& stop) {
    switch (step.kind) {
      case Kind::ingest:
        return run_ingest(step, task, stop);
      case Kind::measure:
        return run_measure(step, stop);
      case Kind::denoise:
        return run_denoise(step, task, stop);
      case Kind::emit:
        return run_emit(step, task, stop);
    }
  }

  void run_ingest(const StepKind& step, std::size_t task, const std::stop_token& stop) {
    const InputChunk& chunk = plan.chunks[task];
    ingest(*inputs.open(chunk.file), chunk, plan.origin, tree, plan.points, wanted.threads, file_of(step, task), stop);
  }

  // Where the points show another origin than the one that was guessed, they are taken in again.
  void run_measure(const StepKind& step, const std::stop_token& stop) {
    const StepKind before{Kind::ingest};
    const Position origin = origin_of(files_of(before), plan.points);
    if (origin != plan.origin) {
      if (corrected) throw Error(ErrorKind::failed, "the input shows another origin each time; plan again");
      NewFile file(work / "origin", sizeof origin);
      file.write(origin.data(), sizeof origin);
      file.finish();
      for (const fs::path& path : files_of(before)) fs::remove(path);
      use_origin(origin);
      for (std::size_t task = 0; task < plan.chunks.size(); ++task) run(before, task, stop);
    }
    const StoredCloud cloud(files_of(before), tree.leaves());
    save(measure(cloud, plan.origin, plan, backend(), stop), file_of(step, 0));
  }

  void run_denoise(const StepKind& step, std::size_t task, const std::stop_token& stop) {
    const Settings& settings = settled_settings();
    if (!input || input_iteration != step.iteration) {
      const StepKind before =
          step.iteration == 0 ? StepKind{Kind::ingest} : StepKind{Kind::denoise, step.iteration - 1};
      input.reset();
      input.emplace(files_of(before), tree.leaves());
      input_iteration = step.iteration;
    }
    std::optional<Frame> frame;
    if (sums_within_radius(plan.params)) frame = measured->frame;
    FairingSettings fairing = settings.fairing;
    fairing.is_further = step.iteration > 0;
    const bool is_last = step.iteration + 1 == plan.iterations;
    const TileWork its{*input,
                       {tree.tile_begin(task), tree.tile_begin(task + 1)},
                       {frame, settings.neighbors, settings.normals, fairing},
                       points_in_memory(plan.memory, bytes_of_tile_point(plan.params)),
                       is_last ? &plan.chunks : nullptr};
    denoise(its, backend(), file_of(step, task), stop);
  }

  void run_emit(const StepKind& step, std::size_t task, const std::stop_token& stop) {
    const InputFile& file = plan.files[task];
    const fs::path begun = work / numbered("begun", task);
    if (!plan.write.overwrite && fs::exists(file.output) && !fs::exists(begun))
      io::fail(file.output.string(), "exists already; add --force to the plan to replace it");
    mark(begun);
    const auto source = inputs.open(task);
    source->place_at(plan.origin);
    const Settings& settings = settled_settings();
    const Settling settling{settings.limits, settings.limits.farthest > 0 || plan.iterations > 1};
    const TileResults results(files_of({Kind::denoise, plan.iterations - 1}), plan, task, settling, stop);
    WriteOptions options = plan.write;
    options.overwrite = true;
    options.sync = true;
    options.threads = wanted.threads;
    fs::create_directories(file.output.parent_path());
    io::write_moved(file.output, source, results, options);
    PointsHeader header;
    const OutlierCounts held_back = results.held_back();
    header.counts = {held_back.isolated, held_back.off_surface, held_back.mixed_pixels};
    PointsWriter(file_of(step, task), header, {}, {}).finish();
  }

  void use_origin(const Position& origin) {
    std::array<double, 3> shift{};
    for (std::size_t axis = 0; axis < 3; ++axis) shift[axis] = origin[axis] - plan.origin[axis];
    tree.move(shift);
    plan.origin = origin;
    corrected = true;
  }
  Position load_origin() const {
    Position origin{};
    StoredFile(work / "origin").read(0, origin.data(), sizeof origin);
    return origin;
  }

  Backend& backend() {
    if (!device_backend) {
      DeviceInfo info;
      device_backend = make_backend(wanted, info);
    }
    return *device_backend;
  }

  const Settings& settled_settings() {
    if (!resolved) {
      measured = load_measured(work / "measured");
      resolved = resolve(plan.params, *measured);
    }
    return resolved->settings;
  }

  fs::path work;
  Device wanted;
  Plan plan;
  LeafTree tree;
  Inputs inputs;
  bool corrected = false;  // the origin is not the plan's own
  std::unique_ptr<Backend> device_backend;
  std::optional<Measured> measured;
  std::optional<Resolved> resolved;
  std::optional<StoredCloud> input;
  int input_iteration = -1;
};

std::uint64_t TiledRun::bytes_in_memory(std::uint64_t points, const Params& params) {
  return points * (bytes_of_tile_point(params) + 2 * sizeof(Point));
}

std::uint64_t TiledRun::count_points(const fs::path& path) { return io::open_source(path, 0)->size(); }

void TiledRun::plan(const TiledJob& job, const fs::path& work, unsigned threads) {
  with_one_kind_of_error([&] {
    if (!has_plan(work)) return make_plan(job, work, threads);
    const std::string other = difference(job, read_plan(work));
    if (!other.empty())
      throw Error(ErrorKind::usage, work.string() + ": was planned with " + other +
                                        "; go on with what it was planned with, or name another work folder");
  });
}

TiledRun::TiledRun(const fs::path& work, Device device)
    : state_(with_one_kind_of_error([&] { return std::make_unique<State>(work, device); })) {}
TiledRun::~TiledRun() = default;
TiledRun::TiledRun(TiledRun&&) noexcept = default;
TiledRun& TiledRun::operator=(TiledRun&&) noexcept = default;

std::vector<TiledRun::Step> TiledRun::steps() const {
  std::vector<Step> steps;
  for (const State::StepKind& step : state_->all_steps())
    steps.push_back({step.name(), state_->tasks_of(step), state_->count_done(step)});
  return steps;
}

void TiledRun::run(const std::string& name, std::size_t task, std::stop_token stop) {
  with_one_kind_of_error([&] {
    const std::vector<State::StepKind> steps = state_->all_steps();
    for (std::size_t s = 0; s < steps.size(); ++s) {
      if (steps[s].name() != name) continue;
      if (task >= state_->tasks_of(steps[s]))
        throw Error(ErrorKind::usage, "step " + name + " has " + std::to_string(state_->tasks_of(steps[s])) +
                                          " tasks, counted from 0; there is no task " + std::to_string(task));
      if (s > 0 && !state_->is_done(steps[s], task) &&
          state_->count_done(steps[s - 1]) < state_->tasks_of(steps[s - 1]))
        throw Error(ErrorKind::usage, "step " + steps[s - 1].name() + " is not finished; run its tasks before " + name);
      return state_->run(steps[s], task, stop);
    }
    throw Error(ErrorKind::usage, "there is no step " + name + "; pointfair tile status lists them");
  });
}

void TiledRun::run_all(std::stop_token stop, const ProgressFunction& progress) {
  with_one_kind_of_error([&] {
    remove_abandoned_files(state_->work);
    const std::vector<State::StepKind> steps = state_->all_steps();
    for (std::size_t s = 0; s < steps.size(); ++s) {
      const std::size_t tasks = state_->tasks_of(steps[s]);
      state_->check_room(steps[s]);
      for (std::size_t task = 0; task < tasks; ++task) {
        if (progress) progress((double(s) + double(task) / double(tasks)) / double(steps.size()), steps[s].name());
        state_->run(steps[s], task, stop);
      }
      if (steps[s].kind != State::Kind::denoise) continue;
      // what this step read is not needed any more
      const State::StepKind before = steps[s].iteration == 0 ? steps[0] : steps[s - 1];
      mark(state_->end_mark(before));
      state_->input.reset();
      state_->input_iteration = -1;
      for (const fs::path& path : state_->files_of(before)) fs::remove(path);
    }
  });
}

TiledReport TiledRun::report() const {
  return with_one_kind_of_error([&] {
    TiledReport report;
    const std::vector<State::StepKind> steps = state_->all_steps();
    for (const State::StepKind& step : steps)
      if (state_->count_done(step) < state_->tasks_of(step))
        throw Error(ErrorKind::usage, "step " + step.name() + " is not finished");
    state_->settled_settings();
    report.points = state_->plan.points;
    report.tiles = state_->plan.tiles;
    report.params = state_->resolved->params;
    if (needs_spacing(state_->plan.params)) report.spacing = state_->measured->spacing.mean;
    if (needs_noise(state_->plan.params)) {
      report.noise = state_->measured->noise.sigma;
      for (std::size_t q = 0; q < report.noise_quantiles.size(); ++q)
        report.noise_quantiles[q] =
            *report.noise * (state_->measured->levels ? state_->measured->levels->quantiles[q] : 1.0);
    }
    report.unmoved.non_finite = state_->plan.points - state_->measured->bounds.valid;
    for (const fs::path& path : state_->files_of(steps[steps.size() - 2])) {
      const TaskCounts counts = PointsFile(path).header().counts;
      report.unmoved.too_few_neighbors += counts[kTooFewCount];
      report.unmoved.no_normal += counts[kNoNormalCount];
      report.short_neighborhoods += counts[kShortCount];
    }
    OutlierCounts& outliers = report.unmoved.outliers_by_reason;
    for (const fs::path& path : state_->files_of(steps.back())) {
      const TaskCounts counts = PointsFile(path).header().counts;
      outliers.isolated += counts[0];
      outliers.off_surface += counts[1];
      outliers.mixed_pixels += counts[2];
    }
    report.unmoved.outliers = outliers.total();
    if (!moves_along_normal(report.params.method)) report.unmoved.no_normal = 0;
    return report;
  });
}

}  // namespace pointfair
