// SPDX-License-Identifier: Apache-2.0
#include "io/ply_rows.hpp"

#include <algorithm>
#include <optional>

#include "io/file_bytes.hpp"

namespace pointfair::io {
namespace {

constexpr std::uint32_t kGone = ~std::uint32_t{0};

std::vector<std::vector<bool>> find_names_of_points(const PlyFile& file) {
  const std::optional<FaceList> faces = find_faces(file);
  std::vector<std::vector<bool>> result;
  for (std::size_t e = 0; e < file.header.elements.size(); ++e) {
    const PlyElement& element = file.header.elements[e];
    std::vector<bool>& its = result.emplace_back();
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const PlyProperty& property = element.properties[p];
      const bool is_end = !property.list_count && (property.name == "vertex1" || property.name == "vertex2");
      const bool is_corners = faces && faces->element == e && faces->property == p;
      its.push_back(is_corners || (element.name == "edge" && is_end));
    }
  }
  return result;
}

}  // namespace

// Strips of triangles, for instance, have a list of integers, and so may what nobody knows.
bool can_lose_points(const PlyFile& file) {
  const auto known = find_names_of_points(file);
  for (std::size_t e = 0; e < file.header.elements.size(); ++e) {
    const PlyElement& element = file.header.elements[e];
    if (e == file.header.vertex || element.count == 0) continue;
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const PlyProperty& property = element.properties[p];
      const bool may_name_points = property.list_count || property.name.find("vert") != std::string::npos;
      if (may_name_points && is_integer(property.type) && !known[e][p]) return false;
    }
  }
  return true;
}

void copy_value(PlyCursor& cursor, NativeType type, PlyEmitter& emitter) {
  if (size_of(type) < 8 || !is_integer(type)) return emitter.put(cursor.next(type), type);
  char value[8];
  cursor.next_integer(type, value);
  emitter.put_scalar(value, type);
}

PlyRows::PlyRows(const PlyFile& file, std::string_view bytes, const std::string& name,
                 std::span<const std::uint8_t> removed)
    : file_(file), bytes_(bytes), name_(name), names_a_point_(find_names_of_points(file)) {
  now_.reserve(removed.size());
  std::uint32_t left = 0;
  for (const std::uint8_t is_removed : removed) now_.push_back(is_removed != 0 ? kGone : left++);
}

// Calls take(rows, text) for pieces of what is left of an element.
template <class Take>
void PlyRows::for_pieces(std::size_t element, Encoding encoding, const Take& take) const {
  constexpr std::uint64_t kRows = 65536;
  PlyCursor cursor(bytes_, file_.begins[element], file_.header, file_.wrapped, name_);
  const std::uint64_t count = file_.header.elements[element].count;
  for (std::uint64_t first = 0; first < count; first += kRows) {
    std::string text;
    PlyEmitter emitter(text, encoding, file_.header.line_end);
    std::uint64_t rows = 0;
    for (std::uint64_t row = first; row < std::min(count, first + kRows); ++row) {
      const std::size_t begin = text.size();
      bool stays = true;
      copy_row(cursor, file_.header.elements[element], emitter, [&](std::size_t p) {
        if (now_.empty() || !names_a_point_[element][p]) return false;
        stays = copy_point(cursor, element, file_.header.elements[element].properties[p].type, emitter) && stays;
        return true;
      });
      emitter.end_row();
      rows += stays;
      if (!stays) text.resize(begin);
    }
    take(rows, text);
  }
}

// Whether the point is left.
bool PlyRows::copy_point(PlyCursor& cursor, std::size_t element, NativeType type, PlyEmitter& emitter) const {
  const double point = cursor.next(type);
  if (!(point >= 0 && point < static_cast<double>(now_.size())))
    fail(name_, "a row of '" + file_.header.elements[element].name + "' names a point that is not there; repair it");
  const std::uint32_t now = now_[static_cast<std::size_t>(point)];
  emitter.put(now == kGone ? 0 : now, type);
  return now != kGone;
}

std::vector<std::uint64_t> PlyRows::counts() const {
  std::vector<std::uint64_t> result;
  for (std::size_t e = 0; e < file_.header.elements.size(); ++e) {
    std::uint64_t& count = result.emplace_back(file_.header.elements[e].count);
    if (now_.empty()) continue;
    if (e == file_.header.vertex) {
      count -= static_cast<std::uint64_t>(std::ranges::count(now_, kGone));
    } else if (std::ranges::find(names_a_point_[e], true) != names_a_point_[e].end()) {
      count = 0;
      for_pieces(e, file_.header.encoding, [&](std::uint64_t rows, const std::string&) { count += rows; });
    }
  }
  return result;
}

void PlyRows::write(std::size_t element, Encoding encoding, Output& out) const {
  for_pieces(element, encoding, [&](std::uint64_t, const std::string& text) { out.write(text); });
}

}  // namespace pointfair::io
