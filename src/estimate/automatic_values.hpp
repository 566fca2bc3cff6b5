// SPDX-License-Identifier: Apache-2.0
// What `auto` means for a parameter, by the method and by what was measured. `spacing` is that of the surface.
#pragma once

#include "estimate/constants.hpp"
#include "estimate/estimate.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

// For one method; the constants are the bilateral one's.
struct MethodDefaults {
  double noise_radius = constants::kNoiseRadius, closeness_width = constants::kClosenessWidth;
  double similarity_width = constants::kSimilarityWidth;  // sigmas
  double least_similarity = constants::kLeastSimilarity;  // spacings
  int relaxation_percent = 100, iterations = constants::kIterations;
  NormalFilter filter = NormalFilter::off;
  bool fits_radius = false;  // to the shape; without filtered normals a larger one rounds edges
};
MethodDefaults defaults_of(Method method);

// What multiplies the radius (Eq. 18 of docs/how-it-works.md). Where only the noise sets it, a larger one leaves less
// noise if the shape has room for it; the more of it has none, the smaller. Between sheets it follows the gap.
double radius_factor(const Noise& noise, double spacing);
// Noise that is alike in neighbouring points does not average out among a few of them. Between the sheets of a thin
// part: such as stop short of the other sheet, or, where that leaves too few points for a normal, so many that the
// normal of both sheets is that of each.
int automatic_min_neighbors(const Noise& noise, double spacing);
// Of lists: wide enough for 11 points, and wide against the noise.
int automatic_k(const Noise& noise, double spacing);
// In hundredths. Noise that is next to none leaves nothing to gain.
double automatic_flat_scale(const Noise& noise, double spacing);
// Degrees. Normals that little noise tilts differ less by it.
int automatic_crease_angle(const Noise& noise, double spacing);

// In hundredths. Next to nothing where the noise estimate is very small against the spacing, so that clean clouds stay
// clean. The rest, unless the share of each step is a matter of its
// place (`by_share`), is the share of the noise in what a run does: to the shape itself it does about 3 times the
// variance that shape has in the estimate's neighbourhoods. Where these are wide for the noise's sake and not for the
// 16 points', they damage less: the share has a least value that grows with the noise. `iterations` together make that
// share, each of which would make the whole.
double automatic_relaxation(int whole_percent, int iterations, const Noise& noise, double spacing, bool by_share);
// Of the share of a step (c p of Eq. 22). Neighbourhoods that are wide for the noise's sake damage the shape less than
// those that hold just 16 points, and what a depth camera's matcher makes alike only looks like shape.
double share_damage(const Noise& noise, int iterations);
// Sigmas. Where noise is little against the spacing, what moves by more is edges, which neighbourhoods reach across.
double farthest_move(const Noise& noise, double spacing, bool by_share);

}  // namespace pointfair
