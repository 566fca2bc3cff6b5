// SPDX-License-Identifier: Apache-2.0
#include "seam/backend.hpp"

namespace pointfair {

HostBuffer Backend::host_buffer(std::size_t count) {
  return {new Point[count], count, [](Point* points) noexcept { delete[] points; }};
}

}  // namespace pointfair
