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
#include "pipeline/loaded_cloud.hpp"
#include "pipeline/stage_log.hpp"
#include "pointfair/pipeline.hpp"

namespace pointfair {

struct Pipeline::State {
  State(std::unique_ptr<Backend> backend, DeviceInfo its_device, MakeBackend make_worker)
      : cloud(std::move(backend), std::move(make_worker)), device(std::move(its_device)) {}

  void load(std::span<const Point> points);
  void run(const Params& params, std::span<Point> out, const std::stop_token& stop, const ProgressFunction& progress);
  void load_and_run(std::span<const Point> points, const Params& params, std::span<Point> out,
                    const std::stop_token& stop, const ProgressFunction& progress);
  Params resolve(const Params& params, const std::stop_token& stop);
  void measure_all(const std::stop_token& stop);
  void normals(std::span<Point> out, const std::stop_token& stop);
  void set_noise(std::span<const float> sigmas);
  void noise(std::span<float> out, const Length& typical, const std::stop_token& stop);

  LoadedCloud cloud;
  DeviceInfo device;
  Cloud shell;  // the loaded cloud without its points
  Report report;
  std::vector<std::uint8_t> outliers;  // of the last run, if they are to be marked
  std::optional<Estimates> estimates;  // as they were told
  FollowedNoise followed;              // in the last run

 private:
  void start_load(std::span<const Point> points, IndexOrder expected, bool overlapped);
  Params resolve_once(const Params& params, const std::stop_token& stop);
  void run_to_end(const Params& params, std::span<Point> out, const std::stop_token& stop,
                  const ProgressFunction& progress);
  void attempt(const std::function<void()>& work);
  const CloudSample& sample();
  const Frame& frame();
  Noise noise() const;
  const std::shared_ptr<const NoiseLevels>& levels() const;
  void measure(bool with_spacing, bool with_noise, IndexOrder order, const std::stop_token& stop);
  void execute(const std::vector<Step>& steps, std::size_t all, bool leaves, const std::stop_token& stop,
               const ProgressFunction& progress);
  void drop_times_of_failed_run();
  void run_stage(const Step& step, bool leaves, const std::stop_token& stop);

  std::optional<Frame> frame_;                   // of the loaded cloud, once it is needed
  std::optional<GivenNoise> given_noise_;        // of the loaded cloud, in place of what is measured
  std::optional<int> shown_;                     // the iteration whose results were delivered last, while they are held
  IndexOrder last_order_ = IndexOrder::fastest;  // of the run before, which the next is likely to be like
  double upload_milliseconds_ = 0;               // not yet reported
  bool upload_times_itself_ = false;             // the costs tell how long it took
  StageLog log_;
  bool unfinished_ = false;  // a run began and did not end: the backend may hold times of its stages
};

}  // namespace pointfair
