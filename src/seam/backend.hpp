// SPDX-License-Identifier: Apache-2.0
// The seam between the pipeline and a device: one call per stage, plus upload and download. Each backend owns its
// arrays; data crosses only in upload, download and the small calls of Sampling.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/device.hpp"
#include "pointfair/report.hpp"
#include "seam/copies.hpp"
#include "seam/settings.hpp"

namespace pointfair {

class DeviceMemory;
class DeviceTiles;
class Exactness;
class ManyClouds;
class Overlap;
class Refinement;
class Sampling;

// How an index holds its points. Results over lists do not depend on it.
enum class IndexOrder : std::uint8_t {
  fastest,      // as the device builds it fastest
  along_curve,  // along the curve of a frame (src/point/curve.h), the same on every device. Rounding depends on the
                // order of a sum, so sums over radius neighbourhoods run in this one
};

struct Counts {
  UnmovedCounts unmoved;  // without outliers, which download() counts
  std::uint64_t short_neighborhoods = 0;
  std::uint64_t copies = 0;  // that are set aside
  OutlierCounts pulled{};    // of tiles only
};

// A stage of one iteration; iterations count from 0.
struct StageOf {
  int iteration;
  Stage stage;
  friend bool operator==(const StageOf&, const StageOf&) = default;
};

// What a backend spent.
struct Costs {
  std::vector<StageTime> stages;                             // since the last call
  std::uint64_t peak_host_bytes = 0, peak_device_bytes = 0;  // since the upload
  std::uint64_t tiles = 1;
};

// A backend holds the results of the first iteration and those of one further iteration. A call works on what its
// arguments name and on nothing else: build_index(0) reads what was uploaded, build_index(i) the faired points of
// iteration i - 1 and takes the place of its results if i > 1; a stage reads the results of the stages before it in its
// own iteration. Calls that name results which are not held throw Error(failed).
//
// Calls throw Error(interrupted) once `stop` is triggered; the stage must then run again. Where calls only start their
// work, as a card's do, a later call may find that it was given up, and throws; take_stopped() says what else must run
// again. Any call may throw Error(memory) or std::bad_alloc; what is held of the iteration it works on is then what the
// stages before it left.
class Backend {
 public:
  virtual ~Backend() = default;
  virtual DeviceInfo device() const = 0;
  virtual HostBuffer host_buffer(std::size_t count);

  // Drops all results. `expected` is the order of the index that will be asked for first: a device may begin it
  // meanwhile.
  virtual void upload(std::span<const Point> points, IndexOrder expected) = 0;
  // From now on, until the next upload, no stage sees these points, and they get the results of those that they are
  // copies of, which are brought together with them. Empty: all are seen. Drops all results.
  virtual void set_aside(std::vector<Copy> copies) = 0;
  // Along the curve of `frame`, or in the fastest order without one.
  virtual void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token stop) = 0;
  virtual void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) = 0;
  virtual void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token stop) = 0;
  virtual void fair(int iteration, const FairingSettings& settings, std::stop_token stop) = 0;

  // Faired points in upload order. Returns how many outliers were held back; `outliers`, unless empty, gets the reason
  // of them and 0 for others.
  virtual OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                                 std::span<std::uint8_t> outliers) = 0;
  // Unit normals in upload order, zero where there is none. Waits for stages.
  virtual void download_normals(int iteration, std::span<Point> normals, std::stop_token stop) = 0;
  // What was uploaded.
  virtual void download_input(std::span<Point> points) = 0;
  // After fairing. Waits for stages.
  virtual Counts counts(int iteration) = 0;
  // Of Method::implicit, of all iterations up to that one.
  virtual SolverReport solver_report(int) { return {}; }
  // Waits for stages whose times are the device's own. Empty stages: they are done when their calls return.
  virtual Costs take_costs() = 0;
  // After Error(interrupted): the first stage that was given up after its call had returned, if any.
  virtual std::optional<StageOf> take_stopped() { return std::nullopt; }

  // Whether its stages see all points at once, as along a mesh (NeighborSettings::mesh, FairingSettings::kept_boundary)
  // and for Method::implicit.
  virtual bool holds_whole() const { return false; }
  // Whether it reads NormalSettings::faces and FairingSettings::faces.
  virtual bool reads_faces() const { return false; }

  virtual Sampling& sampling() = 0;
  virtual Exactness* exactness() { return nullptr; }         // null: cannot compute tiles
  virtual Overlap* overlap() { return nullptr; }             // null: copies nothing while it computes
  virtual ManyClouds* many_clouds() { return nullptr; }      // null: one cloud at a time
  virtual DeviceMemory* device_memory() { return nullptr; }  // null: clouds cross from host memory
  virtual DeviceTiles* device_tiles() { return nullptr; }    // null: shares no cloud that lies on it
  virtual Refinement* refinement() { return nullptr; }       // null: results are refined on the host's cores
};

// All stages of an iteration; `settings.fairing` is of that iteration.
void run_stages(Backend& backend, int iteration, const FramedSettings& settings, const std::stop_token& stop);

std::unique_ptr<Backend> make_cpu_backend(unsigned threads);
DeviceStatus cpu_status();

// For tests. Neither changes a result.
struct CudaOptions {
  std::size_t upload_chunk = 0;  // points that are copied at once, 1,024 or a multiple; 0: as suits the cloud
  std::uint64_t memory = std::numeric_limits<std::uint64_t>::max();  // bytes of the card that are used at most
};
// src/cuda, or seam/cuda_absent.cpp in a build without CUDA. `make_cuda_backend` throws Error(device) with the reason.
std::unique_ptr<Backend> make_cuda_backend(int card, const CudaOptions& options = {});
std::vector<DeviceStatus> list_cuda_devices();

}  // namespace pointfair
