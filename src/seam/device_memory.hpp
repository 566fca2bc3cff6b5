// SPDX-License-Identifier: Apache-2.0
// Clouds that lie in the memory of the device already, and results that stay there.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "pointfair/device_points.hpp"
#include "seam/backend.hpp"

namespace pointfair {

using Origin = std::array<double, 3>;
// Of a sample of positions, which does not depend on their order.
using ChooseOrigin = std::function<Origin(std::vector<std::array<double, 3>>)>;

// Calls wait for what `stream` was given before. What the stream is given after upload() may change the points; when
// the other calls return, the results are there. All throw Error(usage) for memory that is not on this device.
class DeviceMemory {
 public:
  virtual ~DeviceMemory() = default;
  // As Backend::upload, of the positions relative to the origin that `choose` returns, which this does too. Keeps what
  // download() needs to give positions of the same type back.
  virtual Origin upload(const DevicePoints& points, DeviceStream stream, const ChooseOrigin& choose,
                        IndexOrder expected) = 0;
  // As Backend::download: the uploaded positions, moved. `points` has the type of what was uploaded; a coordinate that
  // did not move keeps its bits.
  virtual OutlierCounts download(int iteration, const DeviceOutput& points, DeviceStream stream,
                                 const DisplacementLimits& limits, std::span<std::uint8_t> outliers) = 0;
  virtual void download_normals(int iteration, const DeviceOutput& normals, DeviceStream stream) = 0;
};

}  // namespace pointfair
