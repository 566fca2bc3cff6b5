// SPDX-License-Identifier: Apache-2.0
// What a LAS or LAZ file says before and behind its points: the public header block and the variable length records.
// LAS 1.0 to 1.5. Whoever writes keeps the bytes, so only what is needed is read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/las/grid.hpp"
#include "io/scalar.hpp"

namespace pointfair::io::las {

template <class T>
T get(std::string_view bytes, std::size_t place) {
  return load_little<T>(bytes.data() + place);
}
template <class T>
void put(std::string& bytes, std::size_t place, T value) {
  store_little(bytes.data() + place, value);
}
/// The coordinates with which a record begins.
inline Grid get_grid(const char* record) {
  return {load_little<std::int32_t>(record), load_little<std::int32_t>(record + 4),
          load_little<std::int32_t>(record + 8)};
}
inline void put_grid(const Grid& grid, char* record) {
  for (std::size_t axis = 0; axis < 3; ++axis) store_little(record + 4 * axis, grid[axis]);
}
/// Text that ends at a zero byte or fills its place.
inline std::string_view get_text(std::string_view bytes, std::size_t place, std::size_t size) {
  const std::string_view text = bytes.substr(place, size);
  return text.substr(0, text.find('\0'));
}

/// Places in the public header block.
namespace place {
inline constexpr std::size_t source = 4, global_encoding = 6, major = 24, minor = 25, system = 26, software = 58,
                             day = 90, year = 92, header_size = 94, points_begin = 96, record_count = 100,
                             point_format = 104, record_length = 105, legacy_count = 107, legacy_returns = 111,
                             scale = 131, offset = 155, bounds = 179, waveform_begin = 227, extended_begin = 235,
                             extended_count = 243, count = 247, returns = 255;
}  // namespace place

/// The system of new files.
inline constexpr std::string_view kOwnSystem = "pointfair";

/// A variable length record: among those before the points or, `extended`, behind them.
struct Record {
  std::string user;
  unsigned id = 0;
  std::size_t begin = 0;  ///< of the record in the file
  std::string_view data;
  bool extended = false;

  bool is(std::string_view wanted_user, unsigned wanted_id) const { return user == wanted_user && id == wanted_id; }
  std::size_t end() const { return begin + (extended ? 60 : 54) + data.size(); }
};

struct Header {
  unsigned minor = 0;  ///< LAS 1.minor
  std::size_t size = 0;
  std::size_t points_begin = 0;
  unsigned point_format = 0;  ///< 0 to 10
  bool compressed = false;
  std::size_t record_length = 0;
  std::uint64_t count = 0;  ///< of points
  Scaling scaling;
  std::vector<Record> records;
  std::size_t records_end = 0;     ///< of those before the points; where fewer were found than are promised, what
                                   ///< follows them up to the points is kept unread
  std::size_t extended_begin = 0;  ///< 0: none
  std::size_t waveform_begin = 0;  ///< of waveform packets in this file; 0: none

  const Record* find(std::string_view user, unsigned id) const;
};

/// Bytes of a record, from `begin` up to `end`.
struct ByteRange {
  std::size_t begin = 0, end = 0;

  bool meets(const ByteRange& other) const { return begin < other.end && other.begin < end; }
};

/// Bytes of a record of the point format without extra bytes.
std::size_t least_record_length(unsigned point_format);

/// Throws Error(file) with `name` for what is no header of a file with points.
Header parse_header(std::string_view bytes, const std::string& name);

}  // namespace pointfair::io::las
