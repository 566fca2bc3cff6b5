// SPDX-License-Identifier: Apache-2.0
// What the two kinds of STL files share.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "io/source.hpp"

namespace pointfair::io::stl {

/// What new files are called; a binary one not "solid", by which files of text are known.
inline constexpr std::string_view kOwnName = "pointfair", kOwnTitle = "binary STL written by pointfair";

/// The corners of a facet are the points 3 f, 3 f + 1 and 3 f + 2.
void visit_facets(std::uint64_t facets, FaceVisitor& visitor);

/// The unit normal of the three corners from `first` on, as floats; zero for a facet without an area.
std::array<float, 3> normal_of(std::span<const Position> corners, std::size_t first);

/// Whether one of a facet's corners moved.
inline bool has_moved(const Moves& moves, std::size_t first) {
  return (moves.changed[first] | moves.changed[first + 1] | moves.changed[first + 2]) != 0;
}

/// Whether the size of the file is that of a binary one with so many facets as it says.
bool is_binary(std::string_view bytes);

std::shared_ptr<Source> read_binary(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_text(FileBytes bytes, const std::string& name);

}  // namespace pointfair::io::stl
