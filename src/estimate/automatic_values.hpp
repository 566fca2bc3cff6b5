// SPDX-License-Identifier: Apache-2.0
// What `auto` means for a parameter, by the method and by what was measured. `spacing` is that of the surface.
#pragma once

#include "estimate/constants.hpp"
#include "estimate/estimate.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

// The constants of one method; the defaults here are those of `bilateral`.
struct MethodDefaults {
  double noise_radius = constants::kNoiseRadius, closeness_width = constants::kClosenessWidth;
  double similarity_width = constants::kSimilarityWidth;  // sigmas
  double least_similarity = constants::kLeastSimilarity;  // spacings
  int relaxation_percent = 100, iterations = constants::kIterations;
  NormalFilter filter = NormalFilter::off;
  bool fits_radius = false;  // to the shape; without filtered normals a larger one rounds edges
};
MethodDefaults defaults_of(Method method);

// The factor on the radius (Eq. 18 of docs/how-it-works.md). Where the noise alone sets the radius, a larger one leaves
// less noise if the shape has room for it. The more places have no room, the smaller the factor is. Between sheets the
// radius follows the gap, and the factor is 1.
double radius_factor(const Noise& noise, double spacing);
// The number of nearest points that a radius reaches to. Correlated noise does not average out among a few points, so
// it takes more. Between the sheets of a thin part, neighbourhoods stop short of the other sheet. Where that leaves too
// few points for a normal, they hold so many of both sheets that the normal of both is that of each.
int automatic_min_neighbors(const Noise& noise, double spacing);
// The k of lists that hold at least 11 points and are wide against the noise.
int automatic_k(const Noise& noise, double spacing);
// The flat scale, rounded to hundredths: smaller where there is little noise, since nothing is to be gained there.
double automatic_flat_scale(const Noise& noise, double spacing);

// The relaxation, rounded to hundredths. It is next to 0 where the noise is very small against the spacing, so that
// clean clouds stay clean. With `by_share`, the share of each step follows from its place (Eq. 22), and this is all.
// Otherwise one share holds for the cloud: Wiener's, of the noise beside the damage of a run, which is about 3 times
// the variance of the shape in the estimate's neighbourhoods. Neighbourhoods that are wide because of the noise, and
// not to hold 16 points, damage less, so the share has a least value that grows with the noise. All `iterations`
// together make it.
double automatic_relaxation(int whole_percent, int iterations, const Noise& noise, double spacing, bool by_share);
// Of method implicit, rounded to hundredths.
double automatic_lambda(const Noise& noise, double spacing);
// c p of Eq. 22. Neighbourhoods that are wide because of the noise damage the shape less than those that hold just 16
// points.
double share_damage(const Noise& noise, int iterations);
// The displacement limit in sigmas. Where noise is small against the spacing, edges move farther than noise does, since
// neighbourhoods reach across them.
double farthest_move(const Noise& noise, double spacing, bool by_share);

}  // namespace pointfair
