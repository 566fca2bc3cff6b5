// SPDX-License-Identifier: Apache-2.0
// The last step: an input file again, its points where the tiles have them now.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <stop_token>
#include <vector>

#include "io/edits.hpp"
#include "scale/plan.hpp"
#include "seam/outlier_tally.hpp"
#include "seam/settings.hpp"

namespace pointfair::scale {

/// What becomes of the results of the last iteration: as a backend's download() does.
struct Settling {
  DisplacementLimits limits;
  bool may_hold_back = false;  ///< limits are set, or an iteration before may have left points out
};

/// The results of all tiles for the points of one file. Holds two chunks of the input at most.
class TileResults final : public io::MovedPoints {
 public:
  TileResults(const std::vector<std::filesystem::path>& tiles, const Plan& plan, std::size_t file,
              const Settling& settling, std::stop_token stop);
  void take(std::uint64_t first, std::span<const Point> before, std::span<Point> now) const override;
  /// Points that were held back so far.
  OutlierCounts held_back() const { return held_back_.counts(); }

 private:
  struct Held {
    std::size_t chunk;
    std::vector<Point> points;
  };
  std::shared_ptr<const Held> hold(std::size_t chunk) const;
  Point settle(const Point& before, const Point& faired) const;

  struct TileFile {
    std::filesystem::path path;
    std::vector<std::uint64_t> begins;  ///< of each chunk's points in the file, and past the last
  };
  std::vector<TileFile> tiles_;
  const Plan& plan_;
  std::uint64_t first_point_;  ///< of the file
  Settling settling_;
  std::stop_token stop_;
  mutable std::mutex mutex_;
  mutable std::vector<std::shared_ptr<const Held>> held_;  ///< the last two
  mutable OutlierTally held_back_;
};

}  // namespace pointfair::scale
