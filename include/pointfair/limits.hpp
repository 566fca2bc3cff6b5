// SPDX-License-Identifier: Apache-2.0
// How far and where a run may move points. Limits act on a run's result: points outside are still neighbours of those
// inside, and keep their place. Only ignored points are kept from the run itself.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/selection.hpp"

namespace pointfair {

/// An axis-aligned box in the coordinates of the file, its faces included.
struct Box {
  std::array<double, 3> min{}, max{};
  friend bool operator==(const Box&, const Box&) = default;
};

/// What lies inside a polygon drawn over a picture of the cloud.
struct Lasso {
  /// Rows of the 3 x 4 matrix from file coordinates to the picture: (x, y, w) = M (X, Y, Z, 1). A position is seen at
  /// (x / w, y / w), and only where w > 0.
  std::array<double, 12> camera{};
  std::vector<std::array<double, 2>> polygon;  ///< corners in the picture, 3 to 256 of them; even-odd rule
  friend bool operator==(const Lasso&, const Lasso&) = default;
};

/// A point moves only where everything that is given lets it move.
struct Limits {
  double strength = 1;  ///< share of each displacement that is kept, 0 to 1
  std::optional<Box> box;
  std::optional<Lasso> lasso;
  std::vector<Selection> where;    ///< only points that each of them holds move
  std::vector<Selection> ignore;   ///< points that one of them holds do not move, and are nobody's neighbours
  std::vector<std::uint8_t> mask;  ///< 1 for each point that may move, else 0; empty: all
  friend bool operator==(const Limits&, const Limits&) = default;
};

/// The names of the limits that have a text: flags of the command line, keys of set_limit.
inline constexpr std::array<std::string_view, 5> kLimitNames{"strength", "box", "lasso", "where", "ignore"};

/// Reads a limit as the command line writes it: strength "0.5"; box "x,y,z,x,y,z" (lower corner, upper corner); lasso
/// "12 numbers of the matrix:x,y,x,y,..."; where and ignore as parse_selections; "" takes the limit away. Throws
/// ErrorKind::usage with name and form.
void set_limit(Limits& limits, std::string_view name, std::string_view text);

/// The limit as set_limit reads it, numbers in the shortest form that reads back the same; "" if there is none.
std::string limit_text(const Limits& limits, std::string_view name);

/// What a run is to be given: a copy of the cloud in which the ignored points are NaN, and so nobody's neighbours;
/// apply_limits gives them their places back. O(N); throws as selected_points.
Cloud without_ignored(const Limits& limits, const Cloud& cloud);

/// 1 for each point of the cloud that may move, else 0; empty if all may. O(N), O(N * corners) for a lasso. Throws
/// ErrorKind::usage as selected_points, and if the mask has not one value for each point.
std::vector<std::uint8_t> movable_points(const Limits& limits, const Cloud& cloud);

/// Limits the result `after` of a run on `before`. `movable` comes from movable_points. Throws ErrorKind::usage if the
/// numbers of points differ. O(N).
void apply_limits(const Limits& limits, std::span<const std::uint8_t> movable, std::span<const Point> before,
                  std::span<Point> after);

/// The same in one step.
void apply_limits(const Limits& limits, const Cloud& before, Cloud& after);

}  // namespace pointfair
