// SPDX-License-Identifier: Apache-2.0
// Images of depth cameras, frame by frame: faster than a run on their points, since the grid of pixels says who is
// near.
#pragma once

#include <cstddef>
#include <span>
#include <stop_token>

#include "pointfair/export.hpp"

namespace pointfair {

/// Denoises one image of depths along the optical axis, as stereo and structured-light cameras measure them, row by row
/// of `width` pixels. Each pixel gets the mean of what pairs of pixels on opposite sides of it say, in 1 / depth, which
/// is linear across a plane; pairs that lie off by more than 3 times the noise count nothing, so jumps and edges stay.
/// The noise is measured in the image, at each of five distances between pixels. Pixels that are 0 or not finite, where
/// nothing was measured, keep their bits and are nobody's pair. `out` may be `depth` itself. The same bits for any
/// number of threads. `threads`: 0: all cores. O(N); 12 bytes a pixel. Throws ErrorKind::usage if the sizes do not make
/// an image, and ErrorKind::interrupted.
POINTFAIR_EXPORT void denoise_depth(std::span<const float> depth, std::size_t width, std::span<float> out,
                                    unsigned threads = 0, std::stop_token stop = {});

}  // namespace pointfair
