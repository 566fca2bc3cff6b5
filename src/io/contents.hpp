// SPDX-License-Identifier: Apache-2.0
// What a file may hold beside positions, and which format has a place for it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pointfair/io.hpp"

namespace pointfair {

struct Cloud;

namespace io {

/// The kinds of things, in the order in which notes name them.
enum class ContentKind : std::uint8_t {
  colors,
  fine_colors,    ///< of more than 8 bits
  some_colors,    ///< some points have none
  normals,        ///< of points
  numbers,        ///< further attributes
  intensity,      ///< that is not whole numbers from 0 to 65535
  names,          ///< of attributes
  wide_integers,  ///< with more digits than a double has
  text,           ///< columns of words
  lists,          ///< of numbers, any count of them at each point
  faces,
  face_values,          ///< of faces, beside their corners
  elements,             ///< edges, strips, lines, cameras and so on
  texture_coordinates,  ///< of corners
  corner_normals,       ///< that differ between the faces of a point
  materials,            ///< and names of images
  groups,               ///< names of parts
  comments,
  coordinate_system,
  poses,    ///< of sensors
  grid,     ///< rows and columns of the sensor
  records,  ///< images, waveforms, descriptions, whatever else
  invalid_points,
};
inline constexpr std::size_t kContentKinds = static_cast<std::size_t>(ContentKind::invalid_points) + 1;

/// Something that a file holds, in words that a sentence takes: "the edges", "12 comments".
struct Content {
  ContentKind kind;
  std::string what;
};

/// "1 comment", "12 comments".
std::string counted(std::uint64_t count, const std::string& what);

/// What the cloud and its file hold. Where digits are at stake, values are looked at.
std::vector<Content> contents_of(const Cloud& cloud);

/// What a new file of the format does with things of a kind.
enum class Keeps : std::uint8_t { kept, noted, refused };
Keeps keeps(Format format, ContentKind kind);

/// Whether the cloud is written to this format, in this encoding or its file's, as a copy of its file. STL files in
/// another encoding are new ones, and NumPy arrays with further attributes.
bool is_copied(const Cloud& cloud, Format format, std::optional<Encoding> encoding = {});
/// Formats that are one: plain columns of numbers may go by either name, and LAZ is compressed LAS.
Format family(Format format);
/// Whether the cloud's file has this format, or one of its family.
bool is_of(const Cloud& cloud, Format format);

}  // namespace io
}  // namespace pointfair
