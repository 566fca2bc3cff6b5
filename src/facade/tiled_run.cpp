// SPDX-License-Identifier: Apache-2.0
// The public calls of a run in tiles.
#include "pointfair/tiled_run.hpp"

#include <algorithm>
#include <new>
#include <utility>

#include "estimate/automatic.hpp"
#include "io/streamed.hpp"
#include "io/text.hpp"
#include "io/unfinished_files.hpp"
#include "pipeline/devices.hpp"
#include "platform/free_memory.hpp"
#include "platform/path_text.hpp"
#include "pointfair/run_notes.hpp"
#include "scale/emit.hpp"
#include "scale/outlier_edits.hpp"
#include "scale/points_file.hpp"
#include "scale/tasks.hpp"
#include "scale/tiled_run_access.hpp"
#include "scale/work_file.hpp"
#include "seam/cloud_sample.hpp"
#include "tiles/choice.hpp"

namespace pointfair {
namespace fs = std::filesystem;
using namespace scale;
namespace {

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

// What the last step counted while it wrote.
void add_written(const std::vector<fs::path>& files, TiledReport& report) {
  OutlierTally outliers;
  MoveTally moves;
  for (const fs::path& path : files) {
    const PointsFile written(path);
    const TaskCounts& counts = written.header().counts;
    outliers.add(counts.points.unmoved.outliers_by_reason);
    report.held += counts.held;
    add(report.outcome, counts.outcome);
    const std::vector<double> numbers = written.numbers();
    report.step = std::max(report.step, numbers.at(0));
    moves.add_numbers(std::span(numbers).subspan(1));
  }
  report.unmoved.outliers_by_reason = outliers.counts();
  report.unmoved.outliers = report.unmoved.outliers_by_reason.total();
  report.displacement = moves.displacement();
}

// A note, and the files that it is on.
struct ToldOfFiles {
  std::string text;
  const InputFile* first;
  std::size_t files;
};

// Of several files, a note that is not on all names the first that it is on.
std::string told(const ToldOfFiles& note, std::size_t files) {
  if (note.files == files) return note.text;
  const std::string more = note.files > 1 ? " and " + std::to_string(note.files - 1) + " more" : "";
  return platform::text_of(note.first->path.filename()) + more + ": " + note.text;
}

// What was known of the results beforehand, as far as it came to be.
std::vector<std::string> notes_on_files(const std::vector<InputFile>& files, const TiledReport& report) {
  constexpr std::size_t kMost = 10;
  const bool has_moves = report.displacement.max > 0;
  const bool has_removed = report.outlier_action.kind == OutlierAction::Kind::remove && report.outcome.outliers() > 0;
  std::vector<ToldOfFiles> all;
  for (const InputFile& file : files) {
    for (const auto& [kind, text] : file.notes) {
      const bool is_so = kind == FileNote::Kind::on_moves            ? has_moves
                         : kind == FileNote::Kind::loss_by_removal   ? has_removed
                         : kind == FileNote::Kind::on_unfound_sensor ? !report.found_sensor
                                                                     : true;
      if (!is_so) continue;
      const auto same = std::ranges::find(all, text, &ToldOfFiles::text);
      if (same == all.end()) {
        all.push_back({text, &file, 1});
      } else {
        ++same->files;
      }
    }
  }
  std::vector<std::string> notes;
  for (const ToldOfFiles& note : all) {
    if (notes.size() == kMost) {
      notes.push_back(std::to_string(all.size() - kMost) + " more notes of this kind are on other files");
      break;
    }
    notes.push_back(told(note, files.size()));
  }
  return notes;
}

constexpr std::uint64_t kLeastBytesOfRecord = 2;  // of a point, in any file

}  // namespace

struct TiledRun::State : Tasks {
  using Tasks::Tasks;
};

TiledChoice TiledRun::choose(const TiledJob& job, const fs::path& work, Device device) {
  if (!work.empty() || !job.output_folder.empty() || job.least_tiles > 1) return {.in_tiles = true};
  const bool is_memory_given = job.memory != 0;
  if (job.inputs.size() != 1 || io::is_stream(job.inputs.front())) {
    if (!is_memory_given) return {};
    throw Error(ErrorKind::usage,
                "what comes through a pipe is read into memory as a whole; leave out --memory, or name a file");
  }
  return with_one_kind_of_error([&]() -> TiledChoice {
    const HostMemory memory{job.memory, platform::free_memory()};
    std::error_code unknown;
    const std::uint64_t size = fs::file_size(job.inputs.front(), unknown);
    if (!is_memory_given && (unknown || !needs_tiles(size / kLeastBytesOfRecord, job.params, Device::cpu, memory)))
      return {};
    const std::shared_ptr<Source> source = io::open_source(job.inputs.front(), 0);
    TiledChoice choice{.points = source->size(), .free_bytes = memory.free};
    if (!needs_tiles(choice.points, job.params, Device::cpu, memory)) return {};
    DeviceInfo found;
    make_backend(device, found);
    choice.needed_bytes = bytes_in_memory(choice.points, job.params, found.kind);
    // Where the memory is given, planning says what tiles cannot do.
    choice.in_tiles =
        needs_tiles(choice.points, job.params, found.kind, memory) && (is_memory_given || can_be_planned(job, source));
    return choice;
  });
}

double TiledRun::float_step_in_zones(const Cloud& cloud) { return zones_of(cloud).float_step(); }

fs::path TiledRun::output_name(const fs::path& input) {
  std::string name = platform::text_of(input.filename());
  constexpr std::string_view kOctree = ".copc.laz";
  if (io::lower_case(name).ends_with(kOctree)) name.resize(name.size() - kOctree.size());
  return name.size() == platform::text_of(input.filename()).size() ? name : name + ".laz";
}

fs::path TiledRun::make_scratch_folder(const fs::path& beside) {
  constexpr std::string_view kScratch = ".pointfair-work-";
  io::remove_abandoned(beside, kScratch);
  const fs::path folder = beside / io::unfinished_name(kScratch);
  std::error_code error;
  fs::create_directory(folder, error);
  if (!error) fs::permissions(folder, fs::perms::owner_all, error);
  if (error)
    throw Error(ErrorKind::file, platform::text_of(beside) + ": cannot create a work folder: " + error.message() +
                                     "; name one with --work");
  return folder;
}

void TiledRun::plan(const TiledJob& job, const fs::path& work, unsigned threads) {
  with_one_kind_of_error([&] {
    if (!has_plan(work)) return make_plan(job, work, threads);
    const Plan plan = read_plan(work);
    const std::string other = difference(job, plan);
    if (!other.empty())
      throw Error(ErrorKind::usage, platform::text_of(work) + ": was planned with " + other +
                                        "; go on with what it was planned with, or name another work folder");
    if (job.write.strict) refuse_losses(plan);
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
  const WorkFolder& folder = state_->folder();
  std::vector<Step> steps;
  for (const WorkStep& step : folder.steps())
    steps.push_back({step.name(), folder.tasks_of(step), folder.count_done(step)});
  return steps;
}

void TiledRun::run(const std::string& name, std::size_t task, std::stop_token stop) {
  with_one_kind_of_error([&] {
    const WorkFolder& folder = state_->folder();
    const std::vector<WorkStep> steps = folder.steps();
    for (std::size_t s = 0; s < steps.size(); ++s) {
      if (steps[s].name() != name) continue;
      if (task >= folder.tasks_of(steps[s]))
        throw Error(ErrorKind::usage, "step " + name + " has " + std::to_string(folder.tasks_of(steps[s])) +
                                          " tasks, counted from 0; there is no task " + std::to_string(task));
      const bool takes_in_again = steps[s].kind == WorkStep::Kind::measure && folder.is_recut;
      if (s > 0 && !takes_in_again && !folder.is_done(steps[s], task) &&
          folder.count_done(steps[s - 1]) < folder.tasks_of(steps[s - 1]))
        throw Error(ErrorKind::usage, "step " + steps[s - 1].name() + " is not finished; run its tasks before " + name);
      if (!folder.is_done(steps[s], task)) folder.check_memory(steps[s], task);
      return state_->run(steps[s], task, stop);
    }
    throw Error(ErrorKind::usage, "there is no step " + name + "; pointfair tile status lists them");
  });
}

void TiledRun::run_all(std::stop_token stop, const ProgressFunction& progress) {
  with_one_kind_of_error([&] { state_->run_steps(WorkStep::Kind::emit, stop, progress); });
}

TiledReport TiledRun::report() const {
  return with_one_kind_of_error([&] {
    const WorkFolder& folder = state_->folder();
    TiledReport report;
    const std::vector<WorkStep> steps = folder.steps();
    for (const WorkStep& step : steps)
      if (folder.count_done(step) < folder.tasks_of(step))
        throw Error(ErrorKind::usage, "step " + step.name() + " is not finished");
    state_->settings();
    report.points = folder.plan.points;
    report.tiles = folder.plan.tiles;
    report.asked = folder.plan.params;
    report.params = state_->params();
    const Measured& measured = state_->measured();
    const Bounds& bounds = measured.bounds;
    const Position& origin = measured.origin;
    report.min = {origin[0] + bounds.min.x, origin[1] + bounds.min.y, origin[2] + bounds.min.z};
    report.max = {origin[0] + bounds.max.x, origin[1] + bounds.max.y, origin[2] + bounds.max.z};
    report.metres_per_unit = folder.plan.metres_per_unit;
    report.diagonal = diagonal_of(bounds);
    report.sensor = folder.plan.sensor;
    if (!report.sensor) report.found_sensor = one_sensor(state_->settings(), origin);
    const WantedEstimates needed = needed_by(folder.plan.params).estimates;
    if (needed.spacing) report.spacing = measured.estimate.spacing.mean;
    if (needed.noise) {
      const Noise& noise = measured.estimate.noise;
      const auto& levels = measured.estimate.levels;
      report.noise = noise.sigma;
      report.without_surface = state_->without_surface();
      report.noise_is_shared = noise.is_shared;
      report.is_of_lines = noise.is_of_lines;
      report.coordinate_step = noise.coordinate_step;
      for (std::size_t q = 0; q < report.noise_quantiles.size(); ++q)
        report.noise_quantiles[q] = noise.sigma * (levels ? levels->quantiles[q] : 1.0);
    }
    report.noise_attribute = folder.plan.noise_attribute;
    report.outlier_action = folder.plan.outlier_action;
    const Zones zones = folder.plan.zones;
    report.float_step = zones.are_several() ? zones.float_step() : float_step_of(bounds, origin);
    if (folder.plan.stores_floats) report.stored_float_step = stored_float_step(report.min, report.max);
    report.systems = scale::named_systems(folder.plan.files);
    report.ignored = measured.ignored;
    const Counts counts = state_->counts();
    report.unmoved = counts.unmoved;
    report.pulled = counts.pulled;
    report.short_neighborhoods = counts.short_neighborhoods;
    report.copies = counts.copies;
    add_written(folder.files_of(steps.back()), report);
    report.notes_on_files = notes_on_files(folder.plan.files, report);
    return report;
  });
}

}  // namespace pointfair
