// SPDX-License-Identifier: Apache-2.0
// Memory on the card for all that a batch of clouds (src/cuda/index/cloud_batch.cuh) reads.
#pragma once

#include <span>
#include <vector>

#include "cuda/index/cloud_batch.cuh"
#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/transfer.cuh"
#include "seam/cloud_sample.hpp"
#include "seam/many_clouds.hpp"

namespace pointfair::cuda {

class BatchStorage {
 public:
  explicit BatchStorage(Context& context) : spans_(context), settings_(context), nodes_(context) {}

  // A batch of all clouds, with the same settings for all. Each call replaces the batch before.
  CloudBatch plan(std::span<const CloudSpan> clouds, std::size_t uploaded);
  // A batch of some clouds, by their numbers, each with settings of its own. The card must have no work left that reads
  // the batch before.
  CloudBatch plan(std::span<const CloudSpan> clouds, std::span<const Index> which,
                  std::span<const FramedSettings> settings, std::size_t uploaded, const ForEach& for_each);

 private:
  DeviceArray<CloudSpan> spans_;
  DeviceArray<CloudSettings> settings_;
  DeviceArray<float> nodes_;  // of all levels of noise
  Pinned<float> pinned_nodes_;
};

}  // namespace pointfair::cuda
