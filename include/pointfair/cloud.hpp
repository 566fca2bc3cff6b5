// SPDX-License-Identifier: Apache-2.0
// A point cloud: float offsets from a double origin, and everything else its file said.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace pointfair {

/// What went wrong, and so what a program should do about it.
enum class ErrorKind : std::uint8_t {
  failed,       ///< anything not named below
  usage,        ///< an argument is out of range or contradicts another
  file,         ///< a file cannot be read, written or understood
  memory,       ///< host or device memory does not suffice
  device,       ///< the requested device is not there or cannot be used
  interrupted,  ///< the caller's stop token was triggered
};

/// The one exception of this library. `what()` is one sentence: what was wrong, where, and what to do.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
  ErrorKind kind() const noexcept { return kind_; }

 private:
  ErrorKind kind_;
};

/// A position as offset from `Cloud::origin`, in the file's unit. A NaN or infinite coordinate marks an invalid point.
struct Point {
  float x, y, z;
};

enum class ScalarType : std::uint8_t { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

/// Bytes of one scalar of `type`: 1, 2, 4 or 8.
std::size_t size_of(ScalarType type) noexcept;

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
  std::array<double, 3> origin{};  ///< added to every point; 0 unless coordinates are large against the extent
  std::vector<Point> points;       ///< N offsets, in the order of the file
  std::vector<Attribute> added;    ///< attributes that the file did not have, written after its own; or new values
                                   ///< for one that it has, under its name and with as many values a point
  std::shared_ptr<const Source>
      source;  ///< the file's own attributes, faces, comments; null for a cloud made in memory
};

/// The attributes of the cloud's file and then the added ones, coordinates excluded. Costs nothing per point, but the
/// first call for columns of text reads them once to learn their types.
std::vector<AttributeInfo> attributes(const Cloud& cloud);

/// The values of the attribute `name`. Throws ErrorKind::usage if there is none. O(N).
Attribute attribute(const Cloud& cloud, std::string_view name);

/// The faces of the cloud's file as triangles of point indices (polygons as fans); empty for a plain cloud. O(faces).
std::vector<std::array<std::uint32_t, 3>> triangles(const Cloud& cloud);

}  // namespace pointfair
