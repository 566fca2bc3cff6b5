// SPDX-License-Identifier: Apache-2.0
#include "io/obj_parts.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "io/obj_lines.hpp"
#include "io/plain_row.hpp"

namespace pointfair::io {
namespace {

// The first numbers among the words.
template <std::size_t kCount>
std::array<float, kCount> numbers(std::string_view words) {
  std::array<float, kCount> result{};
  PlainRow row(words, ' ');
  double plain = 0;
  std::size_t found = 0;
  for (; found < kCount && row.number(plain); ++found) result[found] = static_cast<float>(plain);
  if (found == kCount) return result;
  result = {};
  std::string_view word;
  for (std::size_t i = 0; i < kCount && next_word(words, word);)
    if (const auto value = to_number(word)) result[i++] = static_cast<float>(*value);
  return result;
}

// Collects all but the faces.
class PartsReader {
 public:
  explicit PartsReader(const ObjText& text) : text_(text) {}

  ObjParts read() {
    for_each_line(text_, [&](ObjLine kind, std::string_view words, std::string_view line) {
      so_far_.take(kind);
      if (kind == ObjLine::normal) normals_.push_back(numbers<3>(words));
      if (kind == ObjLine::texture) third_textures_ += has_third(words);
      if (kind == ObjLine::face && parts_.damage.empty()) take_face(words, line);
      if (kind == ObjLine::other) take_other(words);
    });
    parts_.normals = normals_.size();
    if (so_far_.textures == 0) parts_.materials.all.clear();
    if (parts_.damage.empty()) {
      give_normals();
      tell_texture();
    }
    tell();
    return std::move(parts_);
  }

 private:
  void take_face(std::string_view words, std::string_view line) {
    Corners corners(words, so_far_, text_.points);
    for (Corner corner; corners.next(corner);) {
      ++parts_.faces.corners;
      take_texture(corner.texture);
      if (corner.normal < 0) continue;
      names_others_ = names_others_ || corner.normal != corner.point;
      take_normal(corner);
    }
    ++parts_.faces.faces;
    if (const auto word = corners.damaged())
      parts_.damage = "line " + std::to_string(line_number(text_.file, line.data())) + ": " + quoted(*word) +
                      " is no point of the file; repair the line";
  }

  // Of texture coordinates; 0 stands for none.
  static bool has_third(std::string_view words) {
    std::string_view word;
    for (int i = 0; i < 3; ++i)
      if (!next_word(words, word)) return false;
    return to_number(word).value_or(0) != 0;
  }

  // Lines of texture coordinates may follow the faces that name them; a file has fewer of them than bytes.
  void take_texture(std::int64_t texture) {
    const auto place = static_cast<std::size_t>(texture);
    if (texture < 0 || place >= text_.file.size()) return;
    if (place >= textures_used_.size()) textures_used_.resize(std::max(place + 1, 2 * textures_used_.size()));
    textures_used_[place] = true;
  }

  void take_other(std::string_view words) {
    std::string_view key;
    next_word(words, key);
    parts_.can_lose_points = parts_.can_lose_points && !names_points_otherwise(key, words);
    if (key == "usemtl" || key == "mtllib") {
      const std::string name(without_blanks(words));
      if (key == "mtllib")
        parts_.materials.libraries.push_back(name);
      else if (known_.emplace(name, known_.size()).second)
        parts_.materials.all.push_back({name});
      if (!name.empty())  // with its blanks, as exporters write them
        materials_.insert((key == "mtllib" ? "the materials of " : "the material ") + io::quoted(name));
    } else if (key == "g" || key == "o" || key == "s") {
      ++groups_;
    } else if (key.empty() || key[0] != '#') {
      ++others_;
    }
  }

  // Curves and surfaces, and colours that follow the points in remarks, name them in ways that are not read.
  bool names_points_otherwise(std::string_view key, std::string_view words) const {
    constexpr std::string_view kKeys[] = {"curv", "surf", "fo", "bzp", "bsp", "cdc", "cdp", "#MRGB"};
    if (key != "l" && key != "p") return std::ranges::find(kKeys, key) != std::end(kKeys);
    Corners corners(words, so_far_, text_.points);
    bool has_normals = false;
    for (Corner corner; corners.next(corner);) has_normals = has_normals || corner.normal >= 0;
    return has_normals || corners.damaged();
  }

  // Which normal the corners of each point have, as long as no two of them differ.
  void take_normal(const Corner& corner) {
    const auto normal = static_cast<std::size_t>(corner.normal);
    names_later_ = names_later_ || normal >= normals_.size();
    if (differ_ || names_later_) return;
    if (of_points_.empty()) of_points_.assign(static_cast<std::size_t>(text_.points), ObjNormals::kNone);
    std::uint32_t& known = of_points_[static_cast<std::size_t>(corner.point)];
    differ_ = known != ObjNormals::kNone && normals_[known] != normals_[normal];
    known = static_cast<std::uint32_t>(normal);
  }

  // Where some face stands before its normals, once all normals are known.
  void take_normals_again() {
    names_later_ = false;
    of_points_.clear();
    LinesSoFar so_far;
    for_each_line(text_, [&](ObjLine kind, std::string_view words, std::string_view) {
      so_far.take(kind);
      if (kind != ObjLine::face) return;
      Corners corners(words, so_far, text_.points);
      for (Corner corner; corners.next(corner);)
        if (corner.normal >= 0) take_normal(corner);
    });
  }

  // Normals are those of points if all corners of a point have the same one.
  void give_normals() {
    if (names_later_ && !differ_) take_normals_again();
    const bool one_each = parts_.own_normals = normals_.size() == text_.points && !names_others_;
    if (normals_.empty() || differ_ || names_later_ || (of_points_.empty() && !one_each)) return;
    for (std::size_t i = 0; i < of_points_.size() && one_each; ++i)
      if (of_points_[i] == ObjNormals::kNone) of_points_[i] = static_cast<std::uint32_t>(i);
    parts_.point_normals = {std::move(normals_), std::move(of_points_)};
  }

  void tell_texture() {
    textures_used_.resize(static_cast<std::size_t>(so_far_.textures));
    const auto used = std::ranges::count(textures_used_, true);
    parts_.textured = used > 0;
    if (const std::uint64_t unused = so_far_.textures - static_cast<std::uint64_t>(used); unused > 0)
      parts_.contents.push_back(
          {ContentKind::elements, io::counted(unused, "texture coordinate") + " that no corner of a face has"});
  }

  void tell() {
    if (third_textures_ > 0)
      parts_.contents.push_back(
          {ContentKind::elements, counted(third_textures_, "third value") + " of texture coordinates"});
    if (others_ > 0)
      parts_.contents.push_back({ContentKind::elements, counted(others_, "line") + " with edges, curves or others"});
    for (const std::string& told : materials_) parts_.contents.push_back({ContentKind::materials, told});
    if (groups_ > 0) parts_.contents.push_back({ContentKind::groups, counted(groups_, "line") + " that name parts"});
  }

  const ObjText& text_;
  LinesSoFar so_far_;
  ObjParts parts_;
  bool differ_ = false, names_later_ = false, names_others_ = false;
  std::uint64_t groups_ = 0, others_ = 0, third_textures_ = 0;
  std::vector<ObjNormals::Normal> normals_;
  std::vector<std::uint32_t> of_points_;
  std::vector<bool> textures_used_;
  std::set<std::string> materials_;           // in words
  std::map<std::string, std::size_t> known_;  // of parts_.materials
};

// Faces may stand before the texture coordinates that they name.
std::vector<std::array<float, 2>> textures_of(const ObjText& text) {
  std::vector<std::array<float, 2>> textures;
  for_each_line(text, [&](ObjLine kind, std::string_view words, std::string_view) {
    if (kind == ObjLine::texture) textures.push_back(numbers<2>(words));
  });
  return textures;
}

}  // namespace

ObjParts read_obj_parts(const ObjText& text) {
  ObjParts parts = PartsReader(text).read();
  parts.faces.exact = true;
  return parts;
}

void visit_obj_faces(const ObjText& text, const ObjParts& parts, FaceVisitor& visitor) {
  if (parts.faces.faces == 0) return;
  std::vector<std::array<float, 2>> textures;
  if (visitor.with_texture()) textures = textures_of(text);
  std::map<std::string_view, std::uint32_t> materials;
  for (std::uint32_t m = 0; const Material& material : parts.materials.all) materials.emplace(material.name, m++);
  visitor.expect(parts.faces);
  LinesSoFar so_far;
  std::vector<std::uint32_t> face;
  std::vector<float> texture;
  constexpr std::array<float, 2> kNone = {std::numeric_limits<float>::quiet_NaN(),
                                          std::numeric_limits<float>::quiet_NaN()};
  for_each_line(text, [&](ObjLine kind, std::string_view words, std::string_view) {
    so_far.take(kind);
    std::string_view key;
    if (kind == ObjLine::other && !materials.empty() && next_word(words, key) && key == "usemtl")
      visitor.use(materials.at(without_blanks(words)));
    if (kind != ObjLine::face) return;
    face.clear();
    texture.clear();
    Corners corners(words, so_far, text.points);
    bool textured = false;
    for (Corner corner; corners.next(corner);) {
      face.push_back(static_cast<std::uint32_t>(corner.point));
      const bool has = corner.texture >= 0 && static_cast<std::size_t>(corner.texture) < textures.size();
      const std::array<float, 2> at = has ? textures[static_cast<std::size_t>(corner.texture)] : kNone;
      texture.insert(texture.end(), at.begin(), at.end());
      textured = textured || has;
    }
    if (!textured) texture.clear();
    visitor.take(face, texture);
  });
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
