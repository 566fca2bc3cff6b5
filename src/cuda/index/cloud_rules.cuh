// SPDX-License-Identifier: Apache-2.0
// What is fixed by a cloud of a batch (src/cuda/index/cloud_batch.cuh), where clouds differ in it: its curve and what
// its stages read.
#pragma once

#include "point/curve.h"
#include "point/neighborhoods.h"
#include "point/node_field.h"
#include "point/outliers.h"
#include "point/stages.h"

namespace pointfair::cuda {

using point::Index;
using Vec = point::Vec3<float>;

struct CloudRules {
  point::CurveCube cube;
  Vec corner;  // positions are hashed relative to it
  float squared_base, squared_widest;
  int min_neighbors;
  point::NodeField noise_levels, reach_levels;  // nodes on the card
  point::NormalRule normal;
  float inverse_turn;  // of filtered normals
  point::GrowthRule growth;
  point::FairingRule fairing;  // of the first iteration
  point::LimitRule limits;
};

// `common`, as the cloud has it where there are such rules.
POINTFAIR_INLINE point::Radii radii_of(const CloudRules* rules, point::Radii common) {
  if (rules == nullptr) return common;
  common.squared_base = rules->squared_base;
  common.min_neighbors = rules->min_neighbors;
  common.squared_widest = rules->squared_widest;
  return common;
}

}  // namespace pointfair::cuda
