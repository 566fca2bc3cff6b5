// SPDX-License-Identifier: Apache-2.0
// The parsed file behind a cloud: the file's bytes as they are, and the knowledge of where each value lies in them.
// Writing to the same format copies the bytes and patches the coordinates that moved.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/contents.hpp"
#include "io/edits.hpp"
#include "io/faces.hpp"
#include "io/file_bytes.hpp"
#include "io/materials.hpp"
#include "io/origin_sample.hpp"
#include "io/output.hpp"
#include "io/scalar.hpp"
#include "pointfair/cloud.hpp"
#include "pointfair/file_info.hpp"
#include "pointfair/io.hpp"
#include "pointfair/positions.hpp"

namespace pointfair {

namespace io {

/// Name and shape of an attribute as the file has it.
struct Column {
  std::string name;
  NativeType type = NativeType::float32;
  std::uint32_t components = 1;
  bool guessed = false;  ///< the type is not the file's: any number may stand there
  bool scaled = false;   ///< the file stores integers, of which the values are multiples
  unsigned bits = 0;     ///< that a value has, where it is a part of a byte; 0: all of its type
};
/// Where a file's points are kept that must be decoded: in memory, or in the file, to be decoded when asked for.
enum class Residence : std::uint8_t { memory, file };

/// What a file says that has only some of the points that it was about: they stand in no grid.
inline FileInfo of_some_points(FileInfo info) {
  info.grid_width = info.grid_height = 0;
  return info;
}

inline std::size_t column_bytes(const Column& column) { return column.components * size_of(column.type); }

}  // namespace io

/// Where the points of one block are now, and which of their coordinates differ from the file's.
struct Moves {
  std::vector<Position> values;       ///< the file's own, or the moved ones
  std::vector<std::uint8_t> changed;  ///< bit a: coordinate a moved

  bool are_none() const {
    return std::ranges::all_of(changed, [](std::uint8_t axes) { return axes == 0; });
  }
};

/// Immutable once `place` was called. Points come in blocks, runs of consecutive points, the unit of parallel work.
class Source {
 public:
  Source(io::FileBytes bytes, std::string name, Format format, Encoding encoding)
      : bytes_(std::move(bytes)), name_(std::move(name)), format_(format), encoding_(encoding) {}
  virtual ~Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;

  const std::string& name() const { return name_; }
  Format format() const { return format_; }
  Encoding encoding() const { return encoding_; }
  std::uint64_t size() const { return block_begin(block_count()); }

  virtual std::size_t block_count() const = 0;
  /// Index of the first point of `block`; that of the block past the last is the number of points.
  virtual std::uint64_t block_begin(std::size_t block) const = 0;
  std::size_t block_size(std::size_t block) const {
    return static_cast<std::size_t>(block_begin(block + 1) - block_begin(block));
  }

  /// The file's own coordinates of the points of `block`.
  virtual void positions(std::size_t block, std::span<Position> out) const = 0;
  /// A shortcut: the same as points relative to 0. False: the file does not hold them in this form.
  virtual bool copy_points(std::size_t, std::span<Point>) const { return false; }
  /// Puts (0, 0, 0) back where the file has it for NaN of positions(): for other files.
  virtual void restore_empty_pixels(std::span<Position>) const {}
  /// The type that holds the file's coordinates without loss.
  virtual ScalarType coordinate_type() const = 0;
  /// Whether the file holds coordinates as 32-bit floats, which are coarse far from 0.
  bool stores_floats() const;

  /// Per-point attributes, coordinates excluded, in the order of the file.
  virtual std::vector<io::Column> columns() const = 0;
  /// The values of the attribute at `index` of `columns()`: size() * column_bytes of them.
  void extract(std::size_t index, std::span<char> out) const;
  /// Those of the points of `block`; after columns() was called.
  virtual void extract_block(std::size_t index, std::size_t block, std::span<char> out) const = 0;
  /// The values of several attributes, each in its place of `out`, which has one for each of `columns()`: for a text in
  /// one pass. What has an empty place is not wanted.
  void extract_several(std::span<const std::span<char>> out) const;
  /// Those of the points of `block`; after columns() was called.
  virtual void extract_several_of_block(std::size_t block, std::span<const std::span<char>> out) const;
  /// Gives all faces to the visitor, in their order.
  virtual void visit_faces(io::FaceVisitor&) const {}
  /// The materials of the faces, where a picture goes with the texture coordinates that the file has.
  virtual io::Materials materials() const { return {}; }
  /// Throws Error(file) where visit_faces() does.
  virtual io::FaceSummary face_summary() const;
  /// All of them in memory, with texture coordinates.
  Faces faces() const;

  /// Writes the file in its own format with the edits.
  virtual void write(const io::Edits& edits, Encoding encoding, io::Output& out) const;

  /// Whether the file's own format holds the positions as well as they are known.
  virtual bool holds_its_positions() const { return true; }
  /// Whether write() leaves out the points of Edits::removed.
  virtual bool leaves_points_out() const { return false; }
  /// Throws Error(usage) if the coordinates cannot be written in steps of `scale`: LAS files only are asked.
  virtual void check_las_scale(double) const {}

  /// Where the sensor of the points of `block` stood, in the file's coordinates, if the file says so.
  virtual std::optional<Position> sensor(std::size_t) const { return std::nullopt; }
  /// False: that place was found by the points alone.
  virtual bool says_sensor() const { return true; }
  /// What the file says beside its points.
  virtual FileInfo info() const { return {}; }
  /// Whether the coordinate system stands in GeoTIFF keys alone, as in older LAS files.
  virtual bool has_geotiff_keys() const { return false; }
  /// Why a copy of the file cannot have new values of an attribute; empty if it can.
  virtual std::string why_fixed(std::size_t) const { return {}; }
  /// What the file holds beside points, attributes and faces.
  virtual std::vector<io::Content> contents() const { return {}; }
  /// Names of attributes that follow from the number of columns, so that a copy with a further one loses them.
  virtual std::vector<std::string> names_by_place() const { return {}; }
  /// What of this file a copy in its own format and this encoding does not keep, a sentence each.
  virtual std::vector<std::string> losses(Encoding) const { return {}; }

  /// The same of the moves in a copy. Cost: at most one walk along the points.
  virtual std::vector<std::string> losses_of_moves(const io::Edits&) const { return {}; }

  /// Extensions of files that belong to this one, stand beside it, and stay true when its points move.
  virtual std::vector<std::string> companions() const { return {}; }

  /// The origin that suits a sample of the points, which does not depend on their order.
  Position sampled_origin() const;
  /// Chooses that origin, and returns the points relative to it.
  std::vector<Point> place();
  const Position& origin() const { return origin_; }
  /// What place() chose the origin by: io::OriginSample::take(). Empty before.
  const std::vector<Position>& sample() const { return sample_; }
  /// An origin that is chosen elsewhere, for files that are read in parts.
  void place_at(const Position& origin) { origin_ = origin; }
  /// The points of `block` relative to origin(), as place() returns them; their positions are offered to `sample`.
  void place_block(std::size_t block, std::span<Point> points, io::OriginSample& sample) const;
  /// Some positions from all over the file, which mostly show the origin.
  std::vector<Position> some_positions() const;

  Moves moves(std::size_t block, const io::Edits& edits) const;
  /// The same for points from `first` on, whose own coordinates these are.
  Moves moves(std::uint64_t first, std::vector<Position> own, const io::Edits& edits) const;

 protected:
  // What the usual `write` asks for.
  /// Everything before the first block, with the added attributes declared, and as many points as are left.
  virtual std::string header(const io::Edits&) const { return {}; }
  /// The bytes of `block` with moved coordinates and replaced attributes patched, added ones appended to each point.
  virtual void append_block(std::size_t, const Moves&, const io::Edits&, std::string&) const {}
  /// Takes the points of which `removed` is not 0 out of those bytes. For formats that can leave points out.
  virtual void take_out(std::span<const std::uint8_t>, const io::Edits&, std::string&) const {}
  /// Everything after the last block.
  virtual std::string_view tail() const { return {}; }

  std::string_view bytes() const { return bytes_.view(); }
  /// Throws Error(file) that names the line of a text in which `place` lies.
  [[noreturn]] void fail_at(const char* place, const std::string& message) const;
  /// What was read of a text is not held in memory beside what was made of it.
  void release_all() const { bytes_.release_all(); }
  void release(std::string_view part) const { bytes_.release(part); }

 private:
  static Point offset_of(const Position& value, const Position& origin);
  /// The points relative to origin(); returns a sample of their positions.
  std::vector<Position> place_at_origin(std::span<Point> points) const;

  io::FileBytes bytes_;
  std::string name_;
  Format format_;
  Encoding encoding_;
  Position origin_{};
  std::vector<Position> sample_;
};

namespace io {

/// The file beside this one that has its name and the extension, which may be in capitals; empty: there is none.
std::filesystem::path companion_of(const Source& source, const std::string& extension);
/// Throws Error(file) if the file says that X and Y are longitude and latitude.
void check_not_geographic(const Source& source);
/// That a cloud still has the points of its file, by number: what is stored beside them is told by it.
void check_has_points_of_file(const Cloud& cloud);

}  // namespace io
}  // namespace pointfair
