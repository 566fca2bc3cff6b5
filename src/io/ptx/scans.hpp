// SPDX-License-Identifier: Apache-2.0
// The scans of a PTX file: where their points stand in the text, and their poses.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/text_source.hpp"
#include "pointfair/positions.hpp"

namespace pointfair::io::ptx {

/// From a scan's coordinates to those that all scans share: the row (x, y, z, 1) times the 4 x 4 matrix of the header.
struct Pose {
  std::array<Position, 3> axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};     ///< where the scan's x, y and z point
  std::array<Position, 3> inverse{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  ///< of `axes`
  Position translation{};
  bool is_identity = true;

  /// A direction, without the translation.
  static Position turned(const std::array<Position, 3>& by, const Position& direction);
  Position to_shared(const Position& own) const;
  Position to_own(const Position& shared) const;
};

struct Scan {
  std::uint64_t columns = 0, rows = 0;
  Position scanner{};  ///< where the header says that the scanner stood
  Pose pose;
  std::vector<std::string> value_names;  ///< of what follows x, y, z in a row

  std::uint64_t count() const { return columns * rows; }
  /// Whether the header is more than what programs write that know nothing.
  bool has_place() const { return !pose.is_identity || scanner != Position{}; }
};

struct Layout {
  std::vector<Scan> scans;
  TextLayout text;                         ///< with the values of all scans
  std::vector<std::size_t> scan_of_block;  ///< of the text
};

/// Throws Error(file) for a header that is none, and for a text that ends before its last point.
Layout find_scans(std::string_view text, const std::string& name);

/// Whether a text begins as a PTX file does: two counts, the scanner's place and axes, a matrix.
bool looks_like_ptx(std::string_view text);

}  // namespace pointfair::io::ptx
