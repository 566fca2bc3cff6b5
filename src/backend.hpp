// SPDX-License-Identifier: Apache-2.0
// The seam between the pipeline and a device: one call per stage, plus upload and download. Each backend owns its
// arrays; data crosses only in upload, download and the small sampling calls.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "point/region.h"
#include "point/sample.h"
#include "pointfair/cloud.hpp"
#include "pointfair/params.hpp"
#include "pointfair/pipeline.hpp"

namespace pointfair {

// What each stage reads: Params with every `auto` resolved and every length in file units.
struct NeighborSettings {
  int k = 0;         // 0: no list, everything within `radius` is summed directly
  float radius = 0;  // 0: no limit
  bool constraint = false;
  float reach = 0;   // rho + delta
  int widening = 0;  // without a list: squared radii grow by the squared distance to this many nearest; 0: not at all
  friend bool operator==(const NeighborSettings&, const NeighborSettings&) = default;
};
struct NormalSettings {
  bool weighted = true;
  float sigma = 0;
  bool of_radius = false;  // sigma is a multiple of the point's radius; only without a list
  int filter_rounds = 0;
  int filter_angle = 0;   // degrees; 0: a plain Gaussian mean
  float flat_radius = 1;  // what multiplies the radius of a ball, for the bilateral step, where the surface is flat
  friend bool operator==(const NormalSettings&, const NormalSettings&) = default;
};
struct FairingSettings {
  Method method = Method::bilateral;  // the others are put together in method_rule.hpp
  AreaWeight area_weight = AreaWeight::none;
  float closeness_sigma = 0;
  float similarity_sigma = 0;
  bool closeness_of_radius = false;  // as in NormalSettings
  bool two_planes = false;           // Eq. 10 instead of the paper's step
  int facing_angle = 0;              // degrees, of Eq. 10; 0: normals do not weigh
  float strength = 1;                // share of the displacement that is made
  float outlier_distance = 0;        // from its neighbours, to be an outlier (src/point/outliers.h); 0: not looked for
  float outlier_radius = std::numeric_limits<float>::infinity();  // in wider balls strays may have only each other
  bool pull_outliers = false;  // in to the mean of their neighbours; else they become NaN
  friend bool operator==(const FairingSettings&, const FairingSettings&) = default;
};

// The cube over which the curve of sums over balls is laid (src/point/curve.h).
struct CurveCube {
  Point origin{};
  float side = 0;
  friend bool operator==(const CurveCube& a, const CurveCube& b) {
    return a.origin.x == b.origin.x && a.origin.y == b.origin.y && a.origin.z == b.origin.z && a.side == b.side;
  }
};

struct Bounds {
  Point min{}, max{};       // of the valid points; zero if there is none
  std::uint64_t valid = 0;  // points that are indexed: finite, and small enough to be squared
};

// Of the whole way from upload; none if `farthest` is 0.
struct DisplacementLimits {
  float farthest = 0;          // a point moves no farther,
  float outlier_distance = 0;  // and one that would move farther than this, or became NaN, keeps its place
};

struct Counts {
  UnmovedCounts unmoved;
  std::uint64_t short_neighborhoods = 0;
};

// What samples of a cloud say, each in the order of its queries.
struct Samples {
  std::vector<point::SpacingSample> spacing;
  std::vector<point::NoiseSample> noise;
  // Of the queries for noise, which not every estimate needs. To be called while the backend lives.
  std::function<std::vector<point::ResidualSample>()> residuals;
};

// A backend holds up to two chains of stage results: that of the first pass, which stays cached for later runs, and
// that of the pass at work. begin_pass(0) makes the first current and keeps what it holds; begin_pass(p > 0) empties
// the second and gives it the faired points of the pass before. The stage calls work on the current chain, in order.
// Calls throw Error(interrupted) once `stop` is triggered and leave the stage to be run again. Where calls only start
// their work, a later one may find that it was given up, and throws; take_stopped() then says what else must run again.
class Backend {
 public:
  virtual ~Backend() = default;
  virtual DeviceInfo device() const = 0;

  virtual HostBuffer host_buffer(std::size_t count) {
    return {new Point[count], count, [](Point* points) noexcept { delete[] points; }};
  }
  virtual void upload(std::span<const Point> points) = 0;
  // The same, but `points` must stay as they are until finish_upload(), and stages may be called before. Returns
  // whether it goes on meanwhile; stage_times() then tells how long it took.
  virtual bool start_upload(std::span<const Point> points) {
    upload(points);
    return false;
  }
  virtual void finish_upload() {}
  // After an upload of points of a larger cloud: the index there of each of them, ascending. Balls are thinned by it.
  virtual void set_originals(std::span<const std::uint32_t> /*originals*/) {}
  virtual void begin_pass(int pass) = 0;
  // Indexes that are built from now on, also while points arrive, hold the points in one order whatever the device,
  // given by this cube and the points alone; without a cube in the order that the device builds fastest. Results over
  // lists do not depend on it; those over balls do, by rounding.
  virtual void order_along(std::optional<CurveCube> cube) = 0;
  virtual void build_index(std::stop_token stop) = 0;
  virtual void find_neighbors(const NeighborSettings& settings, std::stop_token stop) = 0;
  virtual void estimate_normals(const NormalSettings& settings, std::stop_token stop) = 0;
  virtual void fair(const FairingSettings& settings, std::stop_token stop) = 0;
  // The points of the next fair() are downloaded at once: they may be faired in the order in which they leave.
  virtual void expect_download() {}
  // Waits for stage calls that only started their work, as a card's do.
  virtual void finish() {}
  // After Error(interrupted): whether work was given up whose call had returned; the first such stage of the first
  // pass, `passes` if only further passes had such.
  virtual std::optional<Stage> take_stopped() { return std::nullopt; }
  // Where stage calls only start their work: how long those since the last call took, by the device's own clock, in
  // the order of their first; waits for them. Empty where a stage is done when its call returns.
  virtual std::vector<StageTime> stage_times() { return {}; }
  // Faired points of the current pass, in upload order. Returns how many outliers `limits` held back; `outliers`,
  // unless empty, gets 1 for each of them and 0 for others.
  virtual std::uint64_t download(std::span<Point> points, const DisplacementLimits& limits,
                                 std::span<std::uint8_t> outliers) = 0;
  virtual void download_normals(std::span<Point> normals) = 0;

  // Of the current chain, after build_index.
  virtual Bounds bounds() const = 0;
  // For each of `queries` (indices in upload order): the query itself, then its k nearest other points, nearest first,
  // row after row of k + 1; rows of invalid queries, and places past the last point, are NaN. k up to 1024.
  virtual void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) = 0;
  // What such rows say (point/sample.h), at queries for the spacing and at queries for the noise. Here by fits on the
  // host's cores (src/samples.cpp), the same bits wherever else.
  virtual Samples take_samples(std::span<const std::uint32_t> for_spacing, std::span<const std::uint32_t> for_noise,
                               std::stop_token stop);
  // Calls body(i) for each i below count on the host's cores, as many at once as this backend may use.
  virtual void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body);

  // Of the current chain, after fair, where all that was uploaded are the points of a larger cloud in `loaded`: an
  // Outcome a point, in upload order; invalid points have none. Not offered by every backend.
  virtual void outcomes(const point::Region& loaded, std::span<unsigned char> out);
  // What was uploaded.
  virtual void download_input(std::span<Point> points);

  // How many pieces the cloud is cut into.
  virtual std::uint64_t pieces() const { return 1; }
  // Takes no more device memory than this from now on, as if the device had no more.
  virtual void limit_memory(std::uint64_t /*bytes*/) {}

  virtual Counts counts() const = 0;                  // of the current chain, after fair
  virtual std::uint64_t peak_host_bytes() const = 0;  // since upload
  virtual std::uint64_t peak_device_bytes() const = 0;
};

std::unique_ptr<Backend> make_cpu_backend(unsigned threads);

// Cuts each cloud into at least so many pieces with exact halos (src/stream.cpp), and computes as many at once as there
// are `workers`, which are backends of one device. No more than `most_points` are uploaded to one of them.
struct Cutting {
  std::uint64_t pieces = 2;
  std::uint64_t most_points = ~std::uint64_t{0};
  double first_halo = 1;  // of the width that is thought to suffice
};
std::unique_ptr<Backend> make_cut_backend(std::vector<std::unique_ptr<Backend>> workers, Cutting cutting);

// src/cuda, or src/cuda_absent.cpp in a build without CUDA. `make_cuda_backend` throws Error(device) with the reason.
// `part`: points of each part of an upload, 1,024 or a multiple of that; 0: as suits the cloud. It changes no result.
std::unique_ptr<Backend> make_cuda_backend(int card, std::size_t part = 0);
std::vector<DeviceStatus> list_cuda_devices();
DeviceStatus cpu_status();

}  // namespace pointfair
