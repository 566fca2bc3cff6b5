// SPDX-License-Identifier: Apache-2.0
#include "seam/backend.hpp"

namespace pointfair {

HostBuffer Backend::host_buffer(std::size_t count) {
  return {new Point[count], count, [](Point* points) noexcept { delete[] points; }};
}

void run_stages(Backend& backend, int iteration, const FramedSettings& settings, const std::stop_token& stop) {
  backend.build_index(iteration, settings.frame, stop);
  backend.find_neighbors(iteration, settings.neighbors, stop);
  backend.estimate_normals(iteration, settings.normals, stop);
  backend.fair(iteration, settings.fairing, stop);
}

}  // namespace pointfair
