// SPDX-License-Identifier: Apache-2.0
// Many small clouds that a device computes at once.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/device_points.hpp"
#include "seam/backend.hpp"

namespace pointfair {

class ManyClouds {
 public:
  // What one upload takes.
  struct Room {
    std::size_t clouds, points_of_cloud;
    std::size_t places;  // clouds times points of the largest
  };
  virtual ~ManyClouds() = default;
  virtual Room room() const = 0;
  // As Backend::upload and build_index(0) of clouds none of which sees another, until the next upload: cloud i has the
  // points ends[i - 1] to ends[i], which stay as they are until the download. Stages then are those over lists, without
  // the constraint, of the bilateral method; counts are those of all clouds.
  virtual void upload(std::span<const Point> points, std::span<const std::uint32_t> ends) = 0;
  // The same of positions on the device, all with the origin 0.
  virtual void upload(const DevicePoints& points, DeviceStream stream, std::span<const std::uint32_t> ends) = 0;
  // 1 for each cloud whose origin is 0 without doubt, by the rule of positions in host memory.
  virtual std::vector<std::uint8_t> surely_have_no_origin(const DevicePoints& points, DeviceStream stream,
                                                          std::span<const std::uint32_t> ends) = 0;
};

}  // namespace pointfair
