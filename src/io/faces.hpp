// SPDX-License-Identifier: Apache-2.0
// The faces of a file: given one after the other, or collected.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace pointfair {

/// Polygons: face f has the corners [ends[f - 1], ends[f]), the first from 0.
struct Faces {
  std::vector<std::uint64_t> ends;
  std::vector<std::uint32_t> corners;
  std::vector<float> texture;            ///< two for each corner, NaN for one without; or none at all
  std::vector<std::uint32_t> materials;  ///< one for each face as FaceVisitor::use() says it, or none at all

  std::size_t begin_of(std::size_t face) const { return face == 0 ? 0 : static_cast<std::size_t>(ends[face - 1]); }
  std::span<const std::uint32_t> corners_of(std::size_t face) const {
    return std::span(corners).subspan(begin_of(face), static_cast<std::size_t>(ends[face]) - begin_of(face));
  }
};

namespace io {

/// The material of faces that have none.
inline constexpr std::uint32_t kNoMaterial = ~std::uint32_t{0};

/// How many faces a file has, as far as it is known before they are read.
struct ExpectedFaces {
  std::uint64_t faces = 0;
  std::uint64_t corners = 0;  ///< of all; at most, unless `exact`
  bool exact = false;
};

/// Is given the faces of a file, one after the other. So each caller makes of them what it needs, and no more: faces
/// that are held take more memory than short lines of text.
class FaceVisitor {
 public:
  /// `with_texture`: texture coordinates are wanted, too.
  explicit FaceVisitor(bool with_texture = false) : with_texture_(with_texture) {}
  virtual ~FaceVisitor() = default;
  FaceVisitor(const FaceVisitor&) = delete;
  FaceVisitor& operator=(const FaceVisitor&) = delete;

  bool with_texture() const { return with_texture_; }
  /// Is called before the first face.
  virtual void expect(const ExpectedFaces&) {}
  /// The faces that follow have this one of the materials that the file names, or kNoMaterial, as those before the
  /// first call.
  virtual void use(std::uint32_t) {}
  /// `texture`: two for each corner, NaN for one without; another count if the face has none that fit its corners.
  virtual void take(std::span<const std::uint32_t> corners, std::span<const float> texture) = 0;

 private:
  bool with_texture_;
};

/// Gives the faces to the visitor.
void visit(const Faces& faces, FaceVisitor& visitor);

/// Makes room for `more` values where `faces` of the expected faces gave those that are there. What is reserved for
/// nothing takes no memory, but a copy into a larger place takes twice as much as the values do.
template <class T>
void make_room(std::vector<T>& values, std::size_t more, std::uint64_t faces, const ExpectedFaces& expected,
               std::uint64_t most) {
  constexpr std::uint64_t kTypical = 1024;  // faces that show how many corners the others have
  const std::size_t needed = values.size() + more;
  if (needed <= values.capacity()) return;
  std::size_t room = std::max(needed, faces < kTypical ? 2 * needed : needed + needed / 8);
  if (faces >= kTypical && faces < expected.faces) {
    const double of_face = static_cast<double>(needed) / static_cast<double>(faces);
    const double all = std::min(1.01 * of_face * static_cast<double>(expected.faces), static_cast<double>(most));
    room = std::max(room, static_cast<std::size_t>(all));
  }
  values.reserve(room);
}

/// Collects them as they are.
class FaceCollector final : public FaceVisitor {
 public:
  using FaceVisitor::FaceVisitor;
  void expect(const ExpectedFaces& expected) override;
  void take(std::span<const std::uint32_t> corners, std::span<const float> texture) override;
  Faces finish() && { return std::move(faces_); }

 private:
  ExpectedFaces expected_;
  Faces faces_;
};

/// Collects them as triangles: polygons as fans.
class TriangleCollector final : public FaceVisitor {
 public:
  void expect(const ExpectedFaces& expected) override;
  void take(std::span<const std::uint32_t> corners, std::span<const float> texture) override;
  std::vector<std::array<std::uint32_t, 3>> finish() && { return std::move(triangles_); }

 private:
  ExpectedFaces expected_;
  std::uint64_t faces_ = 0;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
};

/// What is told of faces.
struct FaceSummary {
  std::uint64_t faces = 0;
  bool textured = false;           ///< some corner has texture coordinates
  std::uint64_t odd_textures = 0;  ///< faces with texture coordinates that are not two for each corner
};

/// Counts them.
class FaceCounter final : public FaceVisitor {
 public:
  FaceCounter() : FaceVisitor(true) {}
  void take(std::span<const std::uint32_t> corners, std::span<const float> texture) override {
    ++counts_.faces;
    if (texture.empty()) return;
    const bool fits = texture.size() == 2 * corners.size();
    counts_.textured = counts_.textured || fits;
    counts_.odd_textures += fits ? 0 : 1;
  }
  FaceSummary finish() const { return counts_; }

 private:
  FaceSummary counts_;
};

}  // namespace io
}  // namespace pointfair
