// SPDX-License-Identifier: Apache-2.0
// The samples nearest to each sample of the noise.
#pragma once

#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

inline constexpr std::size_t kMostPooled = 512;  // samples of a cloud

struct Poolable {
  const Index* ends;  // samples of cloud i: ends[i - 1] to ends[i], no more than kMostPooled
  std::size_t clouds;
  const std::uint8_t* shows;  // 1 for each sample that shows noise
  const Point* places;        // of a sample, each point::kHeadRow
};
// Starts to write point::kPool samples of its cloud for each that shows noise, by their numbers within the cloud: those
// nearest to it that show noise, itself among them, nearest first, and equally far ones in their order. All on the
// card.
void find_pools(Context& context, const Poolable& samples, Index* pools);

// Of the samples of one cloud, whose rows begin with their places: the same rows. `shows` says of each whether it shows
// noise. At most kMostOfOne samples.
inline constexpr std::size_t kMostOfOne = 6000;
void find_pools(Context& context, const Point* rows, std::size_t row, const unsigned char* shows, std::size_t samples,
                Index* pools);

}  // namespace pointfair::cuda
