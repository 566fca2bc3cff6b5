// SPDX-License-Identifier: Apache-2.0
// What a pipeline does with its loaded cloud: it measures, plans, and executes the plan.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "estimate/automatic.hpp"
#include "estimate/given_noise.hpp"
#include "estimate/sensor.hpp"
#include "mesh/loaded_mesh.hpp"
#include "pipeline/loaded_cloud.hpp"
#include "pipeline/stage_log.hpp"
#include "pointfair/pipeline.hpp"
#include "seam/net_weights.hpp"
#include "seam/refinement.hpp"

namespace pointfair {
namespace scale {
class WideCloud;
}

struct Pipeline::State {
  State(std::unique_ptr<Backend> backend, DeviceInfo its_device, MakeWorkers workers)
      : cloud(std::move(backend), std::move(workers)), device(std::move(its_device)) {}

  void load(std::span<const Point> points);
  void load(const DevicePoints& points, DeviceStream stream);
  void run(const Params& params, std::span<Point> out, const std::stop_token& stop, const ProgressFunction& progress);
  void run(const Params& params, const DeviceOutput& out, DeviceStream stream, const std::stop_token& stop,
           const ProgressFunction& progress);
  void load_and_run(std::span<const Point> points, const Params& params, std::span<Point> out,
                    const std::stop_token& stop, const ProgressFunction& progress);
  void run_many(std::span<const Point> points, std::span<const std::uint64_t> offsets, const Params& params,
                std::span<Point> out, const std::stop_token& stop);
  void run_many(const DevicePoints& points, DeviceStream stream, std::span<const std::uint64_t> offsets,
                const Params& params, const DeviceOutput& out, const std::stop_token& stop);
  bool runs_together(const Params& params);
  Params resolve(const Params& params, const std::stop_token& stop);
  void measure_all(const std::stop_token& stop);
  void tell(const Estimate& found, const Bounds& bounds, double float_step);  // as estimates
  void normals(std::span<Point> out, const std::stop_token& stop);
  void normals(const DeviceOutput& out, DeviceStream stream);
  void set_noise(std::span<const float> sigmas);
  void set_viewpoint(std::span<const Origin> places);
  void set_faces(Polygons faces);
  void set_weights(std::shared_ptr<const NetWeights> weights) { weights_ = std::move(weights); }
  void noise(std::span<float> out, const Length& typical, const std::stop_token& stop);

  LoadedCloud cloud;
  DeviceInfo device;
  Cloud shell;  // the loaded cloud without its points
  Report report;
  std::vector<std::uint8_t> outliers;  // of the last run, if they are to be marked
  std::optional<Estimates> estimates;  // as they were told
  FollowedNoise followed;              // in the last run

  // Of a cloud that needs zones (facade/zones_of_pipeline.cpp). All else of this state has it around one origin.
  void find_zones(const Cloud& loaded);
  bool runs_in_zones(const Params& params) const;
  Cloud run_in_zones(const Params& params, const std::stop_token& stop, const ProgressFunction& progress);
  void measure_in_zones(const std::stop_token& stop);
  Params resolve_in_zones(const Params& params, const std::stop_token& stop);
  void check_normals_in_zones(const std::stop_token& stop);
  std::optional<Estimate> of_zones;                   // what that found; as long as `estimates`
  void run_for_normals(const std::stop_token& stop);  // around one origin, if the last run was in zones
  std::shared_ptr<scale::WideCloud> wide;             // null: it needs none
  std::vector<Origin> wide_viewpoints;
  MakeBackend make_backend_of_zones;  // null: all clouds lie around one origin
  std::optional<Params> wide_run;     // the last run, if it was in zones and its normals were not asked for

 private:
  // Where the result of an iteration goes; as Backend::download.
  struct Delivery {
    std::size_t room;  // points
    // `used`: the parameters of the run, resolved. Notes its times.
    std::function<OutlierCounts(int iteration, const Params& used, const DisplacementLimits&,
                                std::span<std::uint8_t> outliers)>
        deliver;
    std::span<Point> on_host{};  // where it goes, if it goes there
  };

  void start_load(const std::function<void()>& load);
  void go_where_it_runs(const Params& params);
  DeviceInfo device_of_cloud();
  Resolved resolve_once(const Params& params, const std::stop_token& stop);
  void refuse_unmeasured(const Params& params, const Estimate& found, std::uint64_t finite) const;
  void run(const Params& params, const Delivery& to, const std::stop_token& stop, const ProgressFunction& progress);
  void run_learned(const Params& params, std::span<Point> out, const std::stop_token& stop,
                   const ProgressFunction& progress);
  void run_learned(const Params& params, const DeviceOutput& out, DeviceStream stream, const std::stop_token& stop,
                   const ProgressFunction& progress);
  void run_learned(const Params& params, const Delivery& to, const std::stop_token& stop,
                   const ProgressFunction& progress);
  double noise_to_refine_by(const Params& used) const;
  OutlierCounts refine_outside(int iteration, double sigma, std::span<Point> out, const DisplacementLimits& limits,
                               std::span<std::uint8_t> marks, const std::stop_token& stop, const NetProgress& progress);
  void tell_noise(std::span<const Point> points, double sigma, const NoiseLevels* levels, std::span<float> out);
  void run_to_end(const Params& params, const Delivery& to, const std::stop_token& stop,
                  const ProgressFunction& progress);
  // Clouds from `first` to before `end` that are computed together, or one that is computed alone.
  struct Group {
    std::size_t first, end;
    bool together;
  };
  // Returns clouds that must be computed alone nevertheless, and that lie in the output as they were given.
  using RunTogether = std::function<std::vector<std::size_t>(Backend&, HostBuffer&, const Group&)>;
  using RunAlone = std::function<void(std::size_t cloud, bool is_in_output)>;
  std::vector<Group> group(std::span<const std::uint64_t> offsets, std::size_t at_once,
                           const std::function<bool(std::size_t)>& may_join);
  void run_groups(const std::vector<Group>& groups, std::size_t workers, const RunTogether& run_together,
                  const RunAlone& run_alone);
  static void run_stages_of_all(Backend& backend, const Params& used, const std::stop_token& stop);
  int shown(std::size_t room, const std::stop_token& stop);
  DeviceMemory& device_memory();
  void attempt(const std::function<void()>& work);
  const CloudSample& sample();
  const CloudSample& seen_sample();  // of what stages see
  bool has_copies() const { return cloud.copies && cloud.copies->within >= 0; }
  void set_aside(Aside which);
  std::optional<Spacing>& spacing(bool with_noise);
  const Frame& frame();
  const LoadedMesh& mesh();
  double sigma_of(const Params& used);
  platform::LargeVector<double> noise_of_vertices(const Params& used);
  MeshReport finish_mesh(const Params& used, std::span<Point> out);
  void count_seams_on_boundary(UnmovedCounts& unmoved);
  double in_file_units(const Length& length, IndexOrder order, const std::stop_token& stop);
  Params with_mesh_values(const Params& params, IndexOrder order, const std::stop_token& stop);
  void set_seams_aside(const Params& used);
  void set_copies_aside(const Params& params, const std::stop_token& stop);
  void follow_mesh(const Params& used, Settings& settings);
  KnownSensor known_sensor(const Params& used, const std::stop_token& stop);
  Noise noise() const;
  const std::shared_ptr<const NoiseLevels>& levels() const;
  void look_at_neighbors(IndexOrder order, const std::stop_token& stop, const std::function<void(Sampling&)>& estimate);
  void measure(WantedEstimates wanted, IndexOrder order, const std::stop_token& stop);
  void execute(const std::vector<Step>& steps, std::size_t all, const std::stop_token& stop,
               const ProgressFunction& progress);
  void drop_times_of_failed_run();
  template <class Work>
  auto timed(std::string_view name, const Work& work) {
    const auto start = Clock::now();
    const auto result = work();
    log_.note_call(name, milliseconds_since(start));
    return result;
  }
  void run_stage(const Step& step, const std::stop_token& stop);
  OutlierCounts count_outliers(FairingSettings fairing, const std::stop_token& stop);

  struct Helper {
    std::unique_ptr<Backend> backend;
    HostBuffer staged;
  };
  std::shared_ptr<const NetWeights> weights_;            // of method learned; null: the program's own
  HostBuffer staged_;                                    // many clouds on their way
  std::vector<Helper> helpers_;                          // beside the loaded cloud's backend, for many clouds
  std::optional<Frame> frame_;                           // of the loaded cloud, once it is needed
  std::optional<GivenNoise> given_noise_;                // of the loaded cloud, in place of what is measured
  std::optional<Polygons> faces_;                        // of the loaded cloud, in place of its file's
  std::shared_ptr<const LoadedMesh> mesh_;               // of those, once it is needed
  std::shared_ptr<const SensorPlaces> sensors_;          // of the loaded cloud, as it was given; null: unknown
  bool seeks_sensor_ = true;                             // by the distances between points
  std::optional<std::vector<BeamSample>> beam_samples_;  // of those, once they are measured
  // The last run: the iteration whose results were delivered, and what has them held again if they are not any more.
  struct Shown {
    int iteration;
    Wanted wanted;
    Aside aside;
  };
  std::optional<Shown> shown_;
  OutlierCounts pulled_;                         // by the first iteration that is cached
  IndexOrder last_order_ = IndexOrder::fastest;  // of the run before, which the next is likely to be like
  double upload_milliseconds_ = 0;               // not yet reported
  bool upload_times_itself_ = false;             // the costs tell how long it took
  StageLog log_;
  bool unfinished_ = false;  // a run began and did not end: the backend may hold times of its stages
};

}  // namespace pointfair
