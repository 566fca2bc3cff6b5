// SPDX-License-Identifier: Apache-2.0
// Vertices that even out along the surface.
#pragma once

#include <cstdint>
#include <span>

#include "mesh/folds.hpp"

namespace pointfair {

// Of each vertex, the noise that the steps from `input` to `places` show: 1.2 times their root mean square over the two
// rings about it, where a vertex counts once for each path of faces that leads to it and those with `stays` do not
// count; at most sigma. A surface whose detail passes for noise is hardly moved by its method, and keeps its vertices.
platform::LargeVector<double> noise_by_steps(const OrderedFaces& faces, std::span<const std::uint8_t> stays,
                                             double sigma, std::span<const Point> input, std::span<const Point> places,
                                             const ForEach& for_each);

// In each round, all vertices at once go towards the middle of their ring, m from where they are, by the step
//   share e (T + e I)^-1 m,   T = sum_f A_f n_f n_f^T / sum_f A_f over the faces at the vertex,
//   e = min(sigma^2 / l^2, 0.5), where sigma is the vertex's noise and l^2 is the mean square of the vertex's edges as
//   they were (Eq. 27).
// T is 1 across a smooth surface, 0 along it, and what noise turns the normals by about sigma^2 / l^2: so along the
// surface the step is nearly all of m, across it the less the less noise there is, and at an edge it is along the edge
// alone. Orientations of faces do not matter. Vertices with `stays` do not move, and none ends farther than 3 sigma
// from where it began. `noise`: of the vertices.
void even_out(const OrderedFaces& faces, std::span<const std::uint8_t> stays, double share,
              std::span<const double> noise, std::span<Point> places, const ForEach& for_each);

// Corners of folded faces make such steps with e = 0.5, all at once, in up to ten rounds, until no face is folded.
// `folds` are those of `places`, before and after the call. None ends farther than three times its noise from where it
// began.
void untangle(Folds& folds, std::span<const std::uint8_t> stays, std::span<const double> noise,
              std::span<Point> places);

}  // namespace pointfair
