// SPDX-License-Identifier: Apache-2.0
// What is fixed by a cloud of a batch (src/cuda/index/cloud_batch.cuh), where clouds differ in it: its curve and what
// its stages read.
#pragma once

#include "point/curve.h"
#include "point/neighborhoods.h"
#include "point/node_field.h"
#include "point/settings.h"

namespace pointfair::cuda {

using point::Index;
using Vec = point::Vec3<float>;

struct CloudSettings {
  point::CurveCube cube;
  Vec corner;  // positions are hashed relative to it
  float squared_base, squared_widest;
  int min_neighbors;
  point::NodeField noise_levels, reach_levels;  // nodes on the card
  point::NormalSettings normals;
  point::FairingSettings fairing;  // of the first iteration
  point::DisplacementLimits limits;
};

// `common`, as the cloud has it where clouds have settings of their own.
POINTFAIR_INLINE point::Radii radii_of(const CloudSettings* its, point::Radii common) {
  if (its == nullptr) return common;
  common.squared_base = its->squared_base;
  common.min_neighbors = its->min_neighbors;
  common.squared_widest = its->squared_widest;
  return common;
}

}  // namespace pointfair::cuda
