// SPDX-License-Identifier: Apache-2.0
// Takes the samples of many clouds at once.
#pragma once

#include <stop_token>

#include "cuda/runtime/memory.cuh"
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
        heads_(context) {}

  // Of points in upload order, by the tree of their forest, into arrays of the host. Waits.
  void take(const Tree& tree, const Point* points, const ManyClouds::Queries& for_spacing,
            const ManyClouds::Queries& for_noise, const ManySamples& to, const std::stop_token& stop);

 private:
  void upload(const ManyClouds::Queries& queries, std::size_t at);
  template <class T>
  void fetch(const DeviceArray<T>& from, T* to);
  void look_farther(const Tree& tree, const Point* points, const ManyClouds::Queries& for_noise,
                    point::NoiseSample* noise, const std::stop_token& stop);

  Context& context_;
  DeviceArray<Index> queries_;
  DeviceArray<point::SpacingSample> spacing_;
  DeviceArray<point::NoiseSample> noise_;
  DeviceArray<point::ResidualSample> residuals_;
  DeviceArray<Point> heads_;
};

}  // namespace pointfair::cuda
