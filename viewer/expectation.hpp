// SPDX-License-Identifier: Apache-2.0
// How long a run will take, judged from those before it: only so that a slow one gets a preview.
#pragma once

#include <array>

#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

/// The first stage that reads what differs; Stage::iterations if only that or nothing does.
Stage first_difference(const Params& a, const Params& b);

class Expectation {
 public:
  /// For a cloud of so many points that nothing is known of yet.
  void reset(std::uint64_t points);

  /// A run that was completed. O(1).
  void learn(const Report& report);

  /// Milliseconds of a run with `params`, which hold no `auto`.
  double milliseconds(const Params& params) const;

 private:
  static constexpr std::size_t kStages = 4;  // of an iteration
  std::array<double, kStages> stage_{};      // milliseconds of one time each
  Params params_;                            // of the last completed run
  bool has_run_ = false;
};

}  // namespace pointfair::viewer
