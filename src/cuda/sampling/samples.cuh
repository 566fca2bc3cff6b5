// SPDX-License-Identifier: Apache-2.0
// What samples of a cloud say, found where the searches leave their rows (point/sample.h).
#pragma once

#include "cuda/sampling/sample_rows.cuh"
#include "point/sample.h"
#include "seam/sampling.hpp"

namespace pointfair::cuda {

// Page-locked arrays of the host: `queries` first for the spacing, then for the noise, in upload order.
struct SampleArrays {
  const Index* queries;
  std::size_t for_spacing, for_noise;
  point::SpacingSample* spacing;
  point::NoiseSample* noise;
  point::ResidualSample* residuals;  // of the queries for noise
  Index* pools;                      // Samples::pools; null: not looked for
  Point* near;        // of the first point::kNearRows rows for the noise, point::kNearRow points each; null: not wanted
  SampleRule rule{};  // of the samples for the noise
};

// Of many clouds, all on the card: numbers of points in upload order, and the clouds of a batch that they are of.
struct ManyQueries {
  const Index *spacing, *clouds_of_spacing;
  std::size_t for_spacing;
  const Index *noise, *clouds_of_noise;
  std::size_t for_noise;
};
// On the card, in the order of the queries.
struct ManySamples {
  point::SpacingSample* spacing;
  point::NoiseSample* noise;
  point::ResidualSample* residuals;
  Point* heads;  // of each row for the noise, the first point::kHeadRow points
};
// Starts to fill the arrays, as fast as many samples can be taken. Noise samples of rows that are too short say so.
void take_samples(Context& context, const Tree& tree, const Point* points, const ManyQueries& queries,
                  const ManySamples& samples);
// The noise at queries whose first rows were too short. Memory: 7 KB a query.
void look_farther(Context& context, const Tree& tree, const Point* points, const Index* queries, const Index* clouds,
                  std::size_t count, point::NoiseSample* noise);

// Starts to fill the arrays. `points` in upload order.
void take_samples(Context& context, const Tree& tree, const Point* points, const SampleArrays& samples);

}  // namespace pointfair::cuda
