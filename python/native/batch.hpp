// SPDX-License-Identifier: Apache-2.0
// Many small clouds in one call.
#pragma once

#include <cstdint>
#include <span>

#include "array_pipeline.hpp"

namespace pointfair::python {

/// Denoises cloud i, points offsets[i] to offsets[i + 1], as a run of its own would, with the same bits. On a card, all
/// at once where the parameters allow it and no reports are asked for; else the clouds are spread over `threads`
/// threads (0: all cores), each of which computes one after the other, on one CPU thread or on the card. `pipeline`
/// says which device `device` is, and is empty afterwards. `reports` is empty or has a place for each cloud. Throws the
/// error of the first cloud that has one, with its number.
template <class Scalar>
void denoise_batch(Pipeline& pipeline, Device device, std::span<const Scalar> coordinates,
                   std::span<const std::int64_t> offsets, const Params& params, unsigned threads, std::span<Scalar> out,
                   std::span<Report> reports, const Watch& watch);

}  // namespace pointfair::python
