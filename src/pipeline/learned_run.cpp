// SPDX-License-Identifier: Apache-2.0
#include "pipeline/learned_run.hpp"

#include <limits>
#include <memory>
#include <string_view>
#include <vector>

#include "pipeline/run_state.hpp"
#include "seam/noise_levels.hpp"
#include "seam/refinement.hpp"
#include "seam/sampling.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kBlock = 1 << 14;  // points that one core takes at once
constexpr float kNoPlace = std::numeric_limits<float>::quiet_NaN();
constexpr std::string_view kNet = "net";
constexpr double kShareOfStages = 0.3;  // of a run's progress; the rest is the net's

// What the stages before the net are told with.
ProgressFunction first_part(const ProgressFunction& progress) {
  if (!progress) return {};
  return [&progress](double share, std::string_view stage) { progress(kShareOfStages * share, stage); };
}

// Tells threads apart, also where there are no others.
const void* this_thread() {
  static thread_local char its_own;
  return &its_own;
}

// The net's, on this thread alone, whoever works for it.
NetProgress of_net(const ProgressFunction& progress) {
  if (!progress) return {};
  return [&progress, caller = this_thread()](double share) {
    if (this_thread() == caller) progress(kShareOfStages + (1 - kShareOfStages) * share, kNet);
  };
}

// The whole way of a point is limited as that of any method. Outliers were found before.
void limit(std::span<const Point> measured, const DisplacementLimits& limits, Sampling& by, std::span<Point> out) {
  if (!(limits.farthest > 0)) return;
  DisplacementLimits its = limits;
  its.outlier_distance = kUnbounded;
  by.for_each_on_host((out.size() + kBlock - 1) / kBlock, [&](std::size_t block) {
    for (std::size_t i = block * kBlock; i < std::min(out.size(), (block + 1) * kBlock); ++i) {
      if (!is_indexed(measured[i]) || !is_indexed(out[i])) continue;
      const point::Vec3<float> from = to_vec3(measured[i]);
      const float level = noise_level_at(limits.levels.get(), measured[i]);
      const point::Vec3<float> place = point::limited(from, to_vec3(out[i]), its, level).place;
      out[i] = {place.x, place.y, place.z};
    }
  });
}

// Where several cards compute a cloud, or one in tiles, all of it may still fit into one beside the net. False where
// there is no card or it has too little memory.
bool refine_on_card(const LoadedCloud& cloud, const Classical& classical, const NetWeights& weights, const Frame& frame,
                    std::span<Point> out, const std::stop_token& stop) {
  const std::unique_ptr<Backend> card = cloud.make_worker();
  Refinement* const refinement = card ? card->refinement() : nullptr;
  if (refinement == nullptr) return false;
  try {
    refinement->refine(classical, weights, frame, out, stop);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::memory) throw;
    return false;
  }
  return true;
}

}  // namespace

// 0: nothing to refine by.
double Pipeline::State::noise_to_refine_by(const Params& used) const {
  const double given = used.noise.value, sigma = given > 0 ? given : noise().sigma;
  return sigma > 0 ? sigma : 0;
}

void Pipeline::State::run_learned(const Params& params, const Delivery& to, const std::stop_token& stop,
                                  const ProgressFunction& progress) {
  shown_.reset();
  check_params(params);
  attempt([&] { measure({false, true}, IndexOrder::along_curve, stop); });
  run(of_stages(params), to, stop, first_part(progress));
  if (progress) progress(1, kNet);
  report.params.method = params.method;
}

void Pipeline::State::run_learned(const Params& params, std::span<Point> out, const std::stop_token& stop,
                                  const ProgressFunction& progress) {
  const auto deliver = [&](int iteration, const Params& used, const DisplacementLimits& limits,
                           std::span<std::uint8_t> marks) {
    const double sigma = noise_to_refine_by(used);
    Refinement* const on_device = sigma > 0 ? cloud.backend().refinement() : nullptr;
    if (on_device == nullptr) return refine_outside(iteration, sigma, out, limits, marks, stop, of_net(progress));
    const std::shared_ptr<const NetWeights> weights = weights_ ? weights_ : own_net_weights();
    if (progress) of_net(progress)(0);
    return on_device->download_refined(iteration, out, limits, marks, {*weights, frame(), float(sigma), levels()},
                                       stop);
  };
  run_learned(params, {out.size(), deliver}, stop, progress);
}

void Pipeline::State::run_learned(const Params& params, const DeviceOutput& out, DeviceStream stream,
                                  const std::stop_token& stop, const ProgressFunction& progress) {
  const auto deliver = [&](int iteration, const Params& used, const DisplacementLimits& limits,
                           std::span<std::uint8_t> marks) {
    const double sigma = noise_to_refine_by(used);
    DeviceMemory& memory = device_memory();
    Refinement* const on_device = cloud.backend().refinement();
    if (!(sigma > 0)) return memory.download(iteration, out, stream, limits, marks);
    if (on_device == nullptr)
      throw Error(ErrorKind::usage,
                  "--method learned refines a cloud that several cards share on the host's cores: give an output in "
                  "host memory, or another method");
    const std::shared_ptr<const NetWeights> weights = weights_ ? weights_ : own_net_weights();
    if (progress) of_net(progress)(0);
    return on_device->download_refined(iteration, out, stream, limits, marks,
                                       {*weights, frame(), float(sigma), levels()}, stop);
  };
  run_learned(params, {out.count, deliver}, stop, progress);
}

OutlierCounts Pipeline::State::refine_outside(int iteration, double sigma, std::span<Point> out,
                                              const DisplacementLimits& limits, std::span<std::uint8_t> marks,
                                              const std::stop_token& stop, const NetProgress& progress) {
  Backend& backend = cloud.backend();
  std::vector<std::uint8_t> held(out.size());
  const OutlierCounts counts = timed("download", [&] { return backend.download(iteration, out, limits, held); });
  if (!marks.empty()) std::ranges::copy(held, marks.begin());
  if (!(sigma > 0)) return counts;
  return timed(kNet, [&] {
    if (progress) progress(0);
    std::vector<Point> measured(out.size()), normals(out.size());
    std::vector<float> noise(out.size());
    backend.download_input(measured);
    backend.download_normals(iteration, normals, stop);
    Sampling& sampling = backend.sampling();
    for (const Copy& copy : cloud.copies_aside())  // the net sees none
      measured[copy.point] = out[copy.point] = {kNoPlace, kNoPlace, kNoPlace};
    tell_noise(measured, sigma, levels().get(), noise);
    const Frame its = frame();
    const std::shared_ptr<const NetWeights> weights = weights_ ? weights_ : own_net_weights();
    const Classical classical{measured, out, normals, noise, held};
    if (!refine_on_card(cloud, classical, *weights, its, out, stop))
      sampling.for_each_on_host(1, [&](std::size_t) { refine(classical, *weights, its, out, stop, progress); });
    for (const Copy& copy : cloud.copies_aside()) {
      measured[copy.point] = copy.place;
      out[copy.point] = held[copy.point] || held[copy.first] ? copy.place : out[copy.first];
    }
    limit(measured, limits, sampling, out);
    return counts;
  });
}

}  // namespace pointfair
