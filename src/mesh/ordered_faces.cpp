// SPDX-License-Identifier: Apache-2.0
#include "mesh/ordered_faces.hpp"

#include <algorithm>

#include "mesh/blocks.hpp"

namespace pointfair {
namespace {

// The corners of faces as vertices, and which faces are degenerate.
// `vertex`: of each point, as MeshEdges. What is passed must outlive this.
class FaceCorners {
 public:
  FaceCorners(const Polygons& faces, std::span<const std::uint32_t> vertex) : faces_(faces), vertex_(vertex) {}

  // Calls visit(corners) for each face from `first` to before `last` that is not degenerate, and returns how many are.
  template <class Visit>
  std::uint64_t for_each(std::size_t first, std::size_t last, const Visit& visit) {
    std::uint64_t degenerate = 0, begin = first == 0 ? 0 : faces_.ends[first - 1];
    for (std::size_t face = first; face < last; ++face) {
      const std::uint64_t end = faces_.ends[face];
      if (take(begin, end)) {
        visit(std::span<std::uint32_t>(corners_));
      } else {
        ++degenerate;
      }
      begin = end;
    }
    return degenerate;
  }

 private:
  bool take(std::uint64_t begin, std::uint64_t end) {
    corners_.clear();
    for (std::uint64_t c = begin; c < end; ++c) {
      const std::uint32_t at = vertex_[faces_.corners[c]];
      if (at == kNoVertex) return false;
      if (corners_.empty() || corners_.back() != at) corners_.push_back(at);
    }
    while (corners_.size() > 1 && corners_.back() == corners_.front()) corners_.pop_back();
    return corners_.size() >= 3 && all_differ();
  }
  bool all_differ() {
    if (corners_.size() == 3) return true;  // those beside each other do
    sorted_ = corners_;
    std::ranges::sort(sorted_);
    return std::ranges::adjacent_find(sorted_) == sorted_.end();
  }

  const Polygons& faces_;
  std::span<const std::uint32_t> vertex_;
  std::vector<std::uint32_t> corners_, sorted_;
};

// Faces that were read together, each from its least corner on.
struct Part {
  std::vector<std::uint32_t> corners, sizes;
  std::uint64_t degenerate = 0;
};

using FaceVertices = std::span<const std::uint32_t>;

OrderedFaces::Beside beside_of(FaceVertices corners, std::uint32_t vertex) {
  const std::size_t own = std::size_t(std::ranges::find(corners, vertex) - corners.begin()), last = corners.size() - 1;
  return {corners[own < last ? own + 1 : 0], corners[own > 0 ? own - 1 : last]};
}

}  // namespace

OrderedFaces::OrderedFaces(const Vertices& vertices, const Polygons& faces, const ForEach& for_each) {
  collect(vertices, faces, for_each);
  collect_around(vertices.size(), for_each);
}

// Faces by their corners: first by the least, of which there are few faces each.
void OrderedFaces::collect(const Vertices& vertices, const Polygons& faces, const ForEach& for_each) {
  std::vector<Part> parts(mesh_blocks(faces.size()));
  for_mesh_blocks(faces.size(), for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    Part& part = parts[block];
    FaceCorners each(faces, vertices.of_point);
    part.degenerate = each.for_each(first, last, [&](std::span<std::uint32_t> corners) {
      std::rotate(corners.begin(), std::ranges::min_element(corners), corners.end());
      part.corners.insert(part.corners.end(), corners.begin(), corners.end());
      part.sizes.push_back(std::uint32_t(corners.size()));
    });
  });
  for (const Part& part : parts) degenerate_ += part.degenerate;

  ByNumber<FaceVertices> sorted = sort_by_number<FaceVertices>(
      parts.size(), vertices.size(), for_each, [&](std::size_t first, std::size_t last, const auto& emit) {
        for (std::size_t part = first; part < last; ++part) {
          const std::uint32_t* next = parts[part].corners.data();
          for (const std::uint32_t count : parts[part].sizes) emit(*next, FaceVertices(next, count)), next += count;
        }
      });
  for_mesh_items(vertices.size(), for_each, [&](std::size_t v) {
    const std::span<FaceVertices> its = sorted.of(v);
    std::ranges::sort(its, [](FaceVertices a, FaceVertices b) { return std::ranges::lexicographical_compare(a, b); });
  });
  faces_.ends.resize(sorted.items.size());
  const auto size = [&](std::size_t f) { return sorted.items[f].size(); };
  faces_.corners.resize(place_in_order(faces_.ends.size(), for_each, size,
                                       [&](std::size_t f, std::size_t begin) { faces_.ends[f] = begin + size(f); }));
  for_mesh_items(faces_.ends.size(), for_each, [&](std::size_t f) {
    std::ranges::copy(sorted.items[f], faces_.corners.begin() + std::ptrdiff_t(first_corner(f)));
  });
}

void OrderedFaces::collect_around(std::size_t vertices, const ForEach& for_each) {
  ByNumber<std::uint32_t> around = sort_by_number<std::uint32_t>(
      size(), vertices, for_each, [&](std::size_t first, std::size_t last, const auto& emit) {
        for (std::size_t f = first; f < last; ++f)
          for (const std::uint32_t v : corners(f)) emit(v, std::uint32_t(f));
      });
  faces_.around_begin = std::move(around.begin);
  faces_.around_faces = std::move(around.items);
  beside_.resize(faces_.around_faces.size());
  for_mesh_items(vertices, for_each, [&](std::size_t v) {
    for (std::size_t i = faces_.around_begin[v]; i < faces_.around_begin[v + 1]; ++i)
      beside_[i] = beside_of(corners(faces_.around_faces[i]), std::uint32_t(v));
  });
}

}  // namespace pointfair
