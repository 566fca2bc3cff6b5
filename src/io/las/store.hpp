// SPDX-License-Identifier: Apache-2.0
// Where the points of a LAS or LAZ file are: in the file, in memory, or still compressed. They come in blocks, which in
// a LAZ file are its chunks.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/las/grid.hpp"
#include "io/las/header.hpp"
#include "io/las/layers.hpp"
#include "io/las/laz.hpp"
#include "io/source.hpp"

namespace pointfair::io::las {

/// What was decoded of a block, so that the next question about this block does not decode it again. For one store.
struct Decoded {
  std::optional<std::size_t> block;
  std::string records;           ///< of point formats 0 to 5
  std::vector<Returns> returns;  ///< of 6 to 10
};

class PointStore {
 public:
  virtual ~PointStore() = default;

  virtual std::size_t block_count() const = 0;
  /// Index of the first point of the block; that of the block past the last is the number of points.
  virtual std::uint64_t block_begin(std::size_t block) const = 0;
  std::size_t block_size(std::size_t block) const {
    return static_cast<std::size_t>(block_begin(block + 1) - block_begin(block));
  }

  virtual void grid(std::size_t block, std::span<Grid> out, Decoded& decoded) const = 0;
  /// The records of the block; `decoded` may hold them. Where layers are apart, only the bytes `wanted` are right.
  virtual std::string_view records(std::size_t block, ByteRange wanted, Decoded& decoded) const = 0;
  /// The block compressed, as it is in the file; empty if it is not.
  virtual std::string_view chunk(std::size_t) const { return {}; }
  /// Appends the block compressed with these coordinates and all else as it is. False: it must be compressed anew.
  virtual bool append_moved_chunk(std::size_t, std::span<const Grid>, Decoded&, std::string&) const { return false; }
};

/// The points of an uncompressed file, in the file. Throws Error(file) if they are not all there.
std::unique_ptr<PointStore> open_records(std::string_view bytes, const Header& header, const std::string& name);

/// The points of a file that are compressed in one piece, `chunk`: all decoded, a record a point. Throws Error(file) if
/// it is damaged.
std::unique_ptr<PointStore> decode_pointwise(std::string_view chunk, const Header& header,
                                             const Compression& compression, std::size_t file_size,
                                             const std::string& name);

/// The points of a compressed file: of point formats 0 to 5 all decoded, of 6 to 10 the coordinates. In parallel.
/// Throws Error(file) if a chunk is damaged. Memory: a record, or 14 bytes, a point. Where that is more than
/// `most_kept` bytes, and with Residence::file, no point is held: a chunk is decoded when it is asked for, and may
/// throw then.
std::unique_ptr<PointStore> decode_chunks(std::vector<Chunk> chunks, const Header& header,
                                          const Compression& compression, std::size_t file_size,
                                          const std::string& name, Residence residence,
                                          std::uint64_t most_kept = std::uint64_t{1} << 30);

}  // namespace pointfair::io::las
