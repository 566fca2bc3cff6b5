// SPDX-License-Identifier: Apache-2.0
#include "io/faces.hpp"

#include <limits>

namespace pointfair::io {

void visit(const Faces& faces, FaceVisitor& visitor) {
  visitor.expect({faces.ends.size(), faces.corners.size(), true});
  const std::span<const float> texture = faces.texture;
  for (std::size_t face = 0; face < faces.ends.size(); ++face) {
    const std::span<const std::uint32_t> corners = faces.corners_of(face);
    if (!faces.materials.empty()) visitor.use(faces.materials[face]);
    visitor.take(corners, texture.empty() ? texture : texture.subspan(2 * faces.begin_of(face), 2 * corners.size()));
  }
}

void FaceCollector::expect(const ExpectedFaces& expected) {
  expected_ = expected;
  faces_.ends.reserve(static_cast<std::size_t>(expected.faces));
  if (expected.exact) faces_.corners.reserve(static_cast<std::size_t>(expected.corners));
}

void FaceCollector::take(std::span<const std::uint32_t> corners, std::span<const float> texture) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  const std::size_t before = 2 * faces_.corners.size();
  const std::uint64_t count = faces_.ends.size() + 1;
  make_room(faces_.corners, corners.size(), count, expected_, expected_.corners);
  faces_.corners.insert(faces_.corners.end(), corners.begin(), corners.end());
  faces_.ends.push_back(faces_.corners.size());
  const bool textured = !texture.empty() && texture.size() == 2 * corners.size();
  if (!with_texture() || (!textured && faces_.texture.empty())) return;
  if (faces_.texture.empty() && expected_.exact)
    faces_.texture.reserve(static_cast<std::size_t>(2 * expected_.corners));
  make_room(faces_.texture, 2 * faces_.corners.size() - faces_.texture.size(), count, expected_, 2 * expected_.corners);
  faces_.texture.resize(before, kNone);
  if (textured) faces_.texture.insert(faces_.texture.end(), texture.begin(), texture.end());
  faces_.texture.resize(2 * faces_.corners.size(), kNone);
}

void TriangleCollector::expect(const ExpectedFaces& expected) {
  expected_ = expected;
  // a face of n corners gives n - 2
  expected_.corners -= std::min(expected.corners, 2 * expected.faces);
  if (expected.exact) triangles_.reserve(static_cast<std::size_t>(expected_.corners));
}

void TriangleCollector::take(std::span<const std::uint32_t> corners, std::span<const float>) {
  ++faces_;
  if (corners.size() < 3) return;
  make_room(triangles_, corners.size() - 2, faces_, expected_, expected_.corners);
  for (std::size_t c = 2; c < corners.size(); ++c) triangles_.push_back({corners[0], corners[c - 1], corners[c]});
}

}  // namespace pointfair::io
