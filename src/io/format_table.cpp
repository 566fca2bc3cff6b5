// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "io/detect.hpp"
#include "io/formats.hpp"
#include "io/text.hpp"
#include "platform/path_text.hpp"

namespace pointfair {
namespace io {
namespace {

constexpr unsigned bit(Encoding encoding) { return 1u << static_cast<unsigned>(encoding); }
constexpr unsigned kText = bit(Encoding::ascii), kBinary = bit(Encoding::binary),
                   kBigEndian = bit(Encoding::binary_big_endian), kPacked = bit(Encoding::binary_compressed);

// What a new file does with each ContentKind, in their order: k keeps it, n notes that it is lost, r means that such a
// file cannot be written.
// colours | normals to names | digits, text, lists | faces to groups | comments to records | invalid points
constexpr std::string_view kLas = "kkn kknk knn nnnnnnn nnnnn r", kColumns = "kkk kkkk knn nnnnnnn nnnnn k",
                           kFewNames = "knn kkkn knn nnnnnnn nnnnn k", kNone = "rrr rrrr rrr rrrrrrr rrrrr r";
constexpr FormatRow kRows[] = {
    {Format::ply, "PLY", {".ply"}, kText | kBinary | kBigEndian, "knn kkkk nnn knnknnn nnnnn k", read_ply, write_ply},
    {Format::pcd, "PCD", {".pcd"}, kText | kBinary | kPacked, "knn kkkk knn nnnnnnn nnnnn k", read_pcd, write_pcd},
    {Format::las, "LAS", {".las"}, kBinary, kLas, read_las, write_las},
    {Format::laz, "LAZ", {".laz"}, kPacked, kLas, read_las, write_las},
    {Format::e57, "E57", {".e57"}, kBinary, "knn kkkk nnn nnnnnnn nnnnn k", read_e57, write_e57},
    {Format::xyz, "XYZ", {".xyz", ".xyzn", ".xyzrgb"}, kText, kFewNames, read_xyz, write_xyz},
    {Format::txt, "TXT", {".txt", ".asc"}, kText, kColumns, read_xyz, write_xyz},
    {Format::csv, "CSV", {".csv"}, kText, kColumns, read_xyz, write_xyz},
    {Format::pts, "PTS", {".pts"}, kText, kFewNames, read_xyz, write_xyz},
    {Format::off, "OFF", {".off"}, kText, "knn knnn nnn knnnnnn nnnnn k", read_off, write_off},
    {Format::obj, "OBJ", {".obj"}, kText, "knk knnn nnn knnknnn nnnnn k", read_obj, write_obj},
    {Format::ptx, "PTX", {".ptx"}, kText, "knn nnkn nnn nnnnnnn nnnnn k", read_ptx, write_ptx},
    {Format::stl, "STL", {".stl"}, kText | kBinary, "nnn nnnn nnn knnnnnn nnnnn n", read_stl, write_stl},
    {Format::npy, "NPY", {".npy"}, kBinary, kColumns, read_npy, write_npy},
    {Format::copc, "COPC", {}, kPacked, "kkn kknk knn nnnnnnn nknnn r", read_las, nullptr},
    {Format::glb, "glTF", {".glb", ".gltf"}, kBinary, kNone, read_gltf, nullptr},
    {Format::kitti, "KITTI", {".kitti"}, kBinary, kNone, read_floats, nullptr},
    {Format::nuscenes, "nuScenes", {".nuscenes"}, kBinary, kNone, read_floats, nullptr},
};

}  // namespace

std::span<const FormatRow> format_rows() { return kRows; }

const FormatRow& row_of(Format format) { return *std::ranges::find(kRows, format, &FormatRow::format); }

}  // namespace io

std::optional<Format> format_of(const std::filesystem::path& path) {
  const std::string extension = io::lower_case(platform::text_of(path.extension()));
  if (extension.empty()) return std::nullopt;
  for (const io::FormatRow& row : io::kRows)
    if (std::ranges::find(row.extensions, extension) != row.extensions.end()) return row.format;
  return std::nullopt;
}

}  // namespace pointfair
