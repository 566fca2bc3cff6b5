// SPDX-License-Identifier: Apache-2.0
// Takes the samples of many clouds at once.
#pragma once

#include <stop_token>

#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/transfer.cuh"
#include "cuda/sampling/samples.cuh"
#include "seam/many_clouds.hpp"

namespace pointfair::cuda {

class ManySampler {
 public:
  explicit ManySampler(Context& context)
      : context_(context),
        queries_(context),
        spacing_(context),
        noise_(context),
        residuals_(context),
        heads_(context),
        ends_(context),
        pools_(context),
        shows_(context) {}

  // Of points in upload order, by the tree of their batch. The result lasts until the next call. Waits.
  ManyClouds::Taken take(const Tree& tree, const Point* points, std::size_t clouds,
                         const ManyClouds::Queries& for_spacing, const ManyClouds::Queries& for_noise,
                         const std::stop_token& stop);

 private:
  void upload(const ManyClouds::Queries& queries, std::size_t at);
  void clear_noise(std::size_t count);
  template <class T>
  void fetch(const DeviceArray<T>& from, Pinned<T>& to);
  void look_farther(const Tree& tree, const Point* points, const ManyClouds::Queries& for_noise,
                    const std::stop_token& stop);
  bool find_pools(const ManyClouds::Queries& for_noise, std::size_t clouds);

  Context& context_;
  DeviceArray<Index> queries_;
  DeviceArray<point::SpacingSample> spacing_;
  DeviceArray<point::NoiseSample> noise_;
  DeviceArray<point::ResidualSample> residuals_;
  DeviceArray<Point> heads_;
  DeviceArray<Index> ends_, pools_;
  DeviceArray<std::uint8_t> shows_;
  Pinned<point::SpacingSample> fetched_spacing_;
  Pinned<point::NoiseSample> fetched_noise_;
  Pinned<point::ResidualSample> fetched_residuals_;
  Pinned<Point> fetched_heads_;
  Pinned<Index> fetched_pools_;
};

}  // namespace pointfair::cuda
