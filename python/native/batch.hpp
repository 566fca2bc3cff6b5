// SPDX-License-Identifier: Apache-2.0
// Many small clouds in one call.
#pragma once

#include <cstdint>
#include <span>

#include "array_pipeline.hpp"

namespace pointfair::python {

/// Denoises cloud i, points offsets[i] to offsets[i + 1], as a run of its own would, with the same bits. Clouds are
/// spread over `threads` threads (0: all cores); each runs on one. `reports` is empty or has a place for each cloud.
/// Throws the error of the first cloud that has one, with its number.
template <class Scalar>
void denoise_batch(std::span<const Scalar> coordinates, std::span<const std::int64_t> offsets, const Params& params,
                   unsigned threads, std::span<Scalar> out, std::span<Report> reports, const Watch& watch);

}  // namespace pointfair::python
