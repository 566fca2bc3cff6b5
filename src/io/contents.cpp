// SPDX-License-Identifier: Apache-2.0
#include "io/contents.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>

#include "io/colors.hpp"
#include "io/column_names.hpp"
#include "io/coordinate_names.hpp"
#include "io/edits.hpp"
#include "io/formats.hpp"
#include "io/intensity.hpp"
#include "io/source.hpp"
#include "io/table.hpp"
#include "pointfair/normals.hpp"

namespace pointfair::io {
namespace {

bool is_in(const std::vector<std::string>& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

// What a cloud's attributes are.
class Attributes {
 public:
  explicit Attributes(const Cloud& cloud) : cloud_(cloud), normals_(normal_attributes(cloud)) {
    std::array<std::string, 3> channels;
    for (const AttributeInfo& info : attributes(cloud)) {
      const std::string plain = ply_name(info.name);
      const auto channel = static_cast<std::size_t>(std::ranges::find(kChannels, plain) - kChannels.begin());
      if (channel < 3 && info.components == 1 && channels[channel].empty()) {
        channels[channel] = info.name;
        has_bytes_ = has_bytes_ && info.type == ScalarType::uint8;
      }
      if ((info.name == "rgb" || info.name == "rgba") && info.components == 1 && size_of(info.type) == 4)
        colors_.push_back(info.name);
    }
    const bool complete = std::ranges::none_of(channels, [](const auto& name) { return name.empty(); });
    if (complete) colors_.assign(channels.begin(), channels.end());  // packed ones are one more attribute then
    has_channels_ = complete;
  }

  void tell(std::vector<Content>& to) const {
    if (!colors_.empty()) tell_colors(to);
    if (!normals_.empty()) to.push_back({ContentKind::normals, "the normals"});
    const std::vector<AttributeInfo> all = attributes(cloud_);
    std::vector<std::string> names;
    for (const AttributeInfo& info : all) {
      names.push_back(info.name);
      to.push_back({ContentKind::names, info.name});
      if (is_in(colors_, info.name) || is_in(normals_, info.name)) continue;
      to.push_back({ContentKind::numbers, info.name});
    }
    if (const std::size_t intensity = find_intensity(names); intensity < all.size()) tell_intensity(all[intensity], to);
    tell_wide_integers(to);
  }

 private:
  void tell_colors(std::vector<Content>& to) const {
    to.push_back({ContentKind::colors, "the colours"});
    if (!has_channels_ || has_bytes_) return;
    const std::vector<Attribute> values = attribute_values(cloud_, std::span(colors_).first(3));
    const TableColumn red = column_of(values[0]), green = column_of(values[1]), blue = column_of(values[2]);
    const ColorRange range = color_range(std::array{&red, &green, &blue});
    if (range.fine) to.push_back({ContentKind::fine_colors, "the colours"});
    if (range.missing > 0) to.push_back({ContentKind::some_colors, counted(range.missing, "point")});
  }

  void tell_intensity(const AttributeInfo& info, std::vector<Content>& to) const {
    if (info.components != 1) return;
    const Attribute values = attribute(cloud_, info.name);
    const auto* const data = reinterpret_cast<const char*>(values.data.data());
    if (!is_las_intensity({data, values.data.size()}, native(values.type)))
      to.push_back({ContentKind::intensity, info.name});
  }

  // Those of the file; attributes that were added have no 64-bit integers.
  void tell_wide_integers(std::vector<Content>& to) const {
    if (!cloud_.source) return;
    const std::vector<Column> columns = cloud_.source->columns();
    std::string names;
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (size_of(columns[c].type) < 8 || !is_integer(columns[c].type)) continue;
      std::vector<char> values(static_cast<std::size_t>(cloud_.source->size()) * column_bytes(columns[c]));
      cloud_.source->extract(c, values);
      if (is_wide(columns[c].type, values)) names += (names.empty() ? "" : ", ") + columns[c].name;
    }
    if (!names.empty()) to.push_back({ContentKind::wide_integers, names});
  }

  // Whether some value has more than the 53 bits of a double between its first and last one that is set.
  static bool is_wide(NativeType type, const std::vector<char>& values) {
    for (std::size_t at = 0; at < values.size(); at += sizeof(std::uint64_t)) {
      auto bits = load<std::uint64_t>(values.data() + at, false);
      if (type == NativeType::int64 && bits >> 63 != 0) bits = 0 - bits;
      if (bits != 0 && bits >> std::countr_zero(bits) >> 53 != 0) return true;
    }
    return false;
  }

  const Cloud& cloud_;
  std::vector<std::string> normals_, colors_;
  bool has_channels_ = false;
  bool has_bytes_ = true;  // the channels are bytes
};

}  // namespace

std::string counted(std::uint64_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

std::vector<Content> contents_of(const Cloud& cloud) {
  std::vector<Content> result;
  Attributes(cloud).tell(result);
  const auto is_valid = [](const Position& p) { return std::isfinite(p[0] + p[1] + p[2]); };
  if (!std::ranges::all_of(cloud.points, is_finite) && !std::ranges::all_of(written_positions(cloud), is_valid))
    result.push_back({ContentKind::invalid_points, "points without finite coordinates"});
  if (!cloud.source) return result;
  const FaceSummary faces = cloud.source->face_summary();
  if (faces.faces > 0) result.push_back({ContentKind::faces, counted(faces.faces, "face")});
  if (faces.textured) result.push_back({ContentKind::texture_coordinates, "the texture coordinates"});
  if (faces.odd_textures > 0)
    result.push_back({ContentKind::face_values, "the texture coordinates of " + counted(faces.odd_textures, "face") +
                                                    ", which are not two for each corner"});
  for (Content& content : cloud.source->contents()) result.push_back(std::move(content));
  std::ranges::stable_sort(result, {}, &Content::kind);
  return result;
}

Keeps keeps(Format format, ContentKind kind) {
  std::size_t left = static_cast<std::size_t>(kind);
  for (const char c : row_of(format).keeps) {
    if (c == ' ' || left-- > 0) continue;
    return c == 'k' ? Keeps::kept : c == 'r' ? Keeps::refused : Keeps::noted;
  }
  return Keeps::noted;
}

Format family(Format format) {
  return format == Format::txt ? Format::xyz : format == Format::laz ? Format::las : format;
}

bool is_of(const Cloud& cloud, Format format) {
  return cloud.source && family(cloud.source->format()) == family(format);
}

bool is_copied(const Cloud& cloud, Format format, std::optional<Encoding> encoding) {
  if (!is_of(cloud, format) || !cloud.source->holds_its_positions()) return false;
  if (format == Format::stl) return !encoding || *encoding == cloud.source->encoding();
  return format != Format::npy || make_edits(cloud, {}).added.empty();
}

}  // namespace pointfair::io
