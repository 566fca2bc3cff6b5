// SPDX-License-Identifier: Apache-2.0
#include "pointfair/texture.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "io/source.hpp"
#include "io/text.hpp"

namespace pointfair {
namespace {

// The picture of each material's name, as the libraries say it.
using Named = std::map<std::string, io::LibraryPicture, std::less<>>;

// A library says where its pictures are from where it is itself.
std::string beside(const std::string& library, const std::string& picture) {
  const std::size_t slash = library.find_last_of("/\\");
  const bool from_root = picture.starts_with('/') || picture.starts_with('\\') || picture.find(':') == 1;
  return slash == library.npos || from_root ? picture : library.substr(0, slash + 1) + picture;
}

void take_library(const std::string& name, const std::string& text, Named& named) {
  for (io::LibraryPicture& one : io::library_pictures(text)) {
    one.picture = beside(name, one.picture);
    named.insert_or_assign(one.material, std::move(one));
  }
}

// A line that names libraries names one file with blanks, or several without.
void read_libraries(const std::string& line, const ReadNamed& read, Named& named, std::vector<std::string>& notes) {
  try {
    return take_library(line, read(line), named);
  } catch (const Error& error) {
    if (line.find(' ') == line.npos) return notes.emplace_back(error.what()), void();
  }
  std::string_view rest = line, word;
  while (io::next_word(rest, word)) {
    const std::string name(word);
    try {
      take_library(name, read(name), named);
    } catch (const Error& error) {
      notes.emplace_back(error.what());
    }
  }
}

// Where each face has its picture.
class MapCollector final : public io::FaceVisitor {
 public:
  MapCollector(const Texture& texture, bool v_down, std::span<const float> of_points)
      : FaceVisitor(true), texture_(texture), v_down_(v_down), of_points_(of_points) {}

  void expect(const io::ExpectedFaces& expected) override {
    map_.pictures.reserve(static_cast<std::size_t>(expected.faces));
    if (expected.exact) map_.coordinates.reserve(static_cast<std::size_t>(2 * expected.corners));
  }
  void use(std::uint32_t material) override {
    picture_ = material < texture_.of_materials.size() ? texture_.of_materials[material] : kNoPicture;
  }
  void take(std::span<const std::uint32_t> corners, std::span<const float> own) override {
    const bool has_own = own.size() == 2 * corners.size() && !own.empty() &&
                         std::ranges::none_of(own, [](float value) { return std::isnan(value); });
    const bool has = picture_ != kNoPicture && (has_own || !of_points_.empty());
    map_.pictures.push_back(has ? picture_ : kNoPicture);
    for (std::size_t c = 0; c < corners.size(); ++c) {
      const float* const at = !has ? kZero : has_own ? &own[2 * c] : &of_points_[2 * std::size_t{corners[c]}];
      map_.coordinates.push_back(at[0]);
      map_.coordinates.push_back(has && v_down_ ? 1 - at[1] : at[1]);
    }
  }
  TextureMap finish() && { return std::move(map_); }

 private:
  static constexpr float kZero[2] = {0, 0};
  const Texture& texture_;
  bool v_down_;
  std::span<const float> of_points_;  // two each, or none at all
  std::uint32_t picture_ = kNoPicture;
  TextureMap map_;
};

// Those of the points, two each; none where they have none.
std::vector<float> coordinates_of_points(const Cloud& cloud) {
  const std::vector<std::string> names = io::texture_columns(attributes(cloud));
  if (names.empty()) return {};
  std::vector<float> result(2 * cloud.points.size());
  const std::vector<Attribute> values = attribute_values(cloud, names);
  for (std::size_t c = 0; c < values.size(); ++c)
    for (std::size_t i = 0; i < cloud.points.size(); ++i)
      result[2 * i + c] = static_cast<float>(value_at(values[c], i));
  return result;
}

}  // namespace

Texture texture(const Cloud& cloud, const ReadNamed& read) {
  Texture result;
  if (!cloud.source) return result;
  const io::Materials materials = cloud.source->materials();
  Named named;
  if (!materials.all.empty())
    for (const std::string& line : materials.libraries) read_libraries(line, read, named, result.notes);
  std::map<std::string, std::uint32_t> places;
  constexpr std::span<const std::byte> kNoBytes;
  for (const io::Material& material : materials.all) {
    io::Material its = material;
    if (const auto found = named.find(its.name); its.picture.empty() && found != named.end()) {
      its.picture = found->second.picture;
      if (found->second.altered)
        its.note =
            io::quoted(its.picture) + " is moved, scaled or turned by its library of materials, which is not done";
    }
    result.of_materials.push_back(kNoPicture);
    if (!its.note.empty()) result.notes.push_back(its.note);
    if (its.picture.empty()) continue;
    const auto count = static_cast<std::uint32_t>(result.pictures.size());
    const auto [place, is_new] = places.emplace(its.picture, count);
    if (is_new) result.pictures.push_back({its.picture, its.held ? std::as_bytes(std::span(*its.held)) : kNoBytes});
    result.of_materials.back() = place->second;
  }
  return result;
}

TextureMap texture_map(const Cloud& cloud, const Texture& texture) {
  if (!cloud.source) return {};
  const std::vector<float> of_points = texture.pictures.empty() ? std::vector<float>{} : coordinates_of_points(cloud);
  MapCollector collector(texture, cloud.source->materials().v_down, of_points);
  cloud.source->visit_faces(collector);
  return std::move(collector).finish();
}

}  // namespace pointfair
