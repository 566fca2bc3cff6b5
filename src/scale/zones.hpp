// SPDX-License-Identifier: Apache-2.0
// Zones of a wide cloud. Floats around one origin step too coarsely where that is far: 8 mm at 128 km. So space is cut
// into cubes by a grid, the zones, and the points of each are computed relative to its middle, with what lies around
// them. The grid follows from the set of points alone, and no result depends on the tiles.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "io/offset.hpp"
#include "io/source.hpp"
#include "tiles/halo.hpp"

namespace pointfair::scale {

/// A cube of the grid, by its place along each axis.
using Zone = std::array<std::int32_t, 3>;

struct Zones {
  Position origin{};  ///< of the cloud as a whole, in the coordinates of the files
  double side = 0;    ///< of a zone: a power of two. 0: one zone, all of space around the origin

  bool are_several() const { return side > 0; }
  Zone zone_of(const Position& p) const;
  /// What the points of a zone are relative to.
  Position middle_of(const Zone& zone) const;
  /// The largest step of floats in a zone.
  double float_step() const { return side * 0x1p-25; }
  friend bool operator==(const Zones&, const Zones&) = default;
};

/// A float offset from one origin as one from another that lies `shift` before it. Monotone: boxes stay boxes.
inline float shifted(float offset, double shift) { return static_cast<float>(offset + shift); }
inline Point shifted(const Point& p, const Position& shift) {
  return {shifted(p.x, shift[0]), shifted(p.y, shift[1]), shifted(p.z, shift[2])};
}
inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// The offset of a point from an origin.
inline Point offset(const Position& p, const Position& origin) {
  return {io::to_offset(p[0], origin[0]), io::to_offset(p[1], origin[1]), io::to_offset(p[2], origin[2])};
}
inline Position difference(const Position& a, const Position& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// Where a point is relative to the middle of its zone, `before` it moved from position p to q. Doubles far from 0 have
/// fewer digits than floats near the middle, so that this is not always the offset that q was made of.
inline Point moved_offset(const Point& before, const Position& p, const Position& q) {
  const auto along = [](float b, double from, double to) {
    return from == to || !std::isfinite(from) ? b : static_cast<float>(b + (to - from));
  };
  return {along(before.x, p[0], q[0]), along(before.y, p[1], q[1]), along(before.z, p[2], q[2])};
}

/// The step between the coordinates that the file can hold: 0 if it is not known, infinite for coordinates that are
/// floats already, from which an origin takes no digit.
double coordinate_step(const Source& source);

/// The step of floats around the origin where all but strays of a sample lie, one of which is finite at least.
double float_step_around(std::vector<Position> sample, const Position& origin);

/// The side of the zones of a cloud, 0 if it needs none: it needs zones where more than a hundredth of its points lie
/// so far from its origin that floats step by more than the file's coordinates, and by more than 1/128 of the spacing,
/// or 1/32 where the file's own steps are unknown or below 1/1024 of the spacing.
/// `sample`: all of so many points, or io::kSampledPositions of them by their hashes. O(sample^2) at worst.
double zone_side(std::vector<Position> sample, std::uint64_t points, const Position& origin, double coordinate_step);

/// Those of a cloud in memory; one where there is no file behind it, whose points are floats.
Zones zones_of(const Cloud& cloud);

/// What the stages read, where the settings hold for offsets from the cloud's origin, for offsets from another one: the
/// middle of a zone.
CopyRule relative_to(const Position& origin, CopyRule rule, const Zones& zones);
FramedSettings relative_to(const Position& origin, const FramedSettings& stages, const Zones& zones);

}  // namespace pointfair::scale
