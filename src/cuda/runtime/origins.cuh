// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "cuda/runtime/memory.cuh"
#include "pointfair/device_points.hpp"

namespace pointfair::cuda {

// 1 for each cloud whose origin is surely 0 (is_surely_small of src/io/origin_sample.cpp); cloud i has the points
// ends[i - 1] to ends[i], `ends` on the card. Waits.
std::vector<std::uint8_t> surely_have_no_origin(Context& context, const DevicePoints& points, const unsigned* ends,
                                                std::size_t clouds);

}  // namespace pointfair::cuda
