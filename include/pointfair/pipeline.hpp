// SPDX-License-Identifier: Apache-2.0
// The pipeline: load, index, neighbours, normals, fairing, out.
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
#include "pointfair/export.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

/// The most points that one Pipeline holds, on any device: the CPU's searches use signed 32-bit indices. Larger clouds
/// must be cut into tiles and run one by one.
inline constexpr std::uint64_t kMaxPoints = 2'147'483'632;

/// Where to compute. `automatic` is CUDA if this build has it and a card can be used, else the CPU.
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

/// A device of this machine, and whether it can be used.
struct DeviceStatus {
  DeviceInfo info;
  bool usable = false;
  std::vector<std::string> details;  ///< driver, runtime, memory, and why it cannot be used
};

/// Every device that this build can see, the CPU first. A missing driver is no error.
POINTFAIR_EXPORT std::vector<DeviceStatus> list_devices();

/// What is measured on the loaded cloud, once after `load`. Lengths in file units.
struct Estimates {
  std::array<double, 3> min{}, max{};  ///< bounds of the finite points, relative to the cloud's origin
  double diagonal = 0;                 ///< of those bounds
  double spacing = 0;                  ///< mean distance to the 6 nearest other points
  double noise = 0;                    ///< estimated standard deviation of the noise along the normal
  std::uint64_t points = 0;            ///< number of all points
  std::uint64_t finite = 0;            ///< number of points without NaN or infinity
};

/// How many points kept their place, by reason.
struct UnmovedCounts {
  std::uint64_t non_finite = 0;         ///< a coordinate is NaN or infinite, or its square would overflow
  std::uint64_t too_few_neighbors = 0;  ///< fewer than 3 neighbours
  std::uint64_t no_normal = 0;          ///< neighbours identical or on a line
  std::uint64_t outliers = 0;           ///< off the surface (Params::outliers)
  friend bool operator==(const UnmovedCounts&, const UnmovedCounts&) = default;
};

/// How long a stage took.
struct StageTime {
  std::string name;
  double milliseconds = 0;
};

/// What the last run did.
struct Report {
  DeviceInfo device;
  std::uint64_t points = 0;
  Params params;  ///< as used: lengths in file units, and `auto` only for what nothing reads
  UnmovedCounts unmoved;
  std::uint64_t short_neighborhoods = 0;  ///< points whose constrained neighbourhood has fewer than k neighbours
  /// The stages that ran, in order; further iterations add to the same names. Stages on a card are timed by the card.
  /// Where normals and fairing are one kernel there, its time is divided three to two, as they take apart. `upload` to
  /// a card lasts until the caller may change the array again; the index is started meanwhile.
  std::vector<StageTime> stages;
  /// Number of tiles that the cloud was cut into because it does not fit into the card's memory; 1: not cut. A cloud in
  /// tiles stays in host memory, and its stages are `cut`, `tiles` and `download`.
  std::uint64_t tiles = 1;
  double total_milliseconds = 0;                             ///< from array to array
  std::uint64_t peak_host_bytes = 0, peak_device_bytes = 0;  ///< of the pipeline, without the caller's arrays
};

/// Host memory for points that the pipeline's device copies at full speed: page-locked for a card, ordinary for the
/// CPU. Owns the memory and may outlive the pipeline. Can be moved, not copied.
class HostBuffer {
 public:
  using Release = void (*)(Point*) noexcept;

  HostBuffer() = default;
  /// Takes ownership of `points`; `release` frees it.
  HostBuffer(Point* points, std::size_t count, Release release) : memory_(points, release), count_(count) {}

  /// The points; their values are undefined until they are written.
  std::span<Point> points() const { return {memory_.get(), count_}; }

 private:
  static void release_nothing(Point*) noexcept {}
  std::unique_ptr<Point[], Release> memory_{nullptr, release_nothing};
  std::size_t count_ = 0;
};

/// Is called on the thread that called `run`, with the share done so far in [0, 1] and the current stage.
using ProgressFunction = std::function<void(double share, std::string_view stage)>;

/// Holds one cloud on one device together with the results of all stages, so that a run repeats only the stages whose
/// parameters changed. One thread at a time may use it. Memory on the CPU: at most 100 + 8k bytes a point.
class POINTFAIR_EXPORT Pipeline {
 public:
  /// Throws ErrorKind::device if the requested device cannot be used. `automatic` falls back to the CPU instead.
  explicit Pipeline(Device device = {});
  ~Pipeline();
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;

  /// Memory for `count` points that this pipeline's device copies fastest; pass its points() to load() and run(). A
  /// card copies 4 to 8 times as fast to and from it as with a std::vector. Allocation takes about 0.3 s a GB, so
  /// allocate once and use it often. Throws ErrorKind::memory.
  HostBuffer host_buffer(std::size_t count) const;

  /// Copies the points to the device; the next run starts from the first stage. O(N). A cloud that does not fit into a
  /// card's memory stays in host memory and is computed in tiles, with the same result. Throws ErrorKind::usage for
  /// more than kMaxPoints points, ErrorKind::memory, ErrorKind::device; the pipeline is empty then.
  void load(const Cloud& cloud);
  void load(std::span<const Point> points);

  /// Denoises the loaded cloud. Returns the moved points with the source's attributes, and with Outliers::mark also the
  /// attribute "outlier", 1 or 0 for each point. Throws ErrorKind::usage for contradicting parameters,
  /// ErrorKind::memory, and ErrorKind::interrupted after `stop`; the next run resumes at the stage that was
  /// interrupted. The same points and parameters give the same bits for any number of threads and on any device.
  Cloud run(const Params& params = {}, std::stop_token stop = {}, const ProgressFunction& progress = {});

  /// The same into `out`, an array of as many points as were loaded.
  void run(const Params& params, std::span<Point> out, std::stop_token stop = {},
           const ProgressFunction& progress = {});

  /// load(points) and run(params, out) in one call, with the same bits, errors and cached stages. If the points come in
  /// spatial order, as from most scanners, a card copies some of them while it computes others. That saves most with
  /// points in a host_buffer(), with all sigmas given, with k and the paper's settings, and without `stop`. `points`
  /// and `out` must not overlap.
  void run(std::span<const Point> points, const Params& params, std::span<Point> out, std::stop_token stop = {},
           const ProgressFunction& progress = {});

  /// Bounds, spacing and noise of the loaded cloud. The first call after `load` measures them, and builds the index if
  /// there is none. Throws ErrorKind::interrupted after `stop`.
  const Estimates& estimates(std::stop_token stop = {});

  /// `params` with every `auto` replaced by the value that a run would use, and every length in file units. Measures
  /// what it needs, as estimates() does.
  Params resolve(const Params& params, std::stop_token stop = {});

  /// What the last successful run did, and with which parameters.
  const Report& report() const;

  /// The device that this pipeline runs on.
  DeviceInfo device() const;

  /// 1 for each outlier of the last run, 0 for the other points, in file order; empty without Outliers::mark. Valid
  /// until the next run.
  std::span<const std::uint8_t> outliers() const;

  /// The unit normals of the last run's last iteration, in file order, with arbitrary signs; zero where there is none.
  /// `out` has as many elements as points were loaded. Throws ErrorKind::usage if there was no run.
  void normals(std::span<Point> out) const;

 private:
  friend struct PipelineAccess;
  struct POINTFAIR_INTERNAL State;
  POINTFAIR_INTERNAL explicit Pipeline(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pointfair
