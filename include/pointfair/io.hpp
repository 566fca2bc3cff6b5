// SPDX-License-Identifier: Apache-2.0
// Whole files in and out. What a file holds beside coordinates survives byte for byte.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair {

enum class Format : std::uint8_t { ply, pcd, xyz, txt, csv, pts, off, obj, las, laz, e57 };

/// How the numbers of a PLY or PCD file are written; the text formats have `ascii` only, LAS and E57
/// `binary`, LAZ `binary_compressed`.
enum class Encoding : std::uint8_t { ascii, binary, binary_big_endian, binary_compressed };

struct ReadOptions {
  std::optional<Format> format;  ///< unset: by content, then by extension
  unsigned threads = 0;          ///< 0: all cores
};

struct WriteOptions {
  std::optional<Format> format;  ///< unset: by extension
  std::optional<Encoding>
      encoding;  ///< unset: as in the source when the format is the same, else binary where there is one
  std::optional<double> las_scale = {};  ///< step of the coordinates of LAS and LAZ: a whole part of the file's own, or
                                         ///< of a new file; unset: as it is, else fine enough for floats
  bool overwrite = false;  ///< false: an existing file is an error
  bool sync = false;       ///< true: fsync before the file gets its name
  unsigned threads = 0;    ///< 0: all cores
};

/// Reads a whole file; the path "-" is standard input.
/// Returns the points in file order, invalid ones included. Coordinates far from zero are held relative to
/// `Cloud::origin`. Throws ErrorKind::file with path, place and reason. Host memory: 12 bytes a point, and the file
/// (mapped, not copied, where it is a regular file; replacing or removing it does no harm, shortening it in place
/// does).
Cloud read(const std::filesystem::path& path, const ReadOptions& options = {});

/// Reads a file image that is already in memory (copied). `name` appears in errors. `options.format` unset: by content.
Cloud read(std::span<const std::byte> bytes, const std::string& name, const ReadOptions& options = {});

/// Writes the cloud; the path "-" is standard output.
/// Into the source's own format: a copy of the source in which only the coordinates of moved points differ, with added
/// attributes appended. Into another format: every attribute the format can hold. A coordinate is written as the
/// file's own value plus the displacement, in the file's own type, so a point that did not move keeps its bytes.
/// The file appears under its name only when it is complete. Throws ErrorKind::file.
void write(const std::filesystem::path& path, const Cloud& cloud, const WriteOptions& options = {});

/// The file image that `write` would write.
std::vector<std::byte> write_bytes(const Cloud& cloud, Format format, std::optional<Encoding> encoding = {});

/// Removes the temporary files of writes that are under way. For the handler of a signal that ends the program:
/// async-signal-safe. A `write` that still runs afterwards fails with ErrorKind::file.
void remove_unfinished_files() noexcept;

/// The format that an extension names (".ply", ".PLY", ...), or nothing.
std::optional<Format> format_of(const std::filesystem::path& path);

/// The format in which `write` writes a file of this name: by its extension, else `source`. Throws ErrorKind::file if
/// that says nothing, or names what is read only (".copc.laz").
Format format_to_write(const std::filesystem::path& path, std::optional<Format> source = {});

/// What of the cloud's own file a file of the format does not keep, a sentence each; `format` unset: its own format.
std::vector<std::string> losses(const Cloud& cloud, std::optional<Format> format = {});

}  // namespace pointfair
