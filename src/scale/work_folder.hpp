// SPDX-License-Identifier: Apache-2.0
// The work folder of a run in tiles: its plan, its steps and their tasks, and when each is done: a task is done when
// its file is there.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "scale/plan.hpp"

namespace pointfair::scale {

struct WorkStep {
  enum class Kind { ingest, measure, denoise, heights, emit };
  Kind kind;
  int iteration = 0;  // of denoise
  std::string name() const;
};

// The names in the folder: chunk-..., of each chunk of the input; measured; tile-<iteration>-..., of each tile;
// heights, where outliers are told apart by them; and of each output begun-... and written-..., which are marks. What
// is called done-... says that a step was finished whose files are not needed any more.
struct WorkFolder {
  explicit WorkFolder(const std::filesystem::path& folder) : WorkFolder(folder, read_plan(folder)) {}
  WorkFolder(const std::filesystem::path& folder, Plan its_plan) : path(folder), plan(std::move(its_plan)) {}

  std::vector<WorkStep> steps() const;  // in order
  std::size_t tasks_of(const WorkStep& step) const;
  std::filesystem::path file_of(const WorkStep& step, std::size_t task) const;
  std::vector<std::filesystem::path> files_of(const WorkStep& step) const;
  std::vector<std::filesystem::path> files_before_recut() const;
  std::filesystem::path begun_mark(std::size_t output) const;
  std::filesystem::path end_mark(const WorkStep& step) const;

  bool is_done(const WorkStep& step, std::size_t task) const;
  std::size_t count_done(const WorkStep& step) const;
  // Throws ErrorKind::file where the disk has no room for what the step leaves: before hours are spent on it.
  void check_room(const WorkStep& step) const;
  // Throws ErrorKind::memory where this machine has not what the task takes: before the system ends other processes.
  void check_memory(const WorkStep& step, std::size_t task) const;

  std::filesystem::path path;
  Plan plan;
  bool is_recut = false;  // the origin or the zones are not the plan's own, and the points were taken in again
};

}  // namespace pointfair::scale
