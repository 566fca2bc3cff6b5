// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "io/camera_centre.hpp"
#include "io/contents.hpp"
#include "io/faces.hpp"
#include "io/sensor_place.hpp"
#include "io/source.hpp"
#include "io/text.hpp"
#include "pointfair/file_info.hpp"
#include "pointfair/normals.hpp"
#include "pointfair/run_notes.hpp"
#include "pointfair/texture.hpp"

namespace pointfair {

namespace {

// Counts faces, and the points that are corners.
class CornerCounter final : public io::FaceVisitor {
 public:
  explicit CornerCounter(std::size_t points) : is_corner_(points, false) {}
  void take(std::span<const std::uint32_t> corners, std::span<const float> = {}) override {
    ++faces_;
    for (const std::uint32_t corner : corners)
      if (corner < is_corner_.size()) is_corner_[corner] = true;
  }
  std::vector<std::string> notes() const {
    const auto corners = std::ranges::count(is_corner_, true);
    if (faces_ == 0 || 2 * corners < std::ptrdiff_t(is_corner_.size())) return {};
    return {"the " + std::to_string(faces_) +
            " faces of the file are not followed; --connectivity mesh follows their edges"};
  }

 private:
  std::vector<bool> is_corner_;
  std::uint64_t faces_ = 0;
};

}  // namespace

std::vector<std::string> notes_on_faces(const Polygons& faces, std::size_t points) {
  CornerCounter counter(points);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto begin = static_cast<std::size_t>(f == 0 ? 0 : faces.ends[f - 1]);
    counter.take(std::span(faces.corners).subspan(begin, static_cast<std::size_t>(faces.ends[f]) - begin));
  }
  return counter.notes();
}

std::vector<std::string> notes_on_faces(const Cloud& cloud) {
  if (!cloud.source) return {};
  CornerCounter counter(static_cast<std::size_t>(cloud.source->size()));
  cloud.source->visit_faces(counter);
  return counter.notes();
}

namespace {

const std::string kWithPlace = "--viewpoint x,y,z finds points between two surfaces (mixed pixels)";

std::string note_on_place(const std::string& place) {
  return "the sensor stood at " + place + "; --viewpoint none takes no place";
}

}  // namespace

std::vector<std::string> notes_on_grid(const Cloud& cloud) {
  const FileInfo info = file_info(cloud);
  if (info.grid_width == 0) return {};
  for (const FileInfo::Row& row : info.rows)
    if (row.name == "sensor") return {note_on_place(row.value)};
  if (io::has_sensor(*cloud.source)) return {};
  return {"the file does not say where the sensor stood, and its grid does not tell: " + kWithPlace};
}

std::vector<std::string> notes_on_grid(const std::optional<Position>& viewpoint) {
  if (viewpoint) return {note_on_place(io::where_rays_meet(*viewpoint))};
  return {"the grid of the image does not tell where the sensor stood: " + kWithPlace};
}

std::vector<std::string> notes_on_units(const Cloud& cloud) {
  const FileInfo info = file_info(cloud);
  if (!info.has_two_units()) return {};
  const auto factor = [](double value) { return io::listed_numbers({&value, 1}, 10); };
  const double plane = *info.metres_per_unit, height = *info.metres_per_height;
  return {"heights are in units of " + factor(height) + " m, X and Y in units of " + factor(plane) +
          " m, and were taken for one unit, so that lengths, noise and shape are wrong: scale the heights first, "
          "pdal translate IN OUT assign --filters.assign.value=\"Z = Z * " +
          factor(height / plane) + "\" for instance, and the result's back"};
}

std::vector<std::string> notes_on_kept_normals(const Cloud& cloud, std::optional<Format> format) {
  if (normal_attributes(cloud).empty()) return {};
  const std::optional<Format> own = file_info(cloud).format;
  const bool is_copy = !format || format == own;
  if (!is_copy && io::keeps(*format, io::ContentKind::normals) != io::Keeps::kept) return {};
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

// The files of materials that an OBJ file names: a line names one with blanks, or several without.
std::vector<std::string> libraries_of(const Cloud& cloud, const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code ignored;
  const auto add = [&](std::string_view name) {
    if (std::ranges::find(names, name) == names.end()) names.emplace_back(name);
  };
  for (const std::string& line : cloud.source->materials().libraries) {
    std::string_view rest = line, word;
    if (!line.empty() && std::filesystem::exists(folder / line, ignored))
      add(line);
    else
      while (io::next_word(rest, word)) add(word);
  }
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
  if ((!is_obj && own != Format::ply) || format != own || from.empty() || from == "-" || to == "-") return {};
  std::string names;
  std::error_code ignored;
  for (const std::string& name : is_obj ? libraries_of(cloud, from.parent_path()) : pictures_of(cloud))
    if (!std::filesystem::exists(to.parent_path() / name, ignored) &&
        std::filesystem::exists(from.parent_path() / name, ignored))
      names += (names.empty() ? "" : ", ") + name;
  if (names.empty()) return {};
  return {"beside the input only lies what the result names: " + names + ". Copy it" +
          (is_obj ? " and the pictures that it names" : "") + " to the result, or it is shown without its texture"};
}

}  // namespace pointfair
