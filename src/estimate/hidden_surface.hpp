// SPDX-License-Identifier: Apache-2.0
// A surface that most of its neighbours do not lie on, such as the ground between crowns.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "estimate/nearest_rows.hpp"
#include "point/sample.h"
#include "seam/cloud_sample.hpp"

namespace pointfair {

// A hidden surface, if there is one, as the samples show it.
struct HiddenSurface {
  std::vector<bool> on_surface;             // of each sample; empty for a cloud that hides none, as nearly all
  std::vector<point::NoiseSample> samples;  // with the noise of those on the surface; read where there is one
};

// Rows of the first samples' nearest points, as far as a hidden surface asks for them; none where the surface is there
// for all to see.
std::vector<Point> rows_of_hidden(const NearestRows& rows, std::span<const point::NoiseSample> samples);

// The noise of a sample on a hidden surface becomes the deviation of the best half of its 16 nearest points from a
// plane. Samples with far more noise than that, about as much as their neighbourhood is wide, show no surface. `rows`:
// of rows_of_hidden().
HiddenSurface find_hidden_surface(std::span<const Point> rows, std::vector<point::NoiseSample> samples,
                                  const ForEach& for_each);

// The same where no half of 16 points is that near to a plane: places whose noise is far below the spacing are the
// surface, if most have as much as the spacing, hardly any are in between, and residuals of the noisy ones grow with
// their neighbourhood as those of a volume do.
HiddenSurface find_quiet_surface(const std::vector<point::NoiseSample>& samples,
                                 const std::function<std::vector<point::ResidualSample>()>& residuals);

}  // namespace pointfair
