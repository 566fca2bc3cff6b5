// SPDX-License-Identifier: Apache-2.0
// What becomes of outliers in a file beside the words of Params::outliers: classes, a flag, or fewer points.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

struct OutlierAction {
  enum class Kind : std::uint8_t {
    none,
    classify,  ///< the attribute `classification` tells them
    withhold,  ///< the attribute `withheld` does: 1 for outliers
    remove     ///< they are left out of the file
  };
  Kind kind = Kind::none;
  /// The class of all outliers; unset: low noise, class 7, or high noise, class 18 (LAS 1.4 R15, classes of point
  /// formats 6 to 10). Files with FileInfo::has_old_classes have no class for high noise: there all is class 7.
  std::optional<std::uint8_t> value;
  friend bool operator==(const OutlierAction&, const OutlierAction&) = default;
};

/// Whether a run looks for outliers and leaves them at their place: with Outliers::keep and mark, and where automatic
/// means keep, which no cloud decides.
POINTFAIR_EXPORT bool keeps_outliers(const Params& params);

/// The attribute among these that the action writes, also where it is called as other programs do, such as
/// "Classification" (las_name); else the name of a new one. Empty where the action writes none.
POINTFAIR_EXPORT std::string outlier_attribute(const OutlierAction& action, std::span<const AttributeInfo> attributes);

/// What an action came to.
struct OutlierOutcome {
  std::array<std::uint64_t, 4> of_reason{};  ///< points by reason: no outlier, isolated, off the surface, mixed pixel
  std::uint64_t low = 0, high = 0;           ///< outliers in class 7 and 18, where none was named
  std::uint64_t in_old_classes = 0;          ///< outliers of files with FileInfo::has_old_classes
  /// Outliers whose class was one of vegetation or wires (3 to 5, 13 to 16), where outliers cannot be told.
  std::uint64_t thin = 0;

  std::uint64_t outliers() const { return of_reason[1] + of_reason[2] + of_reason[3]; }
  friend bool operator==(const OutlierOutcome&, const OutlierOutcome&) = default;
};

/// Puts outliers into their classes or sets their flag, in `cloud.added`; removes none: without_points() does.
/// `reasons` as Pipeline::outliers, one for each point; `before`: where points were, ignored ones as NaN. An outlier is
/// low or high noise by the mean height of the points that are none in its cell of the plane; cells hold some 16
/// points, and are at least so wide that there are not more than 2^19; where its own holds none, the next larger that
/// does counts. Throws ErrorKind::usage if the numbers of points differ, or if the cloud's own attribute is not one
/// byte a point. O(N log N) at most; 24 MB beside two bytes a point.
POINTFAIR_EXPORT OutlierOutcome act_on_outliers(const OutlierAction& action, std::span<const std::uint8_t> reasons,
                                                std::span<const Point> before, Cloud& cloud);

}  // namespace pointfair
