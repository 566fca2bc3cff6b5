// SPDX-License-Identifier: Apache-2.0
// Which cards this machine has, and why one cannot be used. Never needs a driver to be there.
#include <cuda_runtime_api.h>

#include <string>

#include "cuda/runtime/devices.cuh"
#include "seam/backend.hpp"

namespace pointfair {
namespace cuda {
namespace {

__global__ void nothing() {}

std::string version_text(int version) {
  return std::to_string(version / 1000) + "." + std::to_string(version % 1000 / 10);
}

// Empty if cards can be asked for; `cards` says how many there are.
std::string why_no_cards(int& cards) {
  cards = 0;
  const cudaError_t status = cudaGetDeviceCount(&cards);
  if (status == cudaSuccess) return cards > 0 ? "" : "no CUDA card in this machine";
  cards = 0;
  cudaGetLastError();
  int driver = 0, runtime = 0;
  cudaDriverGetVersion(&driver);
  cudaRuntimeGetVersion(&runtime);
  if (driver == 0) return "no NVIDIA driver found";
  if (status == cudaErrorInsufficientDriver)
    return "the NVIDIA driver serves CUDA " + version_text(driver) + " and this program needs " +
           version_text(runtime) + " or a later " + std::to_string(runtime / 1000) + ".x; update the driver";
  if (status == cudaErrorNoDevice) return "no CUDA card in this machine";
  return std::string("CUDA does not start: ") + cudaGetErrorString(status);
}

// Empty if the card can run this program's kernels.
std::string why_not_usable(int card) {
  cudaDeviceProp properties{};
  cudaError_t status = cudaGetDeviceProperties(&properties, card);
  if (status == cudaSuccess && properties.major * 10 + properties.minor < 75)
    return "compute capability " + std::to_string(properties.major) + "." + std::to_string(properties.minor) +
           " is below 7.5";
  cudaFuncAttributes attributes{};
  if (status == cudaSuccess) status = cudaSetDevice(card);
  if (status == cudaSuccess) status = cudaFuncGetAttributes(&attributes, nothing);
  if (status == cudaSuccess) return "";
  cudaGetLastError();
  if (status == cudaErrorNoKernelImageForDevice || status == cudaErrorInvalidDeviceFunction)
    return "this build has no machine code for compute capability " + std::to_string(properties.major) + "." +
           std::to_string(properties.minor);
  return cudaGetErrorString(status);
}

DeviceStatus status_of(int card) {
  DeviceStatus status{{Device::cuda, "CUDA card " + std::to_string(card), ""}, false, {}};
  cudaDeviceProp properties{};
  if (cudaGetDeviceProperties(&properties, card) == cudaSuccess) {
    status.info.name = properties.name;
    status.details.push_back("card " + std::to_string(card) + ", compute capability " +
                             std::to_string(properties.major) + "." + std::to_string(properties.minor) + ", " +
                             std::to_string(properties.multiProcessorCount) + " multiprocessors, " +
                             std::to_string(properties.totalGlobalMem >> 20) + " MiB");
  }
  int driver = 0, runtime = 0;
  cudaDriverGetVersion(&driver);
  cudaRuntimeGetVersion(&runtime);
  status.details.push_back("driver serves CUDA " + version_text(driver) + ", runtime " + version_text(runtime));
  status.info.reason = why_not_usable(card);
  status.usable = status.info.reason.empty();
  if (status.usable) status.info.reason = "can be used";
  return status;
}

}  // namespace

void require_card(int card) {
  int cards = 0;
  std::string reason = why_no_cards(cards);
  if (reason.empty() && (card < 0 || card >= cards))
    reason = "there is no card " + std::to_string(card) + "; this machine has " + std::to_string(cards);
  if (reason.empty()) reason = why_not_usable(card);
  if (!reason.empty())
    throw Error(ErrorKind::device, "CUDA card " + std::to_string(card) + " cannot be used: " + reason);
}

}  // namespace cuda

std::vector<DeviceStatus> list_cuda_devices() {
  int cards = 0;
  const std::string reason = cuda::why_no_cards(cards);
  if (!reason.empty()) return {{{Device::cuda, "CUDA", reason}, false, {}}};
  std::vector<DeviceStatus> all;
  for (int card = 0; card < cards; ++card) all.push_back(cuda::status_of(card));
  return all;
}

}  // namespace pointfair
