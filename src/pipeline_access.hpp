// SPDX-License-Identifier: Apache-2.0
// For tests: a pipeline on a backend of one's own.
#pragma once

#include <memory>

#include "backend.hpp"
#include "pointfair/pipeline.hpp"

namespace pointfair {

struct PipelineAccess {
  static Pipeline make(std::unique_ptr<Backend> backend, DeviceInfo device);
};

}  // namespace pointfair
