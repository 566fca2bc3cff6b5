// SPDX-License-Identifier: Apache-2.0
// The last step: an input file again, its points where the tiles have them now.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <stop_token>
#include <vector>

#include "io/edits.hpp"
#include "scale/counted_ranges.hpp"
#include "scale/move_tally.hpp"
#include "scale/plan.hpp"
#include "seam/outlier_tally.hpp"
#include "seam/settings.hpp"

namespace pointfair::scale {

/// Points of a file that follow each other, and why they are outliers.
struct SomeOutliers {
  std::uint64_t first = 0;          ///< in the file
  std::span<const Point> points{};  ///< relative to the cloud's origin; ignored ones are NaN
  std::span<const std::uint8_t> marks{},
      reasons{};  ///< 0: it is none; in `reasons`, those that the limits hold are none
};

/// The results of all tiles for the points of one file, held back as a backend's download() does. Holds two chunks of
/// the input at most.
class TileResults final : public io::MovedPoints {
 public:
  TileResults(const std::vector<std::filesystem::path>& tiles, const Plan& plan, std::size_t file,
              std::shared_ptr<const Source> source, const DisplacementLimits& limits, std::stop_token stop);
  Position origin_at(const Position& own, const Position& of_file) const override;
  void take(std::uint64_t first, std::span<const Position> own, std::span<const Point> before,
            std::span<Point> now) const override;
  /// All points of the file, block by block, from many threads. Counts nothing.
  void visit_outliers(unsigned threads, const std::function<void(const SomeOutliers&)>& visit) const;
  /// Of the points that were taken so far, each counted once: outliers that were held back, others that the limits
  /// held, and how far points moved.
  OutlierCounts held_back() const { return held_back_.counts(); }
  std::uint64_t held_by_limits() const { return held_by_limits_; }
  const MoveTally& moves() const { return moves_; }

 private:
  struct Held {
    std::size_t chunk;
    std::vector<Point> points;
  };
  std::shared_ptr<const Held> hold(std::size_t chunk) const;
  // Points before: relative to the middles of their zones, and to the cloud's origin.
  struct Before {
    std::span<const Point> in_zones, in_cloud;
  };
  void limit(std::uint64_t first, const Before& before, std::span<Point> now, std::span<point::Outlier> outliers) const;
  void tally(std::span<const Point> before, std::span<const Point> now, std::span<const point::Outlier> outliers) const;
  std::vector<Point> offsets(std::span<const Position> own, bool in_zones) const;

  struct TileFile {
    std::filesystem::path path;
    std::vector<std::uint64_t> begins;  ///< of each chunk's points in the file, and past the last
  };
  std::vector<TileFile> tiles_;
  const Plan& plan_;
  std::uint64_t first_point_;  ///< of the file
  std::shared_ptr<const Source> source_;
  DisplacementLimits limits_;
  bool may_hold_back_;  ///< limits are set, or an iteration before may have left points out
  std::stop_token stop_;
  mutable std::mutex mutex_;
  mutable std::vector<std::shared_ptr<const Held>> held_;  ///< the last two
  mutable CountedRanges counted_;
  mutable OutlierTally held_back_;
  mutable MoveTally moves_;
  mutable std::atomic<std::uint64_t> held_by_limits_{0};
};

}  // namespace pointfair::scale
