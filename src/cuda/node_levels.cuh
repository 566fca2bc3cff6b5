// SPDX-License-Identifier: Apache-2.0
// Levels of a length from place to place, in the card's memory.
#pragma once

#include <memory>

#include "cuda/runtime/memory.cuh"
#include "seam/noise_levels.hpp"

namespace pointfair::cuda {

class NodeLevelsOnCard {
 public:
  explicit NodeLevelsOnCard(Context& context) : nodes_(context) {}

  // Uploads the nodes unless they are those of the call before; null: 1 everywhere.
  point::NodeField of(const std::shared_ptr<const NodeLevels>& levels) {
    if (!levels) return {};
    if (levels != levels_) {
      levels_.reset();  // if memory is short
      nodes_.upload(levels->levels, "uploading levels");
      levels_ = levels;
    }
    point::NodeField field = field_of(levels.get());
    field.values = nodes_.data();
    return field;
  }

 private:
  std::shared_ptr<const NodeLevels> levels_;  // whose nodes are in
  DeviceArray<float> nodes_;
};

}  // namespace pointfair::cuda
