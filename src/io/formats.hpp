// SPDX-License-Identifier: Apache-2.0
// What is special of each format: its reader, its writer, and a row of the table in format_table.cpp.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/file_bytes.hpp"
#include "io/output.hpp"
#include "io/source.hpp"
#include "io/table.hpp"
#include "pointfair/io.hpp"

namespace pointfair::io {

/// How to read, and how to write a new file, beside bytes, names and tables.
struct Reading {
  Format format;  ///< where one reader has several
  const ReadOptions& options;
  Residence residence;
};
struct Writing {
  Format format;
  Encoding encoding;
  std::optional<double> las_scale;
};

/// `name` is how the file is called in errors. The result has at least one point.
using Reader = std::shared_ptr<Source>(FileBytes bytes, const std::string& name, const Reading& reading);
Reader read_ply, read_pcd, read_xyz, read_off, read_obj, read_las, read_e57, read_ptx, read_stl, read_npy, read_gltf,
    read_floats;  // of LAZ, too: read_las; of KITTI and nuScenes: read_floats

/// Writes a new file, for a cloud from memory or from another format.
using Writer = void(Table table, const Writing& writing, Output& out);
Writer write_ply, write_pcd, write_xyz, write_off, write_obj, write_las, write_ptx, write_e57, write_stl, write_npy;

struct FormatRow {
  Format format;
  const char* name;                            ///< in sentences
  std::array<std::string_view, 3> extensions;  ///< in small letters
  unsigned encodings;                          ///< that it has, a bit each
  std::string_view keeps;                      ///< of each ContentKind
  Reader* read;
  Writer* write;  ///< null: no new file is made
};
/// In the order of docs/formats.md.
std::span<const FormatRow> format_rows();
const FormatRow& row_of(Format format);

/// Throws Error(usage) for a cloud without faces.
void check_new_stl(const Cloud& cloud);
std::vector<std::string> losses_in_new_stl(const Cloud& cloud);
/// `las`: a LAS file, uncompressed, whose points and records the COPC file gets; `name`: what it is called in errors.
void write_copc(std::string_view las, const std::string& name, Output& out);
/// Throws Error(usage) for a cloud whose file has what COPC has no place for.
void check_new_copc(const Cloud& cloud);
/// In bytes, of a name in a LAS file.
inline constexpr std::size_t kLongestLasName = 32;
/// Attributes that cannot have their name in a new file, since it is too long or another one's.
std::vector<std::string> renamed_in_new_las(const Cloud& cloud);
std::vector<std::string> renamed_in_new_pcd(const Cloud& cloud);
std::vector<std::string> renamed_in_new_e57(const Cloud& cloud);
/// Throws Error(usage) for points that a new LAS file cannot hold.
void check_new_las(const Cloud& cloud, std::optional<double> scale);

}  // namespace pointfair::io
