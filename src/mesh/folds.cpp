// SPDX-License-Identifier: Apache-2.0
#include "mesh/folds.hpp"

#include "mesh/blocks.hpp"

namespace pointfair {
namespace {

using Vec = point::Vec3<double>;

constexpr int kMostHalvings = 6;

}  // namespace

Folds::Folds(const OrderedFaces& faces, const MeshTopology& mesh, std::span<const Point> places,
             const ForEach& for_each)
    : faces_(faces),
      mesh_(mesh),
      normals_(faces.size()),
      once_(faces.size()),
      folded_(faces.size()),
      is_stale_(faces.size()) {
  const auto for_faces = [&](const auto& body) { for_mesh_items(faces.size(), for_each, body); };
  for_faces([&](std::size_t f) { normals_[f] = face_normal(faces_.corners(f), places); });
  for_faces([&](std::size_t f) { once_[f] = filtered(normals_, f); });
  for_faces([&](std::size_t f) {
    set_fold(f);
    is_stale_[f] = 0;
  });
}

Vec Folds::filtered(std::span<const Vec> normals, std::size_t face) const {
  Vec sum = normals[face];
  for (const MeshTopology::Across& across : mesh_.across_of(faces_, face)) {
    const Vec there = normals[across.face];
    sum = across.is_opposite ? sum - there : sum + there;
  }
  return sum;
}

void Folds::add(std::uint32_t face) {
  if (is_stale_[face] != 0) return;
  is_stale_[face] = 1;
  stale_.push_back(face);
}

void Folds::add_neighbors(std::size_t end) {
  for (std::size_t i = 0; i < end; ++i)
    for (const MeshTopology::Across& across : mesh_.across_of(faces_, stale_[i])) add(across.face);
}

void Folds::update(std::span<const Point> places, std::span<const std::uint32_t> moved) {
  for (const std::uint32_t v : moved)
    for (const std::uint32_t face : faces_.around(v)) add(face);
  for (const std::uint32_t face : stale_) normals_[face] = face_normal(faces_.corners(face), places);
  add_neighbors(stale_.size());
  for (const std::uint32_t face : stale_) once_[face] = filtered(normals_, face);
  add_neighbors(stale_.size());
  for (const std::uint32_t face : stale_) set_fold(face), is_stale_[face] = 0;
  stale_.clear();
}

void unfold(Folds& folds, std::span<const std::uint8_t> folded_before, std::span<const Point> before,
            std::span<Point> after) {
  const OrderedFaces& faces = folds.faces();
  platform::LargeVector<std::uint8_t> halvings(after.size(), 0), shortens(after.size(), 0);
  const platform::LargeVector<Point> whole(after.begin(), after.end());
  const auto shorten = [&](std::uint32_t i) {
    const std::uint8_t its = halvings[i];
    const float share = its > kMostHalvings ? 0.0f : 1.0f / float(1 << its);
    after[i] = {before[i].x + share * (whole[i].x - before[i].x), before[i].y + share * (whole[i].y - before[i].y),
                before[i].z + share * (whole[i].z - before[i].z)};
  };
  for (;;) {
    std::vector<std::uint32_t> moved;
    for (std::size_t f = 0; f < faces.size(); ++f) {
      if (folds.folded()[f] == 0 || folded_before[f] != 0) continue;
      for (const std::uint32_t v : faces.corners(f)) {
        if (shortens[v] != 0 || halvings[v] > kMostHalvings) continue;
        shortens[v] = 1;
        moved.push_back(v);
      }
    }
    if (moved.empty()) break;
    for (const std::uint32_t v : moved) {
      ++halvings[v];
      shortens[v] = 0;
      shorten(v);
    }
    folds.update(after, moved);
  }
}

}  // namespace pointfair
