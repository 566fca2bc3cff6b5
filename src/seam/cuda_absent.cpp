// SPDX-License-Identifier: Apache-2.0
// Stands in for src/cuda in a build without CUDA.
#include "seam/backend.hpp"

namespace pointfair {

std::unique_ptr<Backend> make_cuda_backend(int, const CudaOptions&) {
  throw Error(ErrorKind::device,
              "this program was not built with CUDA; build it with -DPOINTFAIR_CUDA=ON, or use the CPU");
}

std::vector<DeviceStatus> list_cuda_devices() {
  return {{{Device::cuda, "CUDA", "this program was not built with CUDA"}, false, {}}};
}

}  // namespace pointfair
