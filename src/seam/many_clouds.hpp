// SPDX-License-Identifier: Apache-2.0
// Many small clouds that a device computes at once.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "point/sample.h"
#include "pointfair/cloud.hpp"
#include "pointfair/device_points.hpp"
#include "seam/backend.hpp"
#include "seam/settings.hpp"

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
  // 1 for each cloud whose origin is certainly 0 by the rule of positions in host memory, 0 for one that the host must
  // look at.
  virtual std::vector<std::uint8_t> surely_have_no_origin(const DevicePoints& points, DeviceStream stream,
                                                          std::span<const std::uint32_t> ends) = 0;

  // The calls below serve clouds whose stages have different settings: sums within a radius, the bilateral method.

  // Points by their numbers in upload order, and the clouds that they are of.
  struct Queries {
    std::vector<std::uint32_t> points, clouds;
    void resize(std::size_t count) { points.resize(count), clouds.resize(count); }
  };
  // What the samples show, in the order of the queries, until the next call of the backend.
  struct Taken {
    std::span<const point::SpacingSample> spacing;
    std::span<const point::NoiseSample> noise;
    std::span<const point::ResidualSample> residuals;  // of the queries for noise
    std::span<const Point> heads;                      // the first point::kHeadRow of each row for noise
    std::span<const std::uint32_t> pools;              // as of Samples, numbers within each cloud; may be empty
  };
  // As Sampling::take_samples, of uploaded clouds.
  virtual Taken take_samples(const Queries& for_spacing, const Queries& for_noise, std::stop_token stop) = 0;

  // All stages of all iterations of some uploaded clouds, by their numbers, none of them empty. Settings are those of
  // the first iteration, with a frame. One launch computes all
  // of them, so their settings switch the same things on: a number is 0 in all of them or in none, a flat scale is
  // above 1 in all or in none, and settings that are no numbers are equal.
  virtual void run(std::span<const std::uint32_t> clouds, std::span<const FramedSettings> settings, int iterations,
                   std::stop_token stop) = 0;
  // What run() has computed, of all uploaded points; clouds that did not run stay as they are.
  virtual void download(std::span<Point> points) = 0;
  virtual void download(const DeviceOutput& points, DeviceStream stream) = 0;
};

}  // namespace pointfair
