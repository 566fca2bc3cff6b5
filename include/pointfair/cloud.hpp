// SPDX-License-Identifier: Apache-2.0
// A point cloud: float positions relative to a double origin, and everything else that its file holds.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "pointfair/export.hpp"

namespace pointfair {

/// What went wrong; a program can decide by it what to do.
enum class ErrorKind : std::uint8_t {
  failed,       ///< anything not named below
  usage,        ///< an argument is out of range or contradicts another one
  file,         ///< a file cannot be read, written or understood
  memory,       ///< the host or the device has too little memory
  device,       ///< the requested device is missing or cannot be used
  interrupted,  ///< the caller's stop token was triggered
};

/// The only exception that this library throws. `what()` is one line: what is wrong, where, and what to do.
class POINTFAIR_EXPORT Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
  ErrorKind kind() const noexcept { return kind_; }

 private:
  ErrorKind kind_;
};

/// A position relative to `Cloud::origin`, in the file's unit. A NaN or infinite coordinate marks an invalid point.
struct Point {
  float x, y, z;
};
inline bool is_finite(const Point& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

/// The types of attributes.
enum class ScalarType : std::uint8_t { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

/// Bytes of one scalar of `type`: 1, 2, 4 or 8.
POINTFAIR_EXPORT std::size_t size_of(ScalarType type) noexcept;

/// Name and shape of a per-point attribute.
struct AttributeInfo {
  std::string name;
  ScalarType type = ScalarType::float32;
  std::uint32_t components = 1;  ///< values per point; 3 for a normal
};

/// A per-point attribute with its values: `components` scalars a point, point after point, native byte order.
struct Attribute : AttributeInfo {
  std::vector<std::byte> data;  ///< points * components * size_of(type) bytes
};

class Source;  // the parsed file behind a cloud; see src/io/source.hpp

/// N points. A value: copies are independent, and share only the immutable `source`.
struct Cloud {
  std::array<double, 3> origin{};          ///< added to every point; 0 unless coordinates are large against the extent
  std::vector<Point> points{};             ///< N positions relative to the origin, in the order of the file
  std::vector<Attribute> added{};          ///< attributes that the file does not have, written after the file's own; or
                                           ///< new values for one that it has, with the same name and components
  std::shared_ptr<const Source> source{};  ///< the file's own attributes, faces, comments; null without a file
};

/// Names and types of the attributes: first those of the cloud's file without the coordinates, then the added ones.
/// O(1) in the points, except that the first call on a text file reads its columns once to learn their types.
POINTFAIR_EXPORT std::vector<AttributeInfo> attributes(const Cloud& cloud);

/// Name and shape of the attribute `name`; nothing if there is none.
POINTFAIR_EXPORT std::optional<AttributeInfo> attribute_info(const Cloud& cloud, std::string_view name);

/// The attribute that a user means by `name`: the one of this name; else the only one whose name differs in upper and
/// lower case alone, or for which LAS files have this name (`las_name`). Nothing if there is none, or there are
/// several.
POINTFAIR_EXPORT std::optional<AttributeInfo> meant_attribute(const Cloud& cloud, std::string_view name);

/// The values of the attribute `name`. Throws ErrorKind::usage if there is none. O(N).
POINTFAIR_EXPORT Attribute attribute(const Cloud& cloud, std::string_view name);

/// The values of several attributes, in the order of `names`. A text file is read once for all of them, where
/// `attribute` reads it once for each. Throws ErrorKind::usage if the cloud lacks one. O(N) for each.
POINTFAIR_EXPORT std::vector<Attribute> attribute_values(const Cloud& cloud, std::span<const std::string> names);

/// One value of an attribute, whatever its type.
POINTFAIR_EXPORT double value_at(const Attribute& attribute, std::size_t point, std::uint32_t component = 0) noexcept;

/// Faces over the points of a cloud: face f has the corners [ends[f - 1], ends[f]), point indices, the first from 0.
struct Polygons {
  std::vector<std::uint64_t> ends;
  std::vector<std::uint32_t> corners;
  std::size_t size() const { return ends.size(); }
};

/// The faces of the cloud's file as they are: triangles, quads, polygons; empty if there are none. O(faces).
POINTFAIR_EXPORT Polygons polygons(const Cloud& cloud);

/// The faces of the cloud's file as triangles of point indices, polygons as fans; empty if there are none. O(faces).
POINTFAIR_EXPORT std::vector<std::array<std::uint32_t, 3>> triangles(const Cloud& cloud);

}  // namespace pointfair
