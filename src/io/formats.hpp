// SPDX-License-Identifier: Apache-2.0
// One reader and one writer for each format; files.cpp chooses among them.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "io/file_bytes.hpp"
#include "io/output.hpp"
#include "io/source.hpp"
#include "io/table.hpp"
#include "pointfair/io.hpp"

namespace pointfair::io {

// Readers. `name` is how the file is called in errors. The result has at least one point.
std::shared_ptr<Source> read_ply(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_pcd(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_xyz(FileBytes bytes, const std::string& name, Format format, const ReadOptions& options);
std::shared_ptr<Source> read_off(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_obj(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_las(FileBytes bytes, const std::string& name, Residence residence);  ///< LAZ, too
std::shared_ptr<Source> read_e57(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_ptx(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_stl(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_npy(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_gltf(FileBytes bytes, const std::string& name);
std::shared_ptr<Source> read_floats(FileBytes bytes, const std::string& name, Format format);  ///< KITTI and nuScenes

// Writers of a new file, for a cloud from memory or from another format.
void write_ply(Table table, Encoding encoding, Output& out);
void write_pcd(Table table, Encoding encoding, Output& out);
void write_xyz(Table table, Format format, Output& out);
void write_off(Table table, Output& out);
void write_obj(Table table, Output& out);
void write_las(Table table, bool compress, std::optional<double> scale, Output& out);
void write_ptx(Table table, Output& out);
void write_e57(Table table, Output& out);
void write_stl(const Table& table, Encoding encoding, Output& out);
void write_npy(const Table& table, Output& out);
/// Throws Error(usage) for a cloud without faces.
void check_new_stl(const Cloud& cloud);
std::vector<std::string> losses_in_new_stl(const Cloud& cloud);
/// `las`: a LAS file, uncompressed, whose points and records the COPC file gets; `name`: what it is called in errors.
void write_copc(std::string_view las, const std::string& name, Output& out);
/// Throws Error(usage) for a cloud whose file has what COPC has no place for.
void check_new_copc(const Cloud& cloud);
/// Throws Error(usage) for points that a new LAS file cannot hold.
void check_new_las(const Cloud& cloud, std::optional<double> scale);

}  // namespace pointfair::io
