// SPDX-License-Identifier: Apache-2.0
#include "pipeline/devices.hpp"

#include <utility>

namespace pointfair {

std::unique_ptr<Backend> make_backend(const Device& device, DeviceInfo& info) {
  const auto on_cpu = [&](std::string reason) {
    auto backend = make_cpu_backend(device.threads);
    info = backend->device();
    info.reason = std::move(reason);
    return backend;
  };
  if (device.kind == Device::cpu) return on_cpu("requested");
  try {
    auto backend = make_cuda_backend(device.index);
    info = backend->device();
    info.reason = device.kind == Device::cuda ? "requested" : "a CUDA card was found";
    return backend;
  } catch (const Error& error) {
    if (device.kind == Device::cuda) throw;
    return on_cpu(std::string("no CUDA: ") + error.what());
  }
}

std::vector<DeviceStatus> list_devices() {
  std::vector<DeviceStatus> devices{cpu_status()};
  for (DeviceStatus& cuda : list_cuda_devices()) devices.push_back(std::move(cuda));
  return devices;
}

}  // namespace pointfair
