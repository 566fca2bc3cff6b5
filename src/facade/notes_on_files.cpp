// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "io/source.hpp"
#include "pointfair/file_info.hpp"
#include "pointfair/normals.hpp"
#include "pointfair/run_notes.hpp"
#include "pointfair/texture.hpp"

namespace pointfair {

std::vector<std::string> notes_on_faces(const Polygons& faces, std::size_t points) {
  std::vector<std::uint8_t> is_corner(points, 0);
  for (const std::uint32_t corner : faces.corners)
    if (corner < points) is_corner[corner] = 1;
  const auto corners = std::count(is_corner.begin(), is_corner.end(), 1);
  if (faces.size() == 0 || 2 * corners < std::ptrdiff_t(points)) return {};
  return {"the " + std::to_string(faces.size()) +
          " faces of the file are kept and not followed; --connectivity mesh follows their edges"};
}

std::vector<std::string> notes_on_kept_normals(const Cloud& cloud, std::optional<Format> format) {
  if (normal_attributes(cloud).empty()) return {};
  const std::optional<Format> own = file_info(cloud).format;
  const bool is_obj = own == Format::obj && format.value_or(*own) == Format::obj;
  return {std::string("the normals in the file are those from before; ") +
          (is_obj ? "OBJ files keep theirs: write PLY with --normals update, or compute them again in another program"
                  : "--normals update replaces them")};
}

std::vector<std::string> notes_on_waveforms(const Cloud& cloud) {
  std::vector<std::string> notes;
  for (const std::string& extension : cloud.source ? cloud.source->companions() : std::vector<std::string>{})
    if (io::companion_of(*cloud.source, extension).empty())
      notes.push_back("the header says that the waveforms are in a file of their own, and no " + extension +
                      " file of this name lies beside the input, so none was copied");
  return notes;
}

namespace {

// The files of materials that an OBJ file names before its first vertex.
std::vector<std::string> libraries_of(const std::filesystem::path& path) {
  std::vector<std::string> names;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line) && !line.starts_with("v ");)
    if (line.starts_with("mtllib ")) names.push_back(line.substr(7, line.find_last_not_of(" \t\r") - 6));
  return names;
}

// The pictures that a PLY file lays on its faces.
std::vector<std::string> pictures_of(const Cloud& cloud) {
  std::vector<std::string> names;
  for (const TexturePicture& picture : texture(cloud, {}).pictures) names.push_back(picture.name);
  return names;
}

}  // namespace

std::vector<std::string> notes_on_materials(const Cloud& cloud, const std::filesystem::path& from,
                                            const std::filesystem::path& to, std::optional<Format> format) {
  const Format own = file_info(cloud).format.value_or(Format::xyz);
  const bool is_obj = own == Format::obj;
  if ((!is_obj && own != Format::ply) || format != own || from == "-" || to == "-") return {};
  std::string names;
  std::error_code ignored;
  for (const std::string& name : is_obj ? libraries_of(from) : pictures_of(cloud))
    if (!std::filesystem::exists(to.parent_path() / name, ignored) &&
        std::filesystem::exists(from.parent_path() / name, ignored))
      names += (names.empty() ? "" : ", ") + name;
  if (names.empty()) return {};
  return {"beside the input only lies what the result names: " + names + ". Copy it" +
          (is_obj ? " and the pictures that it names" : "") + " to the result, or it is shown without its texture"};
}

}  // namespace pointfair
