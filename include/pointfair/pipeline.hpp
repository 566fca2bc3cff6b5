// SPDX-License-Identifier: Apache-2.0
// The road from points to fair points: load, index, neighbours, normals, fairing, out.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string_view>

#include "pointfair/cloud.hpp"
#include "pointfair/device.hpp"
#include "pointfair/params.hpp"
#include "pointfair/report.hpp"

namespace pointfair {

/// The most points that one Pipeline holds, on any device: the CPU's searches use signed 32-bit indices. Larger clouds
/// must be cut into tiles and run one by one.
inline constexpr std::uint64_t kMaxPoints = 2'147'483'632;

/// Called from the thread that called `run`, with the share done so far in [0, 1] and the stage at work.
using ProgressFunction = std::function<void(double share, std::string_view stage)>;

/// Holds one cloud on one device with the results of every stage, so that a run repeats only the stages that a changed
/// parameter reaches. Not for use from two threads at once. Memory: at most 100 + 8k bytes a point on the CPU.
///
/// Every call may throw Error, and nothing else: ErrorKind::memory if the host's or the device's memory does not
/// suffice, ErrorKind::device if a card is lost, ErrorKind::interrupted once its stop token is triggered, and what it
/// names itself. After an error of any call but load() the pipeline still holds its cloud, and the next call gives what
/// a new pipeline would.
class Pipeline {
 public:
  /// Throws ErrorKind::device if the requested device cannot be used; `automatic` never throws that.
  explicit Pipeline(Device device = {});
  ~Pipeline();
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;

  /// Memory for `count` points that this pipeline reads and writes fastest: give its points() to load() and run(). A
  /// card copies 4 to 8 times as fast from and to it as from and to a std::vector; to allocate it takes about 0.3 s a
  /// GB, so allocate once and use often.
  HostBuffer host_buffer(std::size_t count) const;

  /// Takes a copy of the points onto the device; the next run starts from the first stage. O(N). A cloud that a card
  /// cannot hold stays in host memory and is computed in tiles, with the same result. Throws ErrorKind::usage for more
  /// than kMaxPoints points. After any error the pipeline holds no cloud, as before its first load.
  void load(const Cloud& cloud);
  void load(std::span<const Point> points);

  /// Denoises the loaded cloud and returns it with moved points and the source's attributes; with Outliers::mark also
  /// with the attribute "outlier", 1 or 0 a point. Throws ErrorKind::usage for contradicting parameters; a run that was
  /// interrupted is taken up by the next where it was. The same set of points and the same parameters give the same
  /// bits, for any order of the points, any number of threads and any device.
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

  /// Bounds, spacing and noise of the loaded cloud; measured on the first call, which builds the index. Valid until the
  /// next load.
  const Estimates& estimates(std::stop_token stop = {});

  /// `params` with every `auto` replaced by what the data suggests, and every length in file units.
  Params resolve(const Params& params, std::stop_token stop = {});

  /// What the last successful run did.
  const Report& report() const;

  /// The device this pipeline runs on.
  DeviceInfo device() const;

  /// 1 for each outlier of the last successful run, 0 for other points, in file order; empty unless Outliers::mark was
  /// asked for. Valid until the next run.
  std::span<const std::uint8_t> outliers() const;

  /// Unit normals of the last run's last iteration, sign arbitrary, zero where there is none; N values, in file order.
  /// Throws ErrorKind::usage if the last run did not succeed or a cloud was loaded since. O(N); of a cloud in tiles as
  /// long as an iteration.
  void normals(std::span<Point> out, std::stop_token stop = {});

 private:
  friend struct PipelineAccess;
  struct State;
  explicit Pipeline(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pointfair
