// SPDX-License-Identifier: Apache-2.0
// The last stage of method learned: a net refines what the stages made of a whole cloud (src/point/net.h).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>

#include "pointfair/cloud.hpp"
#include "seam/device_memory.hpp"
#include "seam/net_weights.hpp"
#include "seam/settings.hpp"

namespace pointfair {

// A row for each point, in upload order.
struct Classical {
  std::span<const Point> measured, points, normals;
  std::span<const float> noise;
  std::span<const std::uint8_t> held;  // 1: keeps its place
};

// Is told the share of the net's steps that are done, after each.
using NetProgress = std::function<void(double share)>;

// On the host's cores: writes the refined points to `out`, which may be `classical.points`. Points that are held, that
// have no normal or that know no noise keep their classical place. A point's result depends on those that its lists of
// neighbours reach, layer by layer, in all kScales scales: on no bound of distance. The frame is the cloud's. 640 bytes
// a point. Runs on the threads of the arena that calls it.
void refine(const Classical& classical, const NetWeights& weights, const Frame& frame, std::span<Point> out,
            const std::stop_token& stop, const NetProgress& progress = {});

// What a device refines its results by.
struct RefinedBy {
  const NetWeights& weights;
  Frame frame;
  float sigma;                                // of the noise, and
  std::shared_ptr<const NoiseLevels> levels;  // how much it is from place to place; null: 1 everywhere
};

// A device that refines the results that it holds, with the bits of the host's cores.
class Refinement {
 public:
  virtual ~Refinement() = default;
  // As Backend::download and DeviceMemory::download, of refined points, whose whole way is limited too.
  virtual OutlierCounts download_refined(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                                         std::span<std::uint8_t> outliers, const RefinedBy& by,
                                         const std::stop_token& stop) = 0;
  virtual OutlierCounts download_refined(int iteration, const DeviceOutput& points, DeviceStream stream,
                                         const DisplacementLimits& limits, std::span<std::uint8_t> outliers,
                                         const RefinedBy& by, const std::stop_token& stop) = 0;
  // As refine() above, of a cloud in host memory. Throws Error(memory).
  virtual void refine(const Classical& classical, const NetWeights& weights, const Frame& frame, std::span<Point> out,
                      const std::stop_token& stop) = 0;
};

}  // namespace pointfair
