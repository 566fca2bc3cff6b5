// SPDX-License-Identifier: Apache-2.0
#include "saved_notes.hpp"

#include <algorithm>
#include <utility>

namespace pointfair::viewer {
namespace {

bool has_moved(const Point& p, const Point& q) {
  return is_finite(p) && is_finite(q) && (p.x != q.x || p.y != q.y || p.z != q.z);
}

}  // namespace

std::vector<std::string> notes_on_file(const Cloud& before, const Cloud& after, Format format,
                                       std::optional<Encoding> encoding, const std::filesystem::path& from,
                                       const std::filesystem::path& to) {
  std::vector<std::string> notes = losses(after, format, encoding);
  const auto add = [&](std::vector<std::string> more) {
    for (std::string& note : more) notes.push_back(std::move(note));
  };
  const auto moved = std::mismatch(before.points.begin(), before.points.end(), after.points.begin(),
                                   [](const Point& p, const Point& q) { return !has_moved(p, q); });
  if (moved.first != before.points.end()) add(notes_on_kept_normals(after, format));
  add(notes_on_waveforms(before));
  add(notes_on_materials(before, from, to, format));
  return notes;
}

}  // namespace pointfair::viewer
