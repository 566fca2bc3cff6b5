// SPDX-License-Identifier: Apache-2.0
#include "io/obj_parts.hpp"

#include <algorithm>
#include <charconv>
#include <map>
#include <optional>

#include "io/text.hpp"

namespace pointfair::io {
namespace {

// One corner of a face, from 0; none is -1.
struct Corner {
  std::int64_t point = -1, texture = -1, normal = -1;
};

class Parser {
 public:
  Parser(std::string_view text, std::string_view file, const RowShape& shape, std::uint64_t points)
      : text_(text), file_(file), shape_(shape), points_(points) {}

  ObjParts parse() {
    std::string_view rest = text_, line;
    while (next_row(rest, line, shape_)) {
      std::string_view words = line, word;
      if (next_word(words, word)) take(word, words, line);
    }
    parts_.normals = normals_.size();
    if (parts_.damage.empty()) {
      give_normals();
      give_texture();
    } else {
      parts_.faces = {};
    }
    tell();
    return std::move(parts_);
  }

 private:
  void take(std::string_view key, std::string_view words, std::string_view line) {
    if (key == "v") {
      ++seen_;
    } else if (key == "vn") {
      normals_.push_back(numbers(words));
    } else if (key == "vt") {
      textures_.push_back(numbers(words));
    } else if (key == "f") {
      if (parts_.damage.empty()) take_face(words, line);
    } else if (key == "usemtl" || key == "mtllib") {
      std::string_view material;
      if (next_word(words, material)) ++materials_[std::string(material)];
    } else if (key == "g" || key == "o" || key == "s") {
      ++groups_;
    } else if (key[0] != '#') {
      ++others_;
    }
  }

  static std::array<float, 3> numbers(std::string_view words) {
    std::array<float, 3> result{};
    std::string_view word;
    for (std::size_t i = 0; i < 3 && next_word(words, word);)
      if (const auto value = to_number(word)) result[i++] = static_cast<float>(*value);
    return result;
  }

  void take_face(std::string_view words, std::string_view line) {
    for (std::string_view word; next_word(words, word);) {
      while (word.ends_with('\\')) word.remove_suffix(1);  // the row goes on in the next line
      if (word.empty()) continue;
      const std::optional<Corner> corner = corner_of(word);
      if (!corner) {
        parts_.damage = "line " + std::to_string(line_number(file_, line.data())) + ": " + quoted(word) +
                        " is no point of the file; repair the line";
        return;
      }
      parts_.faces.corners.push_back(static_cast<std::uint32_t>(corner->point));
      note(corner->texture, corner_textures_);
      note(corner->normal, corner_normals_);
    }
    parts_.faces.ends.push_back(parts_.faces.corners.size());
  }

  // Which texture or normal the last corner has; files without any take no memory for them.
  void note(std::int64_t index, std::vector<std::int32_t>& of_corners) const {
    if (index < 0 && of_corners.empty()) return;
    of_corners.resize(parts_.faces.corners.size() - 1, -1);
    of_corners.push_back(static_cast<std::int32_t>(index));
  }

  // "7", "7/1", "7//3", "7/1/3", and "-1" for the last so far.
  std::optional<Corner> corner_of(std::string_view word) const {
    Corner corner;
    std::int64_t* const indices[] = {&corner.point, &corner.texture, &corner.normal};
    const std::uint64_t so_far[] = {seen_, textures_.size(), normals_.size()};
    const std::uint64_t most[] = {points_, std::uint64_t{1} << 31, std::uint64_t{1} << 31};
    const char* at = word.data();
    const char* const end = at + word.size();
    for (std::size_t i = 0; i < 3; ++i) {
      std::int64_t number = 0;
      const auto [stop, error] = std::from_chars(at, end, number);
      const bool left_out = i > 0 && stop == at && (at == end || *at == '/');
      if (number < 0) number += static_cast<std::int64_t>(so_far[i]) + 1;
      const bool sound = error == std::errc() && number >= 1 && static_cast<std::uint64_t>(number) <= most[i] &&
                         (stop == end || *stop == '/');
      if (!sound && !left_out) return std::nullopt;
      *indices[i] = left_out ? -1 : number - 1;
      at = stop;
      if (at == end) break;
      ++at;
    }
    return corner;
  }

  // Normals are those of points if all corners of a point have the same one.
  void give_normals() {
    if (normals_.empty()) return;
    std::vector<std::array<float, 3>> of_points(points_);
    std::vector<bool> has(points_);
    bool named = false;
    for (std::size_t c = 0; c < corner_normals_.size(); ++c) {
      const std::int32_t normal = corner_normals_[c];
      if (normal < 0) continue;
      named = true;
      if (static_cast<std::size_t>(normal) >= normals_.size()) return;
      const std::uint32_t point = parts_.faces.corners[c];
      if (has[point] && of_points[point] != normals_[static_cast<std::size_t>(normal)]) return;
      has[point] = true;
      of_points[point] = normals_[static_cast<std::size_t>(normal)];
    }
    const bool one_each = normals_.size() == points_;
    if (!named && !one_each) return;
    for (std::size_t i = 0; i < has.size() && one_each; ++i)
      if (!has[i]) of_points[i] = normals_[i];
    parts_.point_normals = std::move(of_points);
  }

  void give_texture() {
    if (textures_.empty()) return;
    const bool all = !corner_textures_.empty() && corner_textures_.size() == parts_.faces.corners.size() &&
                     std::all_of(corner_textures_.begin(), corner_textures_.end(),
                                 [&](auto t) { return t >= 0 && static_cast<std::size_t>(t) < textures_.size(); });
    if (!all) {
      parts_.contents.push_back({ContentKind::texture_coordinates, io::counted(textures_.size(), "texture coordinate") +
                                                                       ", which some corners do not have"});
      return;
    }
    for (const std::int32_t t : corner_textures_) {
      parts_.faces.texture.push_back(textures_[static_cast<std::size_t>(t)][0]);
      parts_.faces.texture.push_back(textures_[static_cast<std::size_t>(t)][1]);
    }
  }

  void tell() {
    if (others_ > 0)
      parts_.contents.push_back({ContentKind::elements, counted(others_, "line") + " with edges, curves or others"});
    for (const auto& [material, uses] : materials_)
      parts_.contents.push_back({ContentKind::materials, io::quoted(material)});
    if (groups_ > 0) parts_.contents.push_back({ContentKind::groups, counted(groups_, "line") + " that name parts"});
  }

  std::string_view text_, file_;
  const RowShape& shape_;
  std::uint64_t points_, seen_ = 0, groups_ = 0, others_ = 0;
  ObjParts parts_;
  std::vector<std::array<float, 3>> normals_, textures_;
  std::vector<std::int32_t> corner_textures_, corner_normals_;
  std::map<std::string, std::uint64_t> materials_;
};

}  // namespace

ObjParts parse_obj_parts(std::string_view text, std::string_view file, const RowShape& shape, std::uint64_t points) {
  return Parser(text, file, shape, points).parse();
}

bool has_obj_normals(std::string_view text, const RowShape& shape) {
  if (text.find("vn") == std::string_view::npos) return false;  // soon seen
  std::string_view line;
  while (next_row(text, line, shape)) {
    std::string_view word;
    if (next_word(line, word) && word == "vn") return true;
  }
  return false;
}

}  // namespace pointfair::io
