// SPDX-License-Identifier: Apache-2.0
// The tasks of a run in tiles: what each reads, computes and leaves in the work folder.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "pointfair/pipeline.hpp"
#include "scale/denoise.hpp"
#include "scale/emit.hpp"
#include "scale/leaf_tree.hpp"
#include "scale/measure.hpp"
#include "scale/plan.hpp"
#include "scale/stored_cloud.hpp"
#include "scale/work_folder.hpp"
#include "seam/backend.hpp"

namespace pointfair::scale {

class Tasks {
 public:
  Tasks(const std::filesystem::path& work, const std::vector<Device>& devices);
  // Of a cloud in memory, whose work folder is there too: `plan` has one file, `source` in place of its path. `noise`:
  // of the points, where it is given.
  Tasks(const MemoryFolder& work, Plan plan, LeafTree tree, std::shared_ptr<Source> source,
        std::optional<GivenNoise> noise, Backend& backend);

  const WorkFolder& folder() const { return folder_; }
  // Does the task; returns at once if it is done.
  void run(const WorkStep& step, std::size_t task, const std::stop_token& stop);
  // All that are left. Tiles are shared by the workers; the calling thread is that of the first, and tells how many
  // were begun.
  void run_all(const WorkStep& step, const std::stop_token& stop, const std::function<void(std::size_t)>& begin);
  // All steps up to the last of this kind. Removes files that no task needs any more.
  void run_steps(WorkStep::Kind last, const std::stop_token& stop, const ProgressFunction& progress);

  // Once the step `measure` is done.
  const Settings& settings();
  const Measured& measured() const { return *measured_; }
  const Params& params() const { return resolved_->params; }
  double without_surface() const { return resolved_->without_surface; }
  // Where the points of a file are after the last iteration.
  TileResults results(std::size_t file, std::shared_ptr<const Source> source, const std::stop_token& stop);
  // Those of the first iteration that kept their place, and points with short neighbourhoods.
  Counts counts() const;

 private:
  // What computes tiles, one at a time.
  struct Worker {
    Device device;
    std::unique_ptr<Backend> made;
    Backend* given = nullptr;  // in place of it
    Backend& backend();
  };

  void get_ready(const WorkStep& step);
  void do_task(const WorkStep& step, std::size_t task, const std::stop_token& stop);
  void run_ingest(const WorkStep& step, std::size_t task, const std::stop_token& stop);
  void run_measure(const WorkStep& step, const std::stop_token& stop);
  void run_denoise(const WorkStep& step, std::size_t task, const std::stop_token& stop);
  void run_heights(const WorkStep& step, const std::stop_token& stop);
  void run_emit(const WorkStep& step, std::size_t task, const std::stop_token& stop);
  void run_tiles(const WorkStep& step, const std::stop_token& stop, const std::function<void(std::size_t)>& begin);
  TileWork tile_work(const WorkStep& step, std::size_t task) const;
  void take_zones();
  unsigned threads() const { return workers_[0].device.threads; }

  WorkFolder folder_;
  std::vector<Worker> workers_{};
  LeafTree tree_;
  Inputs inputs_;
  std::optional<GivenNoise> noise_;  // where no attribute of the files has it
  std::optional<Measured> measured_;
  std::optional<RunSettings> resolved_;
  std::optional<StoredCloud> input_;  // of the tiles
  int input_iteration_ = 0;           // that they are of
};

}  // namespace pointfair::scale
