// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "pipeline/loaded_cloud.hpp"
#include "seam/backend.hpp"

namespace pointfair {

// A backend for what was asked for; `info` tells which device it is and why.
std::unique_ptr<Backend> make_backend(const Device& device, DeviceInfo& info);

// What computes tiles where make_backend() gave a device of this kind.
MakeWorkers make_workers(const Device& device, Device::Kind found);

// The device of one worker each, where there are several cards.
std::vector<Device> single_devices(const Device& device);

}  // namespace pointfair
