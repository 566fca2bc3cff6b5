// SPDX-License-Identifier: Apache-2.0
// The CUDA backend: the seam's calls over two chains on one card. Stage calls start their work and return; the host
// waits only where data crosses. The first iteration's index is started with the upload, and where the cloud is in
// spatial order, copies, stages and download of its parts overlap (part_flow.cuh). Memory beside the chains, bytes a
// point: the uploaded points 12, and 12 from the third iteration on.
#pragma once

#include "cuda/batch_storage.cuh"
#include "cuda/chain.cuh"
#include "cuda/leaving.cuh"
#include "cuda/runtime/callers_points.cuh"
#include "cuda/runtime/devices.cuh"
#include "cuda/runtime/links.cuh"
#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/origins.cuh"
#include "cuda/runtime/stage_clock.cuh"
#include "cuda/runtime/stop.cuh"
#include "cuda/runtime/transfer.cuh"
#include "cuda/sampling/cloud_sampler.cuh"
#include "cuda/sampling/many_sampler.cuh"
#include "cuda/stages/copies.cuh"
#include "cuda/tiles/gathered_tiles.cuh"
#include "seam/backend.hpp"
#include "seam/device_memory.hpp"
#include "seam/device_tiles.hpp"
#include "seam/exactness.hpp"
#include "seam/many_clouds.hpp"
#include "seam/overlap.hpp"
#include "seam/refinement.hpp"
#include "seam/sampling.hpp"

namespace pointfair::cuda {

class CudaBackend final : public Backend,
                          public Sampling,
                          public Exactness,
                          public Overlap,
                          public DeviceMemory,
                          public DeviceTiles,
                          public ManyClouds,
                          public Refinement {
 public:
  CudaBackend(int card, const CudaOptions& options)
      : card_(card), context_(card, options.memory), points_of_chunk_(options.upload_chunk) {}

  DeviceInfo device() const override { return {Device::cuda, context_.name(), "requested"}; }

  HostBuffer host_buffer(std::size_t count) override;

  void upload(std::span<const Point> points, IndexOrder expected) override;
  void start_upload(std::span<const Point> points, IndexOrder expected) override;
  void finish_upload() override;

  // The first guess of the origin is nearly always right, so that the index begins while the host chooses it.
  Origin upload(const DevicePoints& points, DeviceStream stream, const ChooseOrigin& choose,
                IndexOrder expected) override;

  Room room() const override { return {kMostClouds, kLargestCloud, std::size_t(1) << 24}; }
  void upload(std::span<const Point> points, std::span<const Index> ends) override;
  void upload(const DevicePoints& points, DeviceStream stream, std::span<const Index> ends) override;
  std::vector<std::uint8_t> surely_have_no_origin(const DevicePoints& points, DeviceStream stream,
                                                  std::span<const Index> ends) override;

  Taken take_samples(const Queries& for_spacing, const Queries& for_noise, std::stop_token stop) override;
  void run(std::span<const Index> clouds, std::span<const FramedSettings> settings, int iterations,
           std::stop_token stop) override;
  void download(std::span<Point> points) override;
  void download(const DeviceOutput& points, DeviceStream stream) override;

  void set_aside(std::vector<Copy> copies) override;
  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token stop) override;
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) override;
  void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token stop) override;
  void fair(int iteration, const FairingSettings& settings, std::stop_token stop) override;

  OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override;
  OutlierCounts download(int iteration, const DeviceOutput& points, DeviceStream stream,
                         const DisplacementLimits& limits, std::span<std::uint8_t> outliers) override;
  void download_normals(int iteration, const DeviceOutput& normals, DeviceStream stream) override;
  void download_normals(int iteration, std::span<Point> normals, std::stop_token) override;
  void download_input(std::span<Point> points) override;

  OutlierCounts download_refined(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                                 std::span<std::uint8_t> outliers, const RefinedBy& by,
                                 const std::stop_token& stop) override;
  OutlierCounts download_refined(int iteration, const DeviceOutput& points, DeviceStream stream,
                                 const DisplacementLimits& limits, std::span<std::uint8_t> outliers,
                                 const RefinedBy& by, const std::stop_token& stop) override;
  void refine(const Classical& classical, const NetWeights& weights, const Frame& frame, std::span<Point> out,
              const std::stop_token& stop) override;

  Counts counts(int iteration) override;
  SolverReport solver_report(int iteration) override { return sum_of(solved_, iteration); }
  bool holds_whole() const override { return true; }
  Costs take_costs() override;
  std::optional<StageOf> take_stopped() override;

  Sampling& sampling() override { return *this; }
  Exactness* exactness() override { return this; }
  Overlap* overlap() override { return this; }
  DeviceMemory* device_memory() override { return this; }
  DeviceTiles* device_tiles() override { return this; }
  ManyClouds* many_clouds() override { return this; }
  Refinement* refinement() override { return this; }

  CloudSample sample_cloud(std::size_t count) override;
  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override;
  Samples take_samples(std::span<const Index> for_spacing, std::span<const Index> for_noise,
                       std::stop_token stop) override;
  Samples take_samples_by(SampleRule rule, std::span<const Index> for_noise, std::stop_token stop) override;
  void foresee_nearest(int count) override;

  void outcomes(const point::Region& loaded, std::span<unsigned char> out) override;

  void begin_tiles(int iteration) override;
  std::vector<std::size_t> gather(std::span<const DeviceTile> tiles) override;
  std::vector<std::uint32_t> gathered(std::size_t tile) override;
  std::vector<TileTally> scatter() override;
  void connect(DeviceTiles& whole) override;
  void take(DeviceTiles& whole, std::size_t tile) override;
  void give(DeviceTiles& whole, std::size_t tile) override;

 private:
  // The paper's normals and fairing as one kernel, and the share of its time that a report gives to the normals.
  static constexpr const char* kBoth = "normals and fairing";
  static constexpr double kNormalsShare = 0.6;
  static constexpr unsigned kFurtherCalls = 8;  // numbers of stage calls of further iterations, for stops
  static constexpr int kNone = -1;

  Chain& chain(int iteration);
  // The faired points of the iteration before.
  const Point* take_input_of(int iteration);

  cudaEvent_t start_stage();
  // Whether a cloud that arrives in chunks is searched while it arrives, with the borders of the chunks searched once
  // more. For a small cloud that takes longer than to wait for all of it.
  bool is_worth_searching_twice() const;
  void forget_cloud(std::size_t points);
  // Work that the context's stream gets from now on waits for all that the caller's stream has so far.
  void let_wait(DeviceStream stream);
  // Starts to read the caller's points; the event `callers_turn_` comes after the last read.
  void take(const DevicePoints& points, const Origin& origin, IndexOrder expected);
  // The first index of many clouds.
  void build_batch_index(std::span<const Index> ends);
  void begin_upload(std::span<const Point> points, IndexOrder expected, bool timed);
  void wait_for_upload() const;
  void begin_first_index(const std::optional<Frame>& frame, const Arrival* arrival, const std::stop_token& stop);
  // Copies all points to the host; the caller waits for the copy.
  void copy_out(const Point* from, std::span<Point> to);
  void wait();
  // Copies the results of stages to the host.
  void deliver();
  Samples samples_of(std::span<const Index> for_spacing, std::span<const Index> for_noise, SampleRule rule,
                     const std::stop_token& stop);
  void finish_download(Chain& from, cudaEvent_t start, int iteration);
  // While a result leaves, copies are where they were uploaded, and where the chain's results bring them.
  class ShownCopies {
   public:
    ShownCopies(CudaBackend& of, Chain& from);
    ~ShownCopies();
    ShownCopies(const ShownCopies&) = delete;
    ShownCopies& operator=(const ShownCopies&) = delete;

   private:
    CudaBackend& of_;
    Chain& from_;
  };
  void refine(Chain& from, const DisplacementLimits& limits, std::span<std::uint8_t> outliers, const RefinedBy& by,
              DeviceArray<Point>& refined, const std::stop_token& stop);

  const int card_;
  Context context_;
  StageClock clock_{context_};
  const std::size_t points_of_chunk_;  // 0: as plan_parts()
  Pinned<CloudState> fetched_{2};  // of the first iteration, and of the last
  int fetched_iteration_ = kNone;  // the last one, or kNone where these are no longer so
  CloudSampler sampler_{context_};
  Pinned<Index> queries_;
  Pinned<point::SpacingSample> spacing_samples_;
  Pinned<point::NoiseSample> noise_samples_;
  Pinned<point::ResidualSample> residual_samples_;
  Pinned<Index> pools_;
  Pinned<Point> near_;
  bool is_index_begun_ = false;    // by an upload
  bool is_arriving_ = false;       // the uploaded cloud
  cudaEvent_t arrived_ = nullptr;  // after which all of it is there
  DeviceArray<Point> uploaded_{context_};
  CopiesAside copies_{context_};  // NaN in what was uploaded, but while a result leaves
  DeviceArray<Index> ends_{context_};
  std::vector<CloudSpan> clouds_;    // of many
  std::optional<CloudBatch> batch_;  // of all of them, or of some
  BatchStorage batch_storage_{context_};
  ManySampler many_samples_{context_};
  DeviceArray<Point> limited_{context_};  // of many clouds
  DeviceArray<Point> input_{context_};    // of iterations from the third on
  GatheredTiles tiles_{context_};
  Staging staging_;
  Leaving leaving_{context_, staging_};
  CallersPoints callers_{context_};
  Event callers_turn_;  // between the caller's stream and the context's
  StopLine stop_line_{context_};
  CollectedRoom room_{context_};
  MeshOnCard mesh_{context_};
  Chain first_{context_, room_, mesh_, stop_line_, 0}, further_{context_, room_, mesh_, stop_line_, kFurtherCalls};
  int further_iteration_ = 0;         // whose results further_ holds; 0: none
  std::vector<SolverReport> solved_;  // of each iteration
  Upload upload_{context_, staging_};
  Links links_{context_};  // of cards that share clouds with this one
};

}  // namespace pointfair::cuda
