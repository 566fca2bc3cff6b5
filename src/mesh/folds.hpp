// SPDX-License-Identifier: Apache-2.0
// Folded faces, and steps that are shortened so that they fold none.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/topology.hpp"
#include "point/vec.h"

namespace pointfair {

// Which faces are folded: their normal is more than 90 degrees off their filtered normal. That is the mean of their
// normal and those of the faces across their edges, weighted by area, twice over; normals of faces that run round the
// other way count with the opposite sign. A face without area is not folded. `places`: of the vertices.
class Folds {
 public:
  // `faces` and `mesh`, which is theirs, must outlive this.
  Folds(const OrderedFaces& faces, const MeshTopology& mesh, std::span<const Point> places, const ForEach& for_each);

  const OrderedFaces& faces() const { return faces_; }
  const platform::LargeVector<std::uint8_t>& folded() const { return folded_; }
  // What the constructor would find, once only `moved` vertices have other places.
  void update(std::span<const Point> places, std::span<const std::uint32_t> moved);

 private:
  using Vec = point::Vec3<double>;
  Vec filtered(std::span<const Vec> normals, std::size_t face) const;
  void set_fold(std::size_t face) { folded_[face] = dot(normals_[face], filtered(once_, face)) < 0; }
  void add(std::uint32_t face);
  void add_neighbors(std::size_t end);

  const OrderedFaces& faces_;
  const MeshTopology& mesh_;
  platform::LargeVector<Vec> normals_, once_;  // twice the area long, and filtered once
  platform::LargeVector<std::uint8_t> folded_, is_stale_;
  std::vector<std::uint32_t> stale_;
};

// Shortens steps from `before` to `after` so that no face is folded which `folded_before` does not name. In each round
// the steps of all corners of such faces are halved at once, and after kMostHalvings they are not made; a step that was
// halved stays so. Rounds end where none is folded or no step is left. `folds` are those of `after`, before and after
// the call. The order of the faces does not matter.
void unfold(Folds& folds, std::span<const std::uint8_t> folded_before, std::span<const Point> before,
            std::span<Point> after);

}  // namespace pointfair
