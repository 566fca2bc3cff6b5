// SPDX-License-Identifier: Apache-2.0
// The second step: what the whole cloud shows, measured once and frozen, from which every task makes the same settings.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>

#include "estimate/estimate.hpp"
#include "estimate/given_noise.hpp"
#include "pipeline/stage_settings.hpp"
#include "scale/plan.hpp"
#include "scale/stored_cloud.hpp"
#include "seam/backend.hpp"

namespace pointfair::scale {

struct Measured {
  Position origin{};  ///< what places of the sample, and with them the levels, are relative to
  Bounds bounds;
  Frame frame;        ///< zero where sums run over lists
  Estimate estimate;  ///< zero where no parameter follows from it; the sensor's place is the plan's, or was found
  CopyRule copies{};  ///< of points that are set aside
  std::uint64_t ignored = 0;  ///< finite points that were left out
};

/// Measures what the parameters of the plan follow from, as a pipeline does with the whole cloud. `given`: the noise,
/// in place of what is measured.
Measured measure(const StoredCloud& cloud, const Plan& plan, const std::optional<GivenNoise>& given, Backend& backend,
                 const std::stop_token& stop);

void save(const Measured& measured, const std::filesystem::path& path);
Measured load_measured(const std::filesystem::path& path);

/// The parameters with what was measured, and what every iteration reads.
struct RunSettings {
  Params params;
  Settings settings;
  double without_surface = 0;  ///< as in FollowedNoise
};
RunSettings resolve(const Plan& plan, const Measured& measured);

}  // namespace pointfair::scale
