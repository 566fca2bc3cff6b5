// SPDX-License-Identifier: Apache-2.0
#include "scale/work_folder.hpp"

#include <cstdint>

#include "io/file_bytes.hpp"
#include "options/outlier_values.hpp"
#include "platform/free_memory.hpp"
#include "platform/path_text.hpp"
#include "scale/work_file.hpp"
#include "tiles/choice.hpp"

namespace pointfair::scale {
namespace fs = std::filesystem;
namespace {

std::string numbered(const std::string& name, std::size_t number) {
  std::string digits = std::to_string(number);
  if (digits.size() < 5) digits.insert(0, 5 - digits.size(), '0');
  return name + "-" + digits;
}

}  // namespace

std::string WorkStep::name() const {
  constexpr const char* kNames[] = {"ingest", "measure", "denoise-", "heights", "emit"};
  const std::string name = kNames[static_cast<std::size_t>(kind)];
  return kind == Kind::denoise ? name + std::to_string(iteration + 1) : name;
}

std::vector<WorkStep> WorkFolder::steps() const {
  std::vector<WorkStep> steps{{WorkStep::Kind::ingest}, {WorkStep::Kind::measure}};
  for (int i = 0; i < plan.iterations; ++i) steps.push_back({WorkStep::Kind::denoise, i});
  if (needs_heights(plan.outlier_action)) steps.push_back({WorkStep::Kind::heights});
  steps.push_back({WorkStep::Kind::emit});
  return steps;
}
std::size_t WorkFolder::tasks_of(const WorkStep& step) const {
  if (step.kind == WorkStep::Kind::ingest) return plan.chunks.size();
  if (step.kind == WorkStep::Kind::denoise) return plan.tiles;
  return step.kind == WorkStep::Kind::emit ? plan.files.size() : 1;
}
fs::path WorkFolder::file_of(const WorkStep& step, std::size_t task) const {
  if (step.kind == WorkStep::Kind::measure) return path / "measured";
  if (step.kind == WorkStep::Kind::heights) return path / "heights";
  if (step.kind == WorkStep::Kind::ingest) return path / numbered(is_recut ? "recut" : "chunk", task);
  if (step.kind == WorkStep::Kind::emit) return path / numbered("written", task);
  return path / numbered("tile-" + std::to_string(step.iteration + 1), task);
}
std::vector<fs::path> WorkFolder::files_of(const WorkStep& step) const {
  std::vector<fs::path> files;
  for (std::size_t task = 0; task < tasks_of(step); ++task) files.push_back(file_of(step, task));
  return files;
}
std::vector<fs::path> WorkFolder::files_before_recut() const {
  std::vector<fs::path> files;
  for (std::size_t task = 0; task < plan.chunks.size(); ++task) files.push_back(path / numbered("chunk", task));
  return files;
}
fs::path WorkFolder::begun_mark(std::size_t output) const { return path / numbered("begun", output); }
fs::path WorkFolder::end_mark(const WorkStep& step) const { return path / ("done-" + step.name()); }

// An output that was deleted since is written again.
bool WorkFolder::is_done(const WorkStep& step, std::size_t task) const {
  const bool is_there = step.kind != WorkStep::Kind::emit || fs::exists(plan.files[task].output);
  return is_there && (is_stored(file_of(step, task)) || is_stored(end_mark(step)));
}
std::size_t WorkFolder::count_done(const WorkStep& step) const {
  if (step.kind != WorkStep::Kind::emit && is_stored(end_mark(step))) return tasks_of(step);
  std::size_t done = 0;
  for (std::size_t task = 0; task < tasks_of(step); ++task) done += is_done(step, task);
  return done;
}

void WorkFolder::check_room(const WorkStep& step) const {
  if (step.kind != WorkStep::Kind::ingest && step.kind != WorkStep::Kind::denoise) return;
  if (!fs::exists(path)) return;  // in memory
  const double left = 1 - double(count_done(step)) / double(tasks_of(step));
  const std::uint64_t bytes_of_point =
      step.kind == WorkStep::Kind::ingest || step.iteration + 1 == plan.iterations ? 16 : 20;
  const auto needed = static_cast<std::uint64_t>(left * double(plan.points * bytes_of_point));
  const std::uint64_t free = fs::space(path).available;
  if (free < needed)
    io::fail(platform::text_of(path),
             "step " + step.name() + " needs " + std::to_string(needed) + " bytes, which is " +
                 std::to_string(needed - free) +
                 " bytes more than are free: free some space and run again; with --work, what is finished is kept");
}

void WorkFolder::check_memory(const WorkStep& step, std::size_t task) const {
  std::uint64_t needed = 0;
  if (step.kind == WorkStep::Kind::ingest) needed = bytes_of_chunk(plan.chunks[task]);
  if (step.kind == WorkStep::Kind::denoise) needed = bytes_of_tile(plan.points, plan.tiles, plan.params, plan.memory);
  const std::uint64_t free = platform::free_memory();
  if (free < needed)
    throw Error(ErrorKind::memory, "step " + step.name() + ", task " + std::to_string(task) + ": needs about " +
                                       std::to_string(needed >> 20) + " MiB of memory, and " +
                                       std::to_string(free >> 20) +
                                       " MiB are free here: free some, run it on another machine, or plan with less "
                                       "--memory");
}

}  // namespace pointfair::scale
