// SPDX-License-Identifier: Apache-2.0
// What is fixed before the first task of a run runs: the inputs as they are, what is asked for, and how the work is
// cut. It is frozen in the work folder, and every process that works there reads it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/source.hpp"
#include "pointfair/tiled_run.hpp"
#include "scale/file_notes.hpp"
#include "scale/leaf_tree.hpp"
#include "scale/zones.hpp"

namespace pointfair::scale {

/// What the files of a work folder hold and in which order: one more with each change of it, as builds of one version
/// of the program may differ in it. Any file but the plan is read only once the plan has told that it is this.
inline constexpr int kWorkFiles = 6;

struct InputFile {
  std::filesystem::path path, output;
  std::string fingerprint;                    ///< of its size, its time and some of its bytes
  std::uint64_t points = 0, first_point = 0;  ///< in the whole input; a file without points is copied
  std::string coordinate_system{};            ///< as the file says it, one line; empty: it does not say
  std::vector<FileNote> notes{};
};

/// Blocks of one file that follow each other, which one task takes in.
struct InputChunk {
  std::size_t file = 0, first_block = 0, end_block = 0;
  std::uint64_t first_point = 0, points = 0;  ///< in the whole input
};

/// The number of the chunk that has a point of the whole input.
std::size_t chunk_of(std::span<const InputChunk> chunks, std::uint64_t point);

struct Plan {
  Params params;  ///< as asked for, lengths in file units or relative
  Limits limits;
  std::string noise_attribute;
  std::string viewpoint;           ///< as asked for
  std::optional<Position> sensor;  ///< what that says, in the coordinates of the files
  bool seeks_sensor = false;       ///< nothing says one, so that the distances between points may
  OutlierAction outlier_action;
  WriteOptions write;
  std::uint64_t memory = 0;
  std::uint64_t points = 0;
  int iterations = 1;
  std::size_t tiles = 1;
  Zones zones;                            ///< as guessed; the first measurement corrects them
  double coordinate_step = 0;             ///< the least of the files'
  std::optional<double> metres_per_unit;  ///< of the first file that says it
  bool stores_floats = false;             ///< a binary file does, of its coordinates
  bool is_placed = false;                 ///< the zones are known, and not guessed
  std::vector<InputFile> files;
  std::vector<InputChunk> chunks;
};

/// What a task that takes a chunk in takes of the memory.
std::uint64_t bytes_of_chunk(const InputChunk& chunk);

/// The files of a plan, opened when they are first needed.
class Inputs {
 public:
  Inputs(const std::vector<InputFile>& files, unsigned threads)
      : files_(files), threads_(threads), open_(files.size()) {}
  /// In place of what a path leads to.
  void give(std::size_t file, std::shared_ptr<Source> source) { open_[file] = std::move(source); }
  /// Throws Error(file) if the file is not the one that was planned with.
  std::shared_ptr<Source> open(std::size_t file);
  void check_unchanged(std::size_t file) const;

 private:
  const std::vector<InputFile>& files_;
  unsigned threads_;
  std::vector<std::shared_ptr<Source>> open_;
};

/// Cuts the last file of the plan, from its first point on, into chunks.
void add_chunks(const Source& source, Plan& plan);
/// Cuts the plan's points, of which these are a sample, into tiles, and sets their number.
LeafTree cut_into_tiles(Plan& plan, std::span<Point> sample, std::uint64_t least_tiles);
/// As often as the parameters say: what is automatic does not depend on the cloud.
int iterations_of(const Params& params);

/// Whether tiles can do a job of one file, which this is: not every format, place of the sensor and method can be.
bool can_be_planned(const TiledJob& job, const std::shared_ptr<Source>& source);
/// Reads the inputs' headers and some of their points. Throws as TiledRun::plan. Writes the tree of leaves and, last,
/// the plan.
void make_plan(const TiledJob& job, const std::filesystem::path& work, unsigned threads);
/// Throws Error(file) where the results would not keep all of the inputs.
void refuse_losses(const Plan& plan);
bool has_plan(const std::filesystem::path& work);
/// Throws Error(file) if there is none, or one of another version or other kWorkFiles.
Plan read_plan(const std::filesystem::path& work);
/// What the plan's file holds: a line for each thing, its name first. `name`: of the file, for errors, which are those
/// of read_plan(), or that it is damaged.
std::string text_of(const Plan& plan);
Plan plan_of(const std::string& text, const std::string& name);
/// What of the job differs from the plan, or nothing.
std::string difference(const TiledJob& job, const Plan& plan);

std::string fingerprint_of(const std::filesystem::path& path);

}  // namespace pointfair::scale
