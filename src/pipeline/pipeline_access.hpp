// SPDX-License-Identifier: Apache-2.0
// For tests: a pipeline on a backend of one's own, and what it followed.
#pragma once

#include "estimate/automatic.hpp"
#include "pipeline/loaded_cloud.hpp"
#include "pointfair/pipeline.hpp"

namespace pointfair {

struct PipelineAccess {
  static Pipeline make(std::unique_ptr<Backend> backend, DeviceInfo device, MakeWorkers workers = {});
  // What followed the noise in the last run.
  static const FollowedNoise& followed_noise(const Pipeline& pipeline);
};

}  // namespace pointfair
