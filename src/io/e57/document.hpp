// SPDX-License-Identifier: Apache-2.0
// What an E57 file says of its scans: its header, and the XML section that describes them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace pointfair::io::e57 {

/// Attributes that the standard has no name for are fields of an extension, and so have a prefix in the file.
inline constexpr const char *kOwnPrefix = "pf:", *kOwnUri = "urn:pointfair:attributes";

/// Where the sections of the file are.
struct FileHeader {
  std::uint64_t xml_begin = 0;   ///< logical
  std::uint64_t xml_length = 0;  ///< logical
  bool xml_is_last = false;      ///< nothing but the rest of its page follows it
};

/// Throws Error(file) for what is no E57 file, or is cut off.
FileHeader parse_file_header(std::string_view file, const std::string& name);
std::string read_xml(std::string_view file, const FileHeader& header);

/// One field of the records of a scan: as it is stored, bit after bit in a stream of its own.
struct Field {
  enum class Kind : std::uint8_t { float32, float64, integer, other };
  std::string name;
  Kind kind = Kind::other;  ///< other: text, which is not read
  std::int64_t minimum = 0, maximum = 0;
  double scale = 1, offset = 0;  ///< value = integer * scale + offset
  bool scaled = false;           ///< a ScaledInteger
  unsigned bits = 0;             ///< of a record, 0 to 64
};

/// From a scan's coordinates to those that all scans share.
struct Pose {
  std::array<std::array<double, 3>, 3> rotation{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  std::array<double, 3> translation{};
  bool is_identity = true;
};

struct Scan {
  Pose pose;
  bool has_pose = false;
  bool is_described = false;  ///< it has a name, or says which sensor made it, when
  std::uint64_t records = 0;
  std::uint64_t section_begin = 0;  ///< of its compressed points, logical
  std::vector<Field> fields;
  std::optional<std::array<std::size_t, 3>> cartesian;  ///< which fields are x, y, z
  std::optional<std::array<std::size_t, 3>> spherical;  ///< which are range, azimuth, elevation
  std::optional<std::size_t> invalid_state;             ///< which says that the coordinates mean nothing
};

struct Document {
  std::vector<Scan> scans;
  std::uint64_t images = 0;
  std::string library;              ///< the software that wrote the file
  std::string coordinate_metadata;  ///< the coordinate system as WKT, usually empty
};

/// Throws Error(file) for XML that is damaged or describes scans without coordinates.
Document parse_document(const std::string& xml, const std::string& name);

}  // namespace pointfair::io::e57
