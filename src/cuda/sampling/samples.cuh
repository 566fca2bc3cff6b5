// SPDX-License-Identifier: Apache-2.0
// What samples of a cloud say, found where the searches leave their rows (point/sample.h).
#pragma once

#include "cuda/sampling/sample_rows.cuh"
#include "point/sample.h"

namespace pointfair::cuda {

// Page-locked arrays of the host: `queries` first for the spacing, then for the noise, in upload order.
struct SampleArrays {
  const Index* queries;
  std::size_t for_spacing, for_noise;
  point::SpacingSample* spacing;
  point::NoiseSample* noise;
  point::ResidualSample* residuals;  // of the queries for noise
};

// Starts to fill the arrays. `points` in upload order.
void take_samples(Context& context, const Tree& tree, const Point* points, const SampleArrays& samples);

}  // namespace pointfair::cuda
