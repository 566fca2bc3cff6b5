// SPDX-License-Identifier: Apache-2.0
// Positions in the caller's memory: from doubles to a cloud, and from a result back to doubles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"

namespace pointfair {

/// A position in double, x, y, z.
using Position = std::array<double, 3>;

/// The origin that `read` chooses for a binary file of these positions: 0 on each axis where coordinates are not large
/// against the extent. It does not depend on the order of the positions. O(N).
POINTFAIR_EXPORT Position choose_origin(std::span<const Position> positions);
POINTFAIR_EXPORT Position choose_origin(std::span<const Point> positions);

/// The same of many clouds, of which cloud i has the positions offsets[i] to offsets[i + 1].
POINTFAIR_EXPORT std::vector<Position> choose_origins(std::span<const Point> positions,
                                                      std::span<const std::uint64_t> offsets);

/// The same from a sample that depends on the positions and not on their order, where these are not in host memory.
/// O(sample).
POINTFAIR_EXPORT Position choose_origin_by_sample(std::vector<Position> sample);

/// A cloud of these positions, as `read` makes it of a binary file of them. O(N).
POINTFAIR_EXPORT Cloud make_cloud(std::span<const Position> positions);

/// Whether the cloud is too wide for floats around one origin (docs/scale.md), so that a run on it may have zones, and
/// other bits than one on its points alone, as in Pipeline::run_many. O(1): by a sample.
POINTFAIR_EXPORT bool needs_zones(const Cloud& cloud);

/// The positions of a cloud, as `write` writes them: a coordinate of the cloud's file keeps all its digits, and a moved
/// one is the file's value plus the displacement. Throws ErrorKind::usage if `out` has another size. O(N).
POINTFAIR_EXPORT void positions(const Cloud& cloud, std::span<Position> out);

/// Gives the points these positions, with all their digits: afterwards `positions` returns them. If they do not survive
/// as floats relative to the cloud's origin, the cloud gets another origin and keeps them in double, 24 bytes a point.
/// All else of the cloud's file stays. In its own format a coordinate that is as in the file keeps its bytes, and a
/// file of floats is written anew, in double and without comments, where they would be large against the extent.
/// Throws ErrorKind::usage if `wanted` has another size. O(N).
POINTFAIR_EXPORT void set_positions(Cloud& cloud, std::span<const Position> wanted);

/// The type that holds the positions of a cloud without loss, float32 or float64.
POINTFAIR_EXPORT ScalarType position_type(const Cloud& cloud);

/// Adds to each coordinate how far it moved: `before` is what make_cloud made of `positions`, `after` the result of a
/// run on it. A coordinate that did not move keeps its bits. Throws ErrorKind::usage if the sizes differ. O(N).
POINTFAIR_EXPORT void move_positions(const Cloud& before, std::span<const Point> after, std::span<Position> positions);

}  // namespace pointfair
