// SPDX-License-Identifier: Apache-2.0
// Reads and writes whole files. Everything that a file holds beside coordinates survives byte for byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"

namespace pointfair {

/// The file formats; the extension of each has its name. `kitti` and `nuscenes` are the plain floats of these data
/// sets, ".bin" files that nothing but ReadOptions::format tells apart; `copc` is written only, and read as `laz`.
enum class Format : std::uint8_t {
  ply,
  pcd,
  xyz,
  txt,
  csv,
  pts,
  off,
  obj,
  las,
  laz,
  e57,
  ptx,
  stl,
  npy,
  glb,
  kitti,
  nuscenes,
  copc
};

/// How numbers are written. PLY and PCD have several encodings, STL has `ascii` and `binary`, the text formats have
/// `ascii` only, LAZ and COPC `binary_compressed`, and all others `binary`.
enum class Encoding : std::uint8_t { ascii, binary, binary_big_endian, binary_compressed };

/// How to read.
struct ReadOptions {
  std::optional<Format> format{};  ///< unset: by content, then by extension
  unsigned threads = 0;            ///< 0: all cores
  /// Of XYZ, TXT, CSV and PTS: names of the columns from the left, "x", "y" and "z" among them; empty: as the file
  /// says.
  std::vector<std::string> columns = {};
  std::uint64_t skip_lines = 0;  ///< of the same: lines at the front that are kept and not looked at
};

/// How to write.
struct WriteOptions {
  std::optional<Format> format{};      ///< unset: by extension
  std::optional<Encoding> encoding{};  ///< unset: the source's if the format is the same, else binary if there is one
  /// Step of the coordinates of LAS and LAZ, in the file's unit: a whole part of the source's own; unset: the source's,
  /// else fine enough for floats.
  std::optional<double> las_scale{};
  bool overwrite = false;  ///< false: an existing file is an error
  bool strict = false;     ///< true: what the file cannot keep is an error, ErrorKind::file
  bool sync = false;       ///< true: fsync before the file gets its name
  unsigned threads = 0;    ///< 0: all cores
};

/// Reads a whole file; the path "-" is standard input. Returns the points in file order, invalid ones included.
/// Coordinates far from zero are stored relative to `Cloud::origin`. Throws ErrorKind::file with path, place and
/// reason. Memory: 12 bytes a point, and the file. A regular file is mapped and not copied: it may be replaced or
/// removed while the cloud lives, but it must not be shortened in place.
POINTFAIR_EXPORT Cloud read(const std::filesystem::path& path, const ReadOptions& options = {});

/// Reads the bytes of a file from memory and copies them. `name` appears in errors. If `options.format` is unset, the
/// content decides.
POINTFAIR_EXPORT Cloud read(std::span<const std::byte> bytes, const std::string& name, const ReadOptions& options = {});

/// Writes the cloud; the path "-" is standard output. In the source's own format, the result is a copy of the source in
/// which only the coordinates of moved points differ, with the added attributes appended. In another format, the result
/// has every attribute that the format can hold. A coordinate is the source's own value plus the displacement, in the
/// source's own type, so a point that did not move keeps its bytes. The file gets its name only when it is complete.
/// Throws ErrorKind::file.
POINTFAIR_EXPORT void write(const std::filesystem::path& path, const Cloud& cloud, const WriteOptions& options = {});

/// Throws ErrorKind::usage or file for what `write` would refuse in these options, this name or this cloud, before a
/// long computation rather than after it: an encoding or a scale that the format cannot have, for instance. Points that
/// are yet to move may still leave the range of a LAS file. Cost: one look at each point.
POINTFAIR_EXPORT void check_write(const std::filesystem::path& path, const Cloud& cloud,
                                  const WriteOptions& options = {});

/// The bytes that `write` would write.
POINTFAIR_EXPORT std::vector<std::byte> write_bytes(const Cloud& cloud, Format format,
                                                    std::optional<Encoding> encoding = {});

/// Removes the temporary files of all writes in progress. Async-signal-safe: for the handler of a signal that ends the
/// program. A `write` that is still running fails with ErrorKind::file afterwards.
POINTFAIR_EXPORT void remove_unfinished_files() noexcept;

/// The format of the path's extension, ".ply" or ".PLY" for instance, or nothing if no format has it.
POINTFAIR_EXPORT std::optional<Format> format_of(const std::filesystem::path& path);

/// The format in which `write` writes a file of this name: that of its extension, else `source`. Throws ErrorKind::file
/// if neither is known. A name that ends in ".copc.laz" is that of a COPC file.
POINTFAIR_EXPORT Format format_to_write(const std::filesystem::path& path, std::optional<Format> source = {});

/// The name that LAS files have here for an attribute that other programs, such as PDAL, write with capitals or without
/// "_": "ReturnNumber" is return_number, "Infrared" is nir. Other names as they are.
POINTFAIR_EXPORT std::string las_name(std::string_view name);

/// Whether the cloud's file stores the attribute of this name as integers, of which its values are multiples.
POINTFAIR_EXPORT bool is_stored_scaled(const Cloud& cloud, std::string_view name);

/// Whether a file of the format takes attributes of any name beside its own.
POINTFAIR_EXPORT bool takes_attributes(Format format) noexcept;

/// What of the cloud, its attributes and the other parts of its file, a file of the format and encoding cannot keep, a
/// sentence each; unset: its own.
POINTFAIR_EXPORT std::vector<std::string> losses(const Cloud& cloud, std::optional<Format> format = {},
                                                 std::optional<Encoding> encoding = {});

/// What the cloud and its file hold beside positions and faces, in words: "the colours", "the attribute q", "2
/// comments".
POINTFAIR_EXPORT std::vector<std::string> contents(const Cloud& cloud);

/// Whether a file of the format has the cloud's points in their order: COPC files have that of an octree.
POINTFAIR_EXPORT bool keeps_order(const Cloud& cloud, Format format) noexcept;

/// The cloud without the points of which `removed` is not 0, without the faces that use one of them, and with the other
/// points, faces and attributes in their order. LAS, LAZ, PCD, PLY, OBJ and text files keep all else around their
/// points, unless something unknown may name points; any other file is written anew: losses() tells what it does not
/// keep. Throws ErrorKind::usage unless there is one value for each point, and if no point is left. O(N).
POINTFAIR_EXPORT Cloud without_points(const Cloud& cloud, std::span<const std::uint8_t> removed);

/// Throws ErrorKind::usage if the normals of the cloud cannot be replaced in a file of the format, unset: its own.
POINTFAIR_EXPORT void check_new_normals(const Cloud& cloud, std::optional<Format> format = {});

/// What a new file of each format keeps of what another may hold, as a table in Markdown: kept, noted (a sentence of
/// `losses` says that it is lost) or refused.
POINTFAIR_EXPORT std::string losses_table();

}  // namespace pointfair
