// SPDX-License-Identifier: Apache-2.0
// The origin of a cloud's float positions, which follows from a sample of them.
#pragma once

#include <cstdint>
#include <vector>

#include "io/box_of.hpp"
#include "pointfair/positions.hpp"

namespace pointfair::io {

/// Of at most so many positions, all are the sample.
inline constexpr std::uint64_t kSampledPositions = 4096;

/// Positions of a file, chosen by a hash of their coordinates, so that the order of the points does not matter.
class OriginSample {
 public:
  /// Of a cloud of so many points, of which parts may be offered to samples of their own.
  explicit OriginSample(std::uint64_t points)
      : limit_(points > kSampledPositions ? ~std::uint64_t{0} / points * kSampledPositions : ~std::uint64_t{0}) {}

  void offer(const Position& position);
  void offer_all(const OriginSample& other);
  std::vector<Position> take() &&;

  /// All that it holds, for offer_all() of another process: the chosen ones, then the two corners of their box.
  std::vector<Position> state() const;
  void offer_state(const std::vector<Position>& state);

 private:
  std::uint64_t limit_;
  std::vector<Position> chosen_;
  BoxOf<double> box_;
};

/// An origin for coordinates of which these are a sample: 0 on an axis unless the coordinates there are large against
/// the extent of the bulk of the points, else a round number near its centre.
Position choose_origin(std::vector<Position> sample);

}  // namespace pointfair::io
