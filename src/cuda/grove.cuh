// SPDX-License-Identifier: Apache-2.0
// The forests of clouds that were uploaded together: what a forest (src/cuda/index/forest.cuh) reads, on the card.
#pragma once

#include <span>
#include <vector>

#include "cuda/index/forest.cuh"
#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/transfer.cuh"
#include "seam/cloud_sample.hpp"
#include "seam/many_clouds.hpp"

namespace pointfair::cuda {

class Grove {
 public:
  explicit Grove(Context& context) : context_(context), spans_(context), rules_(context), nodes_(context) {}

  // Of all clouds alike. Each call takes the place of the forest before.
  Forest plan(std::span<const CloudSpan> clouds, std::size_t uploaded);
  // Of some clouds by their numbers, each with settings of its own; what the card does must be done.
  Forest plan(std::span<const CloudSpan> clouds, std::span<const Index> which,
              std::span<const ManyClouds::OfCloud> settings, std::size_t uploaded, const ForEach& for_each);

 private:
  void upload(const std::vector<CloudSpan>& spans);

  Context& context_;
  DeviceArray<CloudSpan> spans_;
  DeviceArray<CloudRules> rules_;
  DeviceArray<float> nodes_;  // of all levels of noise
  Pinned<float> pinned_nodes_;
};

}  // namespace pointfair::cuda
