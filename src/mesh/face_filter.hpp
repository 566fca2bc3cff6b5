// SPDX-License-Identifier: Apache-2.0
// What the faces tell beyond the method: neighbouring faces agree, and what a whole neighbourhood lost to one side
// was shape.
#pragma once

#include <cstdint>
#include <span>

#include "mesh/topology.hpp"

namespace pointfair {

// Vertices move to where the planes of their faces, turned to filtered normals, say that they are.
// Normals are filtered in eight rounds, all at once: of a face f and those across its edges,
//   n_f' = unit of sum_g A_g W(|n_f - n_g|) n_g,   W(x) = (1 - x^2 / t_f^2)^2, 0 from t_f on,   t_f = 2 sigma_f / l_f,
// with the areas A as they were, sigma_f the mean noise of the corners and l_f the root mean square of the edges (after
// Zheng and others 2011); normals of faces that run round the other way count with the opposite sign. Then, six times
// and all at once, v moves by 1.5 times the mean of n_f' n_f'.(c_f - v) over its faces, where c_f is the mean of a
// face's corners (Sun and others 2007). Vertices with `stays` and those without noise do not move. `noise`: of the
// vertices (noise_by_steps).
void follow_filtered_normals(const OrderedFaces& faces, const MeshTopology& mesh, std::span<const std::uint8_t> stays,
                             std::span<const double> noise, std::span<Point> places, const ForEach& for_each);

// White noise leaves no mean: where what the steps from `input` to `places` took along the normals has one over the
// three rings around, m, that noise does not explain, it was shape, and the vertex gets
//   max(0, 1 - 4 s^2 / (N m^2)) m
// back along its normal. s^2 is the mean square of what was taken there, or that of the vertex's `noise` where this is
// less; N is how many vertices the mean is as good as, 20, or the part of them that does not stay. Noise that is
// correlated from vertex to vertex has a mean as well, so N falls to none as the correlation of what was taken on both
// ends of the edges rises from .3 to .6. Vertices with `stays` do not move and do not count.
void give_back_shape(const OrderedFaces& faces, std::span<const std::uint8_t> stays, std::span<const double> noise,
                     std::span<const Point> input, std::span<Point> places, const ForEach& for_each);

}  // namespace pointfair
