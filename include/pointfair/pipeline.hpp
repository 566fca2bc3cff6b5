// SPDX-License-Identifier: Apache-2.0
// The pipeline: load, index, neighbours, normals, fairing, out.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include "pointfair/cloud.hpp"
#include "pointfair/device.hpp"
#include "pointfair/device_points.hpp"
#include "pointfair/export.hpp"
#include "pointfair/params.hpp"
#include "pointfair/report.hpp"

namespace pointfair {

/// The most points that one Pipeline holds, on any device: the CPU's searches use signed 32-bit indices. Larger clouds
/// are run in tiles on disk (TiledRun).
inline constexpr std::uint64_t kMaxPoints = 2'147'483'632;

/// Is called on the thread that called `run`, with the share done so far in [0, 1] and the current stage.
using ProgressFunction = std::function<void(double share, std::string_view stage)>;

/// Holds one cloud on one device together with the results of all stages, so that a run repeats only the stages whose
/// parameters changed. One thread at a time may use it. Memory on the CPU: at most 162 + 8k bytes a point, 760 with
/// Method::learned.
///
/// Floats are relative to the cloud's one origin (Estimates::float_step says how finely they step). A Cloud that is too
/// wide for that is computed in zones, each around its own origin, with the bits of a TiledRun (docs/scale.md).
///
/// Every call may throw Error, and nothing else: ErrorKind::memory if the host or the device has too little memory,
/// ErrorKind::device if a card is lost, ErrorKind::interrupted after its stop token was triggered, and what is named at
/// the call. After an error of any call but load() the pipeline still holds its cloud, and the next call gives what a
/// new pipeline would give.
class POINTFAIR_EXPORT Pipeline {
 public:
  /// Throws ErrorKind::device if the requested device cannot be used. `automatic` falls back to the CPU instead.
  explicit Pipeline(Device device = {});
  ~Pipeline();
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;

  /// Memory for `count` points that this pipeline's device copies fastest; pass its points() to load() and run(). A
  /// card copies 4 to 8 times as fast to and from it as to and from a std::vector. Allocation takes about 0.3 s a GB,
  /// so allocate once and use it often.
  HostBuffer host_buffer(std::size_t count) const;

  /// Copies the points to the device; the next run starts from the first stage. O(N). A cloud that does not fit into a
  /// card's memory stays in host memory and is computed in tiles, with the same result. Throws ErrorKind::usage for
  /// more than kMaxPoints points. After any error the pipeline is empty, as before its first load.
  void load(const Cloud& cloud);
  void load(std::span<const Point> points);

  /// Gives the standard deviation of the noise at each point of the loaded cloud, in file units and in upload order, in
  /// place of the estimate; an empty span brings the estimate back. Holds until the next load. The median is the noise
  /// of a typical place. The values at up to 32,768 points are smoothed onto a grid of up to 32^3 nodes, and kept
  /// within an eighth of the median and 8 times the median. A value that is not positive and finite is ignored, and its
  /// place takes the noise around it. Points at one place must have one value. Throws ErrorKind::usage unless there is
  /// a value for each point, one of them positive. O(N) and 16 bytes a point.
  void set_noise(std::span<const float> sigmas);

  /// Gives the place where the sensor stood that saw the loaded cloud, in the file's coordinates: one position for all
  /// points, or one for each in upload order; an empty span: none, and none is looked for. A position that is not
  /// finite is unknown. A load of a Cloud takes what its file says (file_viewpoints). Holds until the next load. Points
  /// between two surfaces along the ray are then outliers (OutlierCounts::mixed_pixels), and Params::along can be
  /// Along::ray. Without this call, a run that measures the noise looks for the place in the distances between points
  /// (Report::found_sensor), for mixed pixels alone. Throws ErrorKind::usage for another number of positions.
  /// O(positions), and 12 bytes for each.
  void set_viewpoint(std::span<const std::array<double, 3>> positions);

  /// Gives the faces of the loaded cloud for Connectivity::mesh; no faces: none are known. A load of a Cloud takes
  /// those of its file. Holds until the next load. Points at one place are one vertex. Faces may be of any size, order
  /// and orientation; a corner that repeats counts once, and a face with fewer than 3 places makes no edges: the report
  /// counts those (MeshReport). Throws ErrorKind::usage for a corner that is no point of the cloud. O(corners).
  void set_faces(Polygons faces);

  /// Gives the weights of Method::learned, as a file of them holds them, in place of the program's own; an empty span
  /// brings those back. Holds for all clouds. Throws ErrorKind::file, with a line that begins with `name`, for what is
  /// cut, damaged, made for another version, or no such file. O(1).
  void set_weights(std::span<const std::byte> file, const std::string& name);

  /// Denoises the loaded cloud. Returns the moved points with the source's attributes, and with Outliers::mark also the
  /// attribute "outlier" (see outliers()). Throws ErrorKind::usage for contradicting parameters. The run after an
  /// interrupted one resumes where that one stopped. The same set of points and the same parameters give the same bits,
  /// for any order of the points, any number of threads and any device.
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

  /// Denoises many small clouds, each by itself, with the bits of a load and a run of its own: cloud i has the points
  /// offsets[i] to offsets[i + 1]. If runs_together(), one set of kernels computes up to 2,048 clouds of up to
  /// 32,768 points, or up to 128 if something is estimated on each cloud, while all cores of the host measure the next
  /// ones; else this is a loop. Afterwards the pipeline is empty. `out` may be `points`. Throws
  /// ErrorKind::usage for offsets that do not begin with 0, decrease, or do not end with the number of points.
  void run_many(std::span<const Point> points, std::span<const std::uint64_t> offsets, const Params& params,
                std::span<Point> out, std::stop_token stop = {});

  /// The same for points that lie on the pipeline's card, read as load() reads them. Clouds that need an origin are
  /// computed one by one.
  void run_many(const DevicePoints& points, DeviceStream stream, std::span<const std::uint64_t> offsets,
                const Params& params, const DeviceOutput& out, std::stop_token stop = {});

  /// Whether run_many() computes clouds with these parameters at once: on a card, by the method bilateral without the
  /// constraint; with k only if every length that it reads is given.
  bool runs_together(const Params& params) const;

  /// load(), run() and normals() for points that lie on the pipeline's card, the first of several: nothing is copied
  /// through host memory. Work starts after what `stream` was given before. Positions are treated as those of arrays in
  /// host memory, with the same bits: coordinates that are large against the extent become offsets from an origin
  /// (choose_origin), and the displacements are added to them.
  ///
  /// load() returns the origin early; work given to the stream afterwards comes after the copy and may change the
  /// points. The other calls return when their results are there; `out` may be the array that was loaded. It has the
  /// type of what was loaded, or float32 after a load from host memory. A run into host memory gives points relative to
  /// the origin, and a Cloud that names it. Memory on the card beside that of a run: 24 bytes a point of doubles, 12 of
  /// floats with an origin.
  ///
  /// They throw ErrorKind::usage if the pipeline computes elsewhere than where the points lie, or if the types differ;
  /// and ErrorKind::memory for a cloud that does not fit into the card beside its results.
  std::array<double, 3> load(const DevicePoints& points, DeviceStream stream);
  void run(const Params& params, const DeviceOutput& out, DeviceStream stream, std::stop_token stop = {},
           const ProgressFunction& progress = {});
  void normals(const DeviceOutput& out, DeviceStream stream);

  /// Bounds, spacing and noise of the loaded cloud; the noise is that of set_noise() where there is one. The first call
  /// after `load` measures them, and builds the index if there is none. Valid until the next load or set_noise.
  const Estimates& estimates(std::stop_token stop = {});

  /// `params` with every `auto` replaced by the value that a run would use in a typical place, and every length in file
  /// units. A run with `auto` follows the noise from place to place, and these values do not: a run with them has
  /// another result. Measures what it needs, as estimates() does. Throws ErrorKind::usage if there is nothing to
  /// measure, as where no point is finite, all lie at one place, or too few show a surface: such values would leave
  /// other clouds as they are. A run with `auto` leaves such a cloud as it is. A cloud in zones is measured in these,
  /// by each call anew.
  Params resolve(const Params& params, std::stop_token stop = {});

  /// What the last successful run did, and with which parameters.
  const Report& report() const;

  /// The device that this pipeline runs on.
  DeviceInfo device() const;

  /// Of each point of the last successful run why it is an outlier: 0 it is none, 1 isolated, 2 off the surface, 3
  /// mixed pixel; in file order; empty without Outliers::mark. Valid until the next run.
  std::span<const std::uint8_t> outliers() const;

  /// The unit normals of the last run's last iteration, in file order; zero where there is none. They look towards the
  /// sensor where its place is known (set_viewpoint), and have arbitrary signs elsewhere and in memory of a card.
  /// `out` has as many elements as points were loaded. Throws ErrorKind::usage if the last run failed or if a cloud was
  /// loaded since, or for a cloud in zones whose coordinates around one origin step by more than its spacing: its
  /// normals are computed there (check_normals() says so before the run). O(N); of a cloud in tiles as long as an
  /// iteration.
  void normals(std::span<Point> out, std::stop_token stop = {});

  /// Throws before a run with these parameters what normals() would throw after it: ErrorKind::usage for a cloud in
  /// zones whose normals would mean nothing. Of such a cloud it measures what estimates() does, of all others nothing.
  void check_normals(const Params& params = {}, std::stop_token stop = {});

  /// The standard deviation of the noise at each point of the loaded cloud, in file units and in upload order: its
  /// level at that place, times params.noise or, where that is `auto`, times estimates().noise. NaN for an invalid
  /// point. No other parameter is read. `out` has as many elements as points were loaded, else throws ErrorKind::usage.
  /// O(N) and 12 bytes a point, besides what estimates() measures on its first call; the same bits on any device and in
  /// tiles, and of a cloud in zones what was measured in these.
  void noise(std::span<float> out, const Params& params = {}, std::stop_token stop = {});

 private:
  friend struct PipelineAccess;
  struct POINTFAIR_INTERNAL State;
  POINTFAIR_INTERNAL explicit Pipeline(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace pointfair
