// SPDX-License-Identifier: Apache-2.0
// The tasks of a run, and when each is done: a task is done when its file is there.
#include "pointfair/tiled_run.hpp"

#include <fcntl.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <new>
#include <utility>

#include "estimate/automatic.hpp"
#include "io/file_bytes.hpp"
#include "io/streamed.hpp"
#include "pipeline/devices.hpp"
#include "pipeline/outlier_marks.hpp"
#include "pipeline/stage_settings.hpp"
#include "scale/denoise.hpp"
#include "scale/emit.hpp"
#include "scale/given.hpp"
#include "scale/ingest.hpp"
#include "scale/measure.hpp"
#include "scale/plan.hpp"
#include "scale/tiled_run_access.hpp"
#include "tiles/feeders.hpp"

namespace pointfair {
namespace fs = std::filesystem;
using namespace scale;
namespace {

std::string numbered(const char* name, std::size_t number) {
  std::string digits = std::to_string(number);
  if (digits.size() < 5) digits.insert(0, 5 - digits.size(), '0');
  return name + ("-" + digits);
}

// What the memory limit of this process's control group leaves (cgroup v2).
std::uint64_t free_in_group() {
  constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};
  std::string group;
  for (std::ifstream lines("/proc/self/cgroup"); std::getline(lines, group);)
    if (group.starts_with("0::")) break;
  if (!group.starts_with("0::")) return kNoLimit;
  const fs::path folder = "/sys/fs/cgroup" + group.substr(3);
  std::uint64_t limit = 0, used = 0;
  if (!(std::ifstream(folder / "memory.max") >> limit)) return kNoLimit;  // "max", or none
  std::ifstream(folder / "memory.current") >> used;
  return limit > used ? limit - used : 0;
}

// What a limit of this process leaves; `used` is the name of what it limits in /proc/self/status.
std::uint64_t free_below(int resource, const char* used) {
  rlimit limit{};
  if (::getrlimit(static_cast<__rlimit_resource_t>(resource), &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
    return ~std::uint64_t{0};
  std::uint64_t bytes = 0;
  std::ifstream lines("/proc/self/status");
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with(used)) bytes = std::strtoull(line.c_str() + std::string_view(used).size(), nullptr, 10) << 10;
  return limit.rlim_cur > bytes ? limit.rlim_cur - bytes : 0;
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
  State(const fs::path& folder, const std::vector<Device>& devices)
      : work(folder), plan(read_plan(folder)), tree(work / "leaves"), inputs(plan.files, devices[0].threads) {
    for (const Device& device : devices) workers.push_back({device, nullptr});
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
    if (is_done(step, task)) return;
    try {
      get_ready(step);
      do_task(step, task, stop);
    } catch (const Error& error) {
      // another process may have done it meanwhile, and have removed what it is made of
      if (error.kind() != ErrorKind::file || !is_done(step, task)) throw;
    }
  }

  // All that are left. Tiles are a queue for the workers; the calling thread is that of the first, and tells how many
  // were begun.
  void run_all(const StepKind& step, const std::stop_token& stop, const std::function<void(std::size_t)>& begin) {
    const std::size_t tasks = tasks_of(step);
    if (step.kind != Kind::denoise) {
      for (std::size_t task = 0; task < tasks; ++task) {
        begin(task);
        run(step, task, stop);
      }
      return;
    }
    TaskQueue<std::size_t> queue;
    for (std::size_t task = 0; task < tasks; ++task) queue.put(task);
    const auto next = [&](bool tells) -> std::unique_ptr<Denoising> {
      while (const auto task = queue.take(false)) {
        if (tells) begin(*task);
        if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
        if (!is_done(step, *task))
          return std::make_unique<Denoising>(tile_work(step, *task), file_of(step, *task), stop);
      }
      return nullptr;
    };
    try {
      if (count_done(step) < tasks) get_ready(step);
      on_feeders(workers.size(), [&](std::size_t worker) {
        try {
          denoise_all([&] { return next(worker == 0); }, workers[worker].backend());
        } catch (...) {
          queue.close();
          throw;
        }
      });
    } catch (const Error& error) {
      // another process may have done them meanwhile, and have removed what they are made of
      if (error.kind() != ErrorKind::file || count_done(step) < tasks) throw;
    }
  }

  // What the tasks of a step share, and only read.
  void get_ready(const StepKind& step) {
    if (!corrected && fs::exists(work / "origin")) use_origin(load_origin());
    if (step.kind != Kind::denoise) return;
    settled_settings();
    if (input && input_iteration == step.iteration) return;
    const StepKind before = step.iteration == 0 ? StepKind{Kind::ingest} : StepKind{Kind::denoise, step.iteration - 1};
    input.reset();
    input.emplace(files_of(before), tree.leaves());
    input_iteration = step.iteration;
  }

  // What computes tiles, one at a time.
  struct Worker {
    Device device;
    std::unique_ptr<Backend> made;
    Backend& backend() {
      DeviceInfo info;
      if (!made) made = make_backend(device, info);
      return *made;
    }
  };

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
    ingest(inputs.open(chunk.file), chunk, plan, tree, threads(), file_of(step, task), stop);
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
    std::optional<GivenNoise> given;
    if (!plan.noise_attribute.empty()) given = noise_of_attribute(inputs, plan, threads(), stop);
    save(measure(cloud, plan, given, workers[0].backend(), stop), file_of(step, 0));
  }

  void run_denoise(const StepKind& step, std::size_t task, const std::stop_token& stop) {
    Denoising denoising(tile_work(step, task), file_of(step, task), stop);
    denoising.read();
    denoising.compute(workers[0].backend());
    denoising.write();
  }

  TileWork tile_work(const StepKind& step, std::size_t task) const {
    const Settings& settings = resolved->settings;
    std::optional<Frame> frame;
    if (sums_within_radius(plan.params)) frame = measured->frame;
    FairingSettings fairing = settings.fairing;
    fairing.is_further = step.iteration > 0;
    const bool is_last = step.iteration + 1 == plan.iterations;
    return {*input,
            {tree.tile_begin(task), tree.tile_begin(task + 1)},
            {frame, settings.neighbors, settings.normals, fairing},
            points_in_memory(plan.memory, bytes_of_tile_point(plan.params)),
            is_last ? &plan.chunks : nullptr};
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
    TileResults results(files_of({Kind::denoise, plan.iterations - 1}), plan, task, source, settling, stop);
    std::vector<Attribute> added;
    if (plan.params.outliers == Outliers::mark)
      added.push_back(outlier_marks(part_of(source, 0, {}), results.find_outliers(threads())));
    WriteOptions options = plan.write;
    options.overwrite = true;
    options.sync = true;
    options.threads = threads();
    fs::create_directories(file.output.parent_path());
    io::write_moved(file.output, source, results, options, std::move(added));
    PointsHeader header;
    const OutlierCounts held_back = results.held_back();
    header.counts[kIsolatedCount] = held_back.isolated;
    header.counts[kOffSurfaceCount] = held_back.off_surface;
    header.counts[kMixedCount] = held_back.mixed_pixels;
    header.counts[kHeldCount] = results.held_by_limits();
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

  unsigned threads() const { return workers[0].device.threads; }

  const Settings& settled_settings() {
    if (!resolved) {
      measured = load_measured(work / "measured");
      resolved = resolve(plan, *measured);
    }
    return resolved->settings;
  }

  fs::path work;
  std::vector<Worker> workers{};
  Plan plan;
  LeafTree tree;
  Inputs inputs;
  bool corrected = false;  // the origin is not the plan's own
  std::optional<Measured> measured;
  std::optional<Resolved> resolved;
  std::optional<StoredCloud> input;
  int input_iteration = -1;
};

std::uint64_t TiledRun::bytes_in_memory(std::uint64_t points, const Params& params) {
  return points * (bytes_of_tile_point(params) + 2 * sizeof(Point));
}

std::uint64_t TiledRun::free_memory() {
  std::uint64_t free = std::uint64_t{8} << 30;
  std::ifstream lines("/proc/meminfo");
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("MemAvailable:")) free = std::strtoull(line.c_str() + 13, nullptr, 10) << 10;
  return std::min({free, free_in_group(), free_below(RLIMIT_DATA, "VmData:"), free_below(RLIMIT_AS, "VmSize:")});
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
    : TiledRun(with_one_kind_of_error([&] { return std::make_unique<State>(work, single_devices(device)); })) {}
TiledRun::TiledRun(std::unique_ptr<State> state) : state_(std::move(state)) {}
TiledRun TiledRunAccess::make(const fs::path& work, const std::vector<Device>& workers) {
  return TiledRun(std::make_unique<TiledRun::State>(work, workers));
}
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
      state_->run_all(steps[s], stop, [&](std::size_t task) {
        if (progress) progress((double(s) + double(task) / double(tasks)) / double(steps.size()), steps[s].name());
      });
      if (steps[s].kind != State::Kind::denoise) continue;
      // what this step read is not needed any more
      const State::StepKind before = steps[s].iteration == 0 ? steps[0] : steps[s - 1];
      mark(state_->end_mark(before));  // after it, all names of this step are on the disk
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
    report.noise_attribute = state_->plan.noise_attribute;
    report.ignored = state_->measured->ignored;
    report.unmoved.non_finite = state_->plan.points - state_->measured->bounds.valid - report.ignored;
    for (const fs::path& path : state_->files_of(steps[steps.size() - 2])) {
      const TaskCounts counts = PointsFile(path).header().counts;
      report.unmoved.too_few_neighbors += counts[kTooFewCount];
      report.unmoved.no_normal += counts[kNoNormalCount];
      report.short_neighborhoods += counts[kShortCount];
    }
    OutlierCounts& outliers = report.unmoved.outliers_by_reason;
    for (const fs::path& path : state_->files_of(steps.back())) {
      const TaskCounts counts = PointsFile(path).header().counts;
      outliers.isolated += counts[kIsolatedCount];
      outliers.off_surface += counts[kOffSurfaceCount];
      outliers.mixed_pixels += counts[kMixedCount];
      report.held += counts[kHeldCount];
    }
    report.unmoved.outliers = outliers.total();
    if (!moves_along_normal(report.params.method)) report.unmoved.no_normal = 0;
    return report;
  });
}

}  // namespace pointfair
