// SPDX-License-Identifier: Apache-2.0
// How the points of a LAZ file are compressed: the record of user "laszip encoded", chunks and their table.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/las/header.hpp"

namespace pointfair::io::las {

/// A part of each point that is compressed by rules of its own. The values are those of the file.
struct Item {
  enum Type : std::uint16_t {
    bytes = 0,
    point10 = 6,
    time11 = 7,
    color12 = 8,
    wave13 = 9,
    point14 = 10,
    color14 = 11,
    color_nir14 = 12,
    wave14 = 13,
    bytes14 = 14
  };
  std::uint16_t type = 0, size = 0, version = 0;
};

inline constexpr const char* kLaszipUser = "laszip encoded";
inline constexpr unsigned kLaszipId = 22204;
inline constexpr std::uint32_t kUsualChunk = 50000;

struct Compression {
  std::uint32_t chunk_points = kUsualChunk;  ///< 0: each chunk has its own number
  std::vector<Item> items;
  bool pointwise = false;  ///< all points are one chunk without a table, as LASzip wrote before 2.0

  bool layered() const { return items.front().type == Item::point14; }
  /// Of all items; waveforms of formats 4 and 5 have version 1 alone.
  unsigned version() const { return items.front().version; }
  void set_version(unsigned version);
  /// Bytes of a record: of all items.
  std::size_t record_length() const;
  /// Layers of a chunk, where there are such.
  std::size_t layers() const;
};

/// How a new file of such points is compressed.
Compression usual_compression(unsigned point_format, std::size_t record_length);

/// Reads the file's own. Throws Error(file) for what is not known.
Compression read_compression(const Header& header, const std::string& name);

/// The data of the record.
std::string compression_record(const Compression& compression);

struct Chunk {
  std::string_view bytes;
  std::uint64_t first_point = 0;
  std::uint32_t points = 0;
};

struct ChunkTable {
  std::vector<Chunk> chunks;
  std::size_t begin = 0, end = 0;  ///< of the table in the file
};

/// Finds the chunks of all points. Throws Error(file) if they are not there.
ChunkTable read_chunk_table(std::string_view bytes, const Header& header, const Compression& compression,
                            const std::string& name);

/// The table for chunks of these sizes in bytes and points.
std::string chunk_table(const Compression& compression, std::span<const std::size_t> sizes,
                        std::span<const std::uint32_t> points);

/// Appends whole points, as many as fit in `records`, as a chunk. Chunks are independent of each other: any number of
/// threads may encode at once.
void encode_chunk(const Compression& compression, std::span<const char> records, std::string& to);

}  // namespace pointfair::io::las
