// SPDX-License-Identifier: Apache-2.0
// The road from points to fair points: load, index, neighbours, normals, fairing, out.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

/// The most points that one Pipeline holds, on any device: the CPU's searches use signed 32-bit indices. Larger clouds
/// must be cut into tiles and run one by one.
inline constexpr std::uint64_t kMaxPoints = 2'147'483'632;

/// Where to compute. `automatic` takes CUDA if it is built in and a card can be used, else the CPU.
struct Device {
  enum class Kind : std::uint8_t { automatic, cpu, cuda };
  Kind kind = Kind::automatic;
  int index = 0;         ///< which CUDA card
  unsigned threads = 0;  ///< CPU threads; 0: all cores

  static constexpr Kind automatic = Kind::automatic, cpu = Kind::cpu, cuda = Kind::cuda;
  constexpr Device() = default;
  constexpr Device(Kind its_kind, int card = 0, unsigned cpu_threads = 0)
      : kind(its_kind), index(card), threads(cpu_threads) {}
};

/// The device that a pipeline runs on, and why it is that one.
struct DeviceInfo {
  Device::Kind kind = Device::cpu;
  std::string name;    ///< "AMD EPYC, 2 threads, AVX-512"; "NVIDIA H200"
  std::string reason;  ///< "requested"; "no CUDA device: driver not found"
};

/// One candidate of `Device`, for a report of what this machine has.
struct DeviceStatus {
  DeviceInfo info;
  bool usable = false;
  std::vector<std::string> details;  ///< driver, runtime, memory, each reason why it cannot be used
};

/// Every device that this build knows of, the CPU first. Never throws for a missing driver.
std::vector<DeviceStatus> list_devices();

/// What the cloud itself says, measured once after `load`. Lengths in file units.
struct Estimates {
  std::array<double, 3> min{}, max{};  ///< bounds of the finite points, relative to the cloud's origin
  double diagonal = 0;                 ///< of those bounds
  double spacing = 0;                  ///< mean distance to the 6 nearest other points
  double noise = 0;                    ///< standard deviation of the noise along the normal
  std::uint64_t points = 0;            ///< all
  std::uint64_t finite = 0;            ///< those without NaN or infinity
};

/// Why points kept their place.
struct UnmovedCounts {
  std::uint64_t non_finite = 0;         ///< a coordinate is NaN or infinite, or its square would overflow
  std::uint64_t too_few_neighbors = 0;  ///< fewer than 3 neighbours
  std::uint64_t no_normal = 0;          ///< neighbours identical or on a line
  std::uint64_t outliers = 0;           ///< farther from the surface than noise explains (Params::outliers)
  friend bool operator==(const UnmovedCounts&, const UnmovedCounts&) = default;
};

struct StageTime {
  std::string name;
  double milliseconds = 0;
};

/// What the last run did.
struct Report {
  DeviceInfo device;
  std::uint64_t points = 0;
  Params params;  ///< as used: no `auto` left, lengths in file units
  UnmovedCounts unmoved;
  std::uint64_t short_neighborhoods = 0;  ///< points whose constrained neighbourhood holds fewer than k
  /// Those that ran, in order; further iterations add to the same names. A card's stages are timed on the card; the
  /// paper's normals and fairing are one kernel there, whose time is divided as they take apart, three to two. `upload`
  /// on a card lasts until the caller's array may be used again; the index is begun meanwhile.
  std::vector<StageTime> stages;
  /// Into how many tiles the cloud was cut because it does not fit into the card's memory; 1: not cut. A cloud in tiles
  /// is kept in host memory, and its stages are `cut`, `tiles` and `download`.
  std::uint64_t tiles = 1;
  double total_milliseconds = 0;                             ///< from array to array
  std::uint64_t peak_host_bytes = 0, peak_device_bytes = 0;  ///< held by the pipeline beside the caller's arrays
};

/// Host memory for points from and to which the pipeline's device copies at full speed: page-locked if that is a card,
/// ordinary memory on the CPU. Owns it, may outlive the pipeline, moves but does not copy.
class HostBuffer {
 public:
  using Release = void (*)(Point*) noexcept;

  HostBuffer() = default;
  /// Takes over memory that `release` gives back.
  HostBuffer(Point* points, std::size_t count, Release release) : memory_(points, release), count_(count) {}

  /// The points; their values are arbitrary until they are set.
  std::span<Point> points() const { return {memory_.get(), count_}; }

 private:
  static void release_nothing(Point*) noexcept {}
  std::unique_ptr<Point[], Release> memory_{nullptr, release_nothing};
  std::size_t count_ = 0;
};

/// Called from the thread that called `run`, with the share done so far in [0, 1] and the stage at work.
using ProgressFunction = std::function<void(double share, std::string_view stage)>;

/// Holds one cloud on one device with the results of every stage, so that a run repeats only the stages that a changed
/// parameter reaches. Not for use from two threads at once. Memory: at most 100 + 8k bytes a point on the CPU.
class Pipeline {
 public:
  /// Throws ErrorKind::device if the requested device cannot be used; `automatic` never throws.
  explicit Pipeline(Device device = {});
  ~Pipeline();
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;

  /// Memory for `count` points that this pipeline reads and writes fastest: give its points() to load() and run(). A
  /// card copies 4 to 8 times as fast from and to it as from and to a std::vector; to allocate it takes about 0.3 s a
  /// GB, so allocate once and use often. Throws ErrorKind::memory.
  HostBuffer host_buffer(std::size_t count) const;

  /// Takes a copy of the points onto the device; the next run starts from the first stage. O(N). A cloud that a card
  /// cannot hold stays in host memory and is computed in tiles, with the same result. Throws ErrorKind::memory,
  /// ErrorKind::device; the pipeline then holds no cloud, as before its first load.
  void load(const Cloud& cloud);
  void load(std::span<const Point> points);

  /// Fairs the loaded cloud and returns it with moved points and the source's attributes; with Outliers::mark also with
  /// the attribute "outlier", 1 or 0 a point. Throws ErrorKind::usage for
  /// contradicting parameters, ErrorKind::memory, ErrorKind::interrupted (the next run resumes at the stage that was
  /// interrupted). Same points and same parameters give the same bits, for any number of threads.
  Cloud run(const Params& params = {}, std::stop_token stop = {}, const ProgressFunction& progress = {});

  /// The same into the caller's array of as many points as were loaded.
  void run(const Params& params, std::span<Point> out, std::stop_token stop = {},
           const ProgressFunction& progress = {});

  /// load(points) and run(params, out) at once. Where the points come in spatial order, as from most scanners and
  /// tilings, a card copies some parts while it computes others, so that this takes little longer than the longer of
  /// the two; best from and to host_buffer(), without `stop`, with widths given and nothing but the paper's step. Same
  /// bits, errors and cached stages as the two calls. `points` must not overlap `out`.
  void run(std::span<const Point> points, const Params& params, std::span<Point> out, std::stop_token stop = {},
           const ProgressFunction& progress = {});

  /// Bounds, spacing and noise of the loaded cloud; computed on the first call, which builds the index.
  const Estimates& estimates(std::stop_token stop = {});

  /// `params` with every `auto` replaced by what the data suggests, and every length in file units.
  Params resolve(const Params& params, std::stop_token stop = {});

  /// What the last successful run did.
  const Report& report() const;

  /// The device this pipeline runs on.
  DeviceInfo device() const;

  /// 1 for each outlier of the last run, 0 for other points, in file order; empty unless Outliers::mark was asked for.
  /// Valid until the next run.
  std::span<const std::uint8_t> outliers() const;

  /// Unit normals of the last run's last iteration, sign arbitrary, zero where there is none; N values, in file order.
  void normals(std::span<Point> out) const;

 private:
  friend struct PipelineAccess;
  struct State;
  explicit Pipeline(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pointfair
