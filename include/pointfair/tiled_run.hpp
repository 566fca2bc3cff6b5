// SPDX-License-Identifier: Apache-2.0
// Clouds that are larger than memory: the run as tasks over a folder, by one process or by many.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"
#include "pointfair/io.hpp"
#include "pointfair/limits.hpp"
#include "pointfair/outliers.hpp"
#include "pointfair/params.hpp"
#include "pointfair/pipeline.hpp"
#include "pointfair/positions.hpp"
#include "pointfair/report.hpp"

namespace pointfair {

/// The files to denoise in tiles, and where the result goes.
struct TiledJob {
  std::vector<std::filesystem::path> inputs{};  ///< files that make one cloud, each point once
  std::filesystem::path output{};               ///< the file to write, if there is one input
  std::filesystem::path output_folder{};        ///< in place of `output`: each input is written there under its name
  Params params{};
  Limits limits{};                ///< without a mask
  std::string noise_attribute{};  ///< the attribute that has the noise of each point; empty: the noise is estimated
  /// Where the sensor stood, as parse_viewpoints reads it, but one place for all points: "x,y,z", or "none"; empty:
  /// what the inputs say, unknown if they say several places.
  std::string viewpoint{};
  OutlierAction outlier_action{};  ///< with Outliers::mark, in place of its attribute; `remove`: LAS and LAZ only
  WriteOptions write{};            ///< formats other than the input's own are refused
  std::uint64_t memory = 0;        ///< bytes that a task may take, without the mapped input; 0: half of the free memory
  std::uint64_t least_tiles = 1;
  unsigned workers = 1;  ///< tasks that run at once, as several cards do, and share the memory
};

/// How far points moved, in file units. Points that kept their place count, with 0.
struct Displacement {
  double mean = 0, rms = 0;
  double p95 = 0;  ///< 95 % of the points did not move farther; to 1 %
  double max = 0;
};

/// How a job is best computed on this machine.
struct TiledChoice {
  bool in_tiles = false;           ///< on disk; else by a Pipeline, in memory
  std::uint64_t points = 0;        ///< where memory decided; else 0
  std::uint64_t needed_bytes = 0;  ///< at most, by a run in memory; the same
  std::uint64_t free_bytes = 0;    ///< that this process can take now; the same
};

/// A coordinate system that inputs name with an EPSG code.
struct NamedSystem {
  std::string name;            ///< as the first of these inputs has it
  std::uint64_t files = 0;     ///< inputs that name it
  std::filesystem::path file;  ///< the first of them
};

/// What a finished run did.
struct TiledReport {
  std::uint64_t points = 0;
  std::uint64_t tiles = 0;
  Params asked;   ///< as planned: what is automatic is, and lengths are in file units or relative
  Params params;  ///< as used
  UnmovedCounts unmoved;
  OutlierCounts pulled;       ///< as in Report
  std::uint64_t ignored = 0;  ///< finite points that Limits::ignore left out
  std::uint64_t held = 0;     ///< others that the limits did not let move, and that are no outliers
  std::uint64_t short_neighborhoods = 0;
  std::uint64_t copies = 0;                 ///< as in Report
  std::optional<double> spacing, noise;     ///< of the input, if parameters followed from them
  std::array<double, 3> noise_quantiles{};  ///< as in Estimates, where there is a noise
  double without_surface = 0;               ///< as in Report
  bool noise_is_shared = false;             ///< as in Estimates
  bool is_of_lines = false;                 ///< the same
  double coordinate_step = 0;               ///< the same
  std::string noise_attribute;              ///< with the given noise; empty: it was estimated
  std::optional<double> metres_per_unit;    ///< as in FileInfo, where one of the inputs says so
  Position min{}, max{};                    ///< bounds of the finite points, in the coordinates of the files
  double diagonal = 0;                      ///< as in Estimates
  std::optional<Position> sensor;           ///< the one place of the sensor that was given, or that all files say
  std::optional<Position> found_sensor;     ///< as in Report
  double float_step = 0;                    ///< as in Estimates; in zones, the largest step in one
  OutlierAction outlier_action;             ///< as asked for
  OutlierOutcome outcome;                   ///< what it came to
  Displacement displacement;
  std::vector<NamedSystem> systems;  ///< that the inputs name, those of most inputs first
  double step = 0;                   ///< between coordinates that an output stores as integers, the largest; else 0
  double stored_float_step = 0;      ///< the largest between those that a binary input stores as 32-bit floats; else 0
  /// What the outputs do not keep of their inputs, what lies beside these only, that normals are those from before, and
  /// places of sensors that were taken or not: a sentence each, of many files the first ten and how many more there
  /// are.
  std::vector<std::string> notes_on_files;
};

/// A run over a work folder, which holds the plan and the results of finished tasks. Tasks are idempotent: a task that
/// is done is not done again, one that was killed leaves nothing, and two processes that do the same one leave the same
/// file. The result has the bits of Pipeline::run on the whole cloud. A cloud that is too wide for floats around one
/// origin has zones in both: cubes whose points are computed as floats relative to the middle of the cube. Zones follow
/// from the set of points, so that tiles, memory and workers change no bit of the result there either.
///
/// Calls throw Error: ErrorKind::file if a file cannot be read or written, if the disk is full, or if an input is not
/// the one that was planned with; ErrorKind::memory if a task or the neighbourhood of one point does not fit;
/// ErrorKind::interrupted after the stop token was triggered. What is finished stays, and a later call goes on from
/// there.
class POINTFAIR_EXPORT TiledRun {
 public:
  /// Whether a job is computed in tiles or by a Pipeline: in tiles if it asks for them by a work folder, an output
  /// folder or least_tiles, or if the cloud takes more memory than it gives or, where it gives none, than half of what
  /// is free, unless tiles cannot do it. Opens the input only if the cloud may take so much; a text is scanned then.
  /// Throws ErrorKind::usage for standard input with a memory.
  static TiledChoice choose(const TiledJob& job, const std::filesystem::path& work, Device device = {});

  /// What an input is called in an output folder: as before, but ".laz" for ".copc.laz", since a COPC file is written
  /// in the format of its points, without its octree.
  static std::filesystem::path output_name(const std::filesystem::path& input);

  /// The largest step of the floats that a cloud is computed with in zones; 0 if it needs none. It needs zones where
  /// more than a hundredth of its points lie so far from its origin that floats relative to that step by more than the
  /// coordinates of the file, and by more than 1/128 of the spacing; 1/32 where the file does not say its step, or one
  /// below 1/1024 of the spacing. A cloud without a file and one of floats need none. Milliseconds.
  static double float_step_in_zones(const Cloud& cloud);

  /// Makes a hidden folder in `beside` for a run whose files are not kept; remove it afterwards. Removes such folders
  /// that killed processes of this machine left there.
  static std::filesystem::path make_scratch_folder(const std::filesystem::path& beside);

  /// Writes the plan of the job into the folder, and makes the folder if it is not there. If the folder has a plan of
  /// the same job, nothing changes. Throws ErrorKind::usage for parameters that cannot be followed tile by tile, and if
  /// the folder holds the plan of another job.
  static void plan(const TiledJob& job, const std::filesystem::path& work, unsigned threads = 0);

  /// Opens the plan in the folder. Several cards do a tile each at a time, and each takes the plan's memory.
  explicit TiledRun(const std::filesystem::path& work, Device device = {});
  ~TiledRun();
  TiledRun(TiledRun&&) noexcept;
  TiledRun& operator=(TiledRun&&) noexcept;

  /// Tasks of one step do not depend on each other; a step needs all tasks of the step before.
  struct Step {
    std::string name;  ///< "ingest", "measure", "denoise-1", .., "heights" where the outlier action asks them, "emit"
    std::size_t tasks = 0, done = 0;
  };
  std::vector<Step> steps() const;

  /// Does task `task` of the step called `step`; returns at once if it is done. Throws ErrorKind::usage if there is no
  /// such task, or if the step before is not finished.
  void run(const std::string& step, std::size_t task, std::stop_token stop = {});
  /// Does all tasks that are not done, in order. Removes files that no task needs any more.
  void run_all(std::stop_token stop = {}, const ProgressFunction& progress = {});

  /// What the run did. Throws if it is not finished.
  TiledReport report() const;

 private:
  friend struct TiledRunAccess;
  struct POINTFAIR_INTERNAL State;
  POINTFAIR_INTERNAL explicit TiledRun(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pointfair
