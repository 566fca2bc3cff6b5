// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "seam/backend.hpp"

namespace pointfair {

// A backend for what was asked for; `info` tells which device it is and why.
std::unique_ptr<Backend> make_backend(const Device& device, DeviceInfo& info);

}  // namespace pointfair
