// SPDX-License-Identifier: Apache-2.0
// What of a cloud a file does not keep, in sentences.
#include <algorithm>
#include <array>

#include "io/column_names.hpp"
#include "io/contents.hpp"
#include "io/formats.hpp"
#include "io/las/octree.hpp"
#include "io/source.hpp"
#include "pointfair/io.hpp"
#include "pointfair/normals.hpp"

namespace pointfair {
namespace {

using io::Content;
using io::ContentKind;
using io::Keeps;

// In the order of ContentKind.
constexpr std::array<const char*, io::kContentKinds> kKindNames = {"colours",
                                                                   "colours of more than 8 bits",
                                                                   "colours of some points only",
                                                                   "normals",
                                                                   "other attributes",
                                                                   "intensity beyond 0 to 65535, or with fractions",
                                                                   "names of attributes",
                                                                   "integers of more than 53 bits",
                                                                   "columns of words",
                                                                   "lists of points",
                                                                   "faces",
                                                                   "attributes of faces",
                                                                   "edges and other elements",
                                                                   "texture coordinates of corners",
                                                                   "normals of corners",
                                                                   "materials, names of images",
                                                                   "names of parts",
                                                                   "comments, titles",
                                                                   "coordinate system",
                                                                   "poses of sensors",
                                                                   "rows and columns of a sensor",
                                                                   "images, waveforms, other records",
                                                                   "points that are not finite"};

bool is_one(const std::string& list) { return list.find(", ") == std::string::npos; }

std::string attributes_told(const std::string& what) {
  return (is_one(what) ? "the attribute " : "the attributes ") + what;
}

// What a format has a place for, and yet not here.
std::string sentence_on_kept(ContentKind kind, const std::string& what, const std::string& format) {
  if (kind == ContentKind::normals)
    return "a copy of an " + format + " file keeps its lines and takes no new normals; PLY and PCD take them";
  if (kind == ContentKind::names)
    return attributes_told(what) + (is_one(what) ? " gets another name" : " get other names") + " in " + format +
           " files, where " + (is_one(what) ? "its own is" : "their own are") +
           " too long, taken or no valid name; NPY keeps names";
  return "the texture coordinates " + what + " of points are not written to " + format +
         " files, which have them at corners of faces; PLY, PCD and CSV keep them";
}

// Of things of one kind, as one list. `anew`: the file had that format, which therefore had a place for them.
std::string sentence(ContentKind kind, const std::string& what, const std::string& format, bool anew) {
  switch (kind) {
    case ContentKind::fine_colors:
      return what + " have more than 8 bits, and are rounded to 8 in " + format + " files; CSV and LAS keep them";
    case ContentKind::some_colors:
      return what + " without a colour become white, since " + format + " files give one to each; OBJ and CSV do not";
    case ContentKind::numbers:
      return format + " files have no place for " + attributes_told(what) + "; PLY, PCD and CSV keep " +
             (is_one(what) ? "it" : "them");
    case ContentKind::intensity:
      return "the attribute " + what + " is rounded or scaled to whole numbers from 0 to 65535, as " + format +
             " files have it; PLY, PCD and CSV keep its values";
    case ContentKind::names:
      return format + " files do not name their columns, so " + attributes_told(what) +
             (is_one(what) ? " stands there without its name" : " stand there without their names") +
             "; CSV, PLY and PCD keep names";
    case ContentKind::wide_integers:
      return attributes_told(what) + (is_one(what) ? " has" : " have") + " more digits than " + format +
             " files hold, so the last ones are rounded; PCD, CSV and LAS keep them";
    default:
      return format + (anew ? " files that are written anew do not keep " : " files have no place for ") + what;
  }
}

// What says nothing more where all numbers are lost.
bool follows_numbers(ContentKind kind) {
  return kind == ContentKind::intensity || kind == ContentKind::names || kind == ContentKind::wide_integers;
}

// The same where all colours are lost.
bool follows_colors(ContentKind kind) { return kind == ContentKind::fine_colors || kind == ContentKind::some_colors; }

std::vector<std::string> sentences(const std::vector<Content>& lost, Format format, bool anew) {
  std::vector<std::string> result;
  const bool no_numbers = io::keeps(format, ContentKind::numbers) != Keeps::kept;
  const bool no_colors = io::keeps(format, ContentKind::colors) != Keeps::kept;
  for (auto content = lost.begin(); content != lost.end();) {
    const auto end =
        std::find_if(content, lost.end(), [&](const Content& other) { return other.kind != content->kind; });
    constexpr std::ptrdiff_t kListed = 5;
    std::string what;
    for (auto one = content; one != content + std::min(kListed, end - content); ++one)
      what += (what.empty() ? "" : ", ") + one->what;
    if (end - content > kListed) what += " and " + std::to_string(end - content - kListed) + " more";
    const bool is_kept = io::keeps(format, content->kind) == Keeps::kept;
    const bool has_place = content->kind == ContentKind::normals || content->kind == ContentKind::names ||
                           content->kind == ContentKind::texture_coordinates;
    if (is_kept && has_place)
      result.push_back(sentence_on_kept(content->kind, what, io::row_of(format).name));
    else if (!(no_numbers && follows_numbers(content->kind)) && !(no_colors && follows_colors(content->kind)))
      result.push_back(sentence(content->kind, what, io::row_of(format).name, anew));
    content = end;
  }
  return result;
}

// Columns of texture coordinates are no attributes that a format lacks if it has such coordinates, at corners of faces.
void tell_texture_of_points(const Cloud& cloud, Format format, std::vector<Content>& lost) {
  if (io::keeps(format, ContentKind::texture_coordinates) != Keeps::kept) return;
  const std::vector<std::string> names = io::texture_columns(attributes(cloud));
  for (Content& content : lost)
    if (content.kind == ContentKind::numbers && std::ranges::find(names, content.what) != names.end())
      content.kind = ContentKind::texture_coordinates;
  std::ranges::stable_sort(lost, {}, &Content::kind);
}

// Names of extra bytes that LAS files cut.
void tell_cut(const std::vector<Attribute>& added, std::vector<Content>& lost) {
  for (const Attribute& attribute : added)
    for (const std::string& name : io::component_names(attribute.name, attribute.components))
      if (name.size() > io::kLongestLasName) lost.push_back({ContentKind::names, name});
}

void tell_renamed(const Cloud& cloud, Format format, std::vector<Content>& lost) {
  const bool is_of_las = io::is_of(cloud, Format::las);
  std::vector<std::string> names;
  if (format == Format::ply || format == Format::csv || format == Format::txt)
    names = io::word_names(io::ply_names(cloud)).renamed;
  if (format == Format::pcd) names = io::renamed_in_new_pcd(cloud);
  if (format == Format::e57) names = io::renamed_in_new_e57(cloud);
  if (io::family(format) == Format::las || (format == Format::copc && !is_of_las))
    names = io::renamed_in_new_las(cloud);
  if (format == Format::copc && is_of_las) tell_cut(cloud.added, lost);
  for (const std::string& name : names) lost.push_back({ContentKind::names, name});
  std::ranges::stable_sort(lost, {}, &Content::kind);
}

std::vector<Content> lost_of_new(const Cloud& cloud, Format format) {
  std::vector<Content> lost = io::contents_of(cloud);
  std::erase_if(lost, [&](const Content& content) {
    const bool is_ptx_intensity =
        format == Format::ptx && content.kind == ContentKind::numbers && content.what == "intensity";
    // the octree is written by way of LAS
    const bool is_las_record =
        format == Format::copc && content.kind == ContentKind::records && io::is_of(cloud, Format::las);
    return is_ptx_intensity || is_las_record || io::keeps(format, content.kind) == Keeps::kept;
  });
  tell_texture_of_points(cloud, format, lost);
  tell_renamed(cloud, format, lost);
  return lost;
}

// A copy has all that its file has; attributes may have been added.
std::vector<Content> lost_of_copy(const Cloud& cloud, Format format) {
  if (cloud.added.empty()) return {};  // and a text is not read for the types of its columns
  std::string added;
  std::vector<Content> lost;
  const std::vector<io::Column> own = cloud.source->columns();
  const std::vector<std::string> normals = normal_attributes(cloud);
  for (const Attribute& attribute : cloud.added) {
    const auto named = [&](const io::Column& column) { return column.name == attribute.name; };
    if (std::ranges::any_of(own, named)) continue;
    const bool is_normal = std::ranges::find(normals, attribute.name) != normals.end();
    if (is_normal && !takes_attributes(format) && io::keeps(format, ContentKind::normals) == Keeps::kept)
      lost = {{ContentKind::normals, attribute.name}};
    else
      added += (added.empty() ? "" : ", ") + attribute.name;
  }
  if (added.empty()) return lost;
  if (!takes_attributes(format)) {
    lost.push_back({ContentKind::numbers, added});
    return lost;
  }
  if (io::keeps(format, ContentKind::names) == Keeps::noted) {
    for (const std::string& name : cloud.source->names_by_place()) lost.push_back({ContentKind::names, name});
    lost.push_back({ContentKind::names, added});
    return lost;
  }
  if (io::family(format) != Format::las) return {};
  tell_cut(cloud.added, lost);
  return lost;
}

}  // namespace

std::vector<std::string> losses(const Cloud& cloud, std::optional<Format> format, std::optional<Encoding> encoding) {
  if (!cloud.source && !format) return {};
  const Format to = format ? *format : cloud.source->format();
  std::vector<std::string> result;
  const bool is_own = io::is_of(cloud, to);
  if (is_own) result = cloud.source->losses(encoding.value_or(cloud.source->encoding()));
  const bool copied = io::is_copied(cloud, to, encoding);
  if (copied)
    for (std::string& sentence : cloud.source->losses_of_moves(io::make_edits(cloud, {})))
      result.push_back(std::move(sentence));
  const std::vector<Content> lost = copied ? lost_of_copy(cloud, to) : lost_of_new(cloud, to);
  for (std::string& sentence : sentences(lost, to, is_own && !copied)) result.push_back(std::move(sentence));
  if (!keeps_order(cloud, to))
    result.push_back("COPC files keep their points in the order of an octree, so the order of the points changes");
  if (to == Format::copc && cloud.source && cloud.source->has_geotiff_keys())
    result.push_back(
        "the coordinate system stays in GeoTIFF keys, as the LAS file has it, which readers that follow "
        "LAS 1.4 do not look for in COPC files; PDAL (writers.copc, a_srs) writes it as WKT");
  if (to == Format::stl && !copied)
    for (std::string& sentence : io::losses_in_new_stl(cloud)) result.push_back(std::move(sentence));
  return result;
}

std::vector<std::string> contents(const Cloud& cloud) {
  using enum ContentKind;
  constexpr std::array kOfOthers = {fine_colors, some_colors, intensity, names, wide_integers, faces, invalid_points};
  std::vector<std::string> result;
  for (const Content& content : io::contents_of(cloud))
    if (std::ranges::find(kOfOthers, content.kind) == kOfOthers.end())
      result.push_back(content.kind == numbers ? attributes_told(content.what) : content.what);
  return result;
}

bool keeps_order(const Cloud& cloud, Format format) noexcept {
  return format != Format::copc || cloud.points.size() <= io::las::kFew;
}

void check_new_normals(const Cloud& cloud, std::optional<Format> format) {
  if (!cloud.source || !io::is_copied(cloud, format.value_or(cloud.source->format()))) return;
  const std::vector<std::string> normals = normal_attributes(cloud);
  const std::vector<io::Column> columns = cloud.source->columns();
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (std::ranges::find(normals, columns[c].name) == normals.end()) continue;
    if (const std::string why = cloud.source->why_fixed(c); !why.empty()) throw Error(ErrorKind::usage, why);
  }
}

std::string losses_table() {
  std::string table = "|";
  for (const io::FormatRow& row : io::format_rows()) table += std::string(" | ") + row.name;
  table += " |\n|---";
  for (std::size_t i = 0; i < io::format_rows().size(); ++i) table += "|---";
  table += "|\n";
  for (std::size_t kind = 0; kind < io::kContentKinds; ++kind) {
    table += std::string("| ") + kKindNames[kind];
    for (const io::FormatRow& row : io::format_rows()) {
      const Keeps keeps = io::keeps(row.format, static_cast<ContentKind>(kind));
      table += keeps == Keeps::kept ? " | kept" : keeps == Keeps::noted ? " | noted" : " | refused";
    }
    table += " |\n";
  }
  return table;
}

}  // namespace pointfair
