// SPDX-License-Identifier: Apache-2.0
// Which points move, and by how much. Limits act on the result of a run: points outside keep their place, but still
// count as neighbours of points inside. Only ignored points are left out of the run itself.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"
#include "pointfair/selection.hpp"

namespace pointfair {

/// An axis-aligned box in file coordinates. Its faces belong to it.
struct Box {
  std::array<double, 3> min{}, max{};
  friend bool operator==(const Box&, const Box&) = default;
};

/// The points inside a polygon that was drawn on a view of the cloud.
struct Lasso {
  /// Rows of the 3 x 4 matrix from file coordinates to the view: (x, y, w) = M (X, Y, Z, 1). A position appears at
  /// (x / w, y / w) if w > 0, and nowhere else.
  std::array<double, 12> camera{};
  std::vector<std::array<double, 2>> polygon;  ///< 3 to 256 corners in the view; even-odd rule
  friend bool operator==(const Lasso&, const Lasso&) = default;
};

/// A point moves only if every limit that is set lets it move.
struct Limits {
  double strength = 1;  ///< blends the result with the input: 0 is the input, 1 the result
  std::optional<Box> box{};
  std::optional<Lasso> lasso{};
  std::vector<Selection> where{};    ///< only points that each of them contains move
  std::vector<Selection> ignore{};   ///< points that one of them contains do not move, and are nobody's neighbours
  std::vector<std::uint8_t> mask{};  ///< 1 for each point that may move, else 0; empty: all
  friend bool operator==(const Limits&, const Limits&) = default;
};

/// The names of the limits, as set_limit and the flags of the command line have them.
inline constexpr std::array<std::string_view, 5> kLimitNames{"strength", "box", "lasso", "where", "ignore"};

/// Sets a limit from its text: strength "0.5"; box "x,y,z,x,y,z", lower corner and upper corner; lasso "12 numbers of
/// the matrix:x,y,x,y,..."; where and ignore as parse_selections. An empty text removes the limit. Throws
/// ErrorKind::usage with the name and the expected form.
POINTFAIR_EXPORT void set_limit(Limits& limits, std::string_view name, std::string_view text);

/// The text of a limit, which set_limit reads back as the same values; empty if the limit is not set.
POINTFAIR_EXPORT std::string limit_text(const Limits& limits, std::string_view name);

/// The cloud that a run should be given: a copy in which the ignored points are NaN, and so nobody's neighbours;
/// apply_limits gives them their places back. O(N). Throws as selected_points.
POINTFAIR_EXPORT Cloud without_ignored(const Limits& limits, const Cloud& cloud);

/// 1 for each point of the cloud that may move, else 0; empty if all may. O(N), with a lasso O(N * corners). Throws
/// ErrorKind::usage as selected_points, and if the mask does not have one value for each point.
POINTFAIR_EXPORT std::vector<std::uint8_t> movable_points(const Limits& limits, const Cloud& cloud);

/// Applies the limits to `after`, the result of a run on `before`. `movable` is what movable_points returned. Throws
/// ErrorKind::usage if the numbers of points differ. O(N).
POINTFAIR_EXPORT void apply_limits(const Limits& limits, std::span<const std::uint8_t> movable,
                                   std::span<const Point> before, std::span<Point> after);

/// The same of whole clouds, with all digits of their positions.
POINTFAIR_EXPORT void apply_limits(const Limits& limits, std::span<const std::uint8_t> movable, const Cloud& before,
                                   Cloud& after);

/// movable_points and apply_limits in one call.
POINTFAIR_EXPORT void apply_limits(const Limits& limits, const Cloud& before, Cloud& after);

}  // namespace pointfair
