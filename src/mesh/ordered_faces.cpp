// SPDX-License-Identifier: Apache-2.0
#include "mesh/ordered_faces.hpp"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <tuple>

#include "mesh/blocks.hpp"
#include "mesh/face_corners.hpp"

namespace pointfair {
namespace {

// Faces that were read together, by the ranks of their corners, the least first.
struct Part {
  std::vector<std::uint32_t> ranks, sizes;
  std::uint64_t degenerate = 0;
};

using Ranks = std::span<const std::uint32_t>;

// The corner after and the one before `vertex`; both are the vertex if the face has no such corner.
struct Beside {
  std::uint32_t after, before;
};
Beside beside(std::span<const std::uint32_t> corners, std::uint32_t vertex) {
  for (std::size_t i = 0; i < corners.size(); ++i)
    if (corners[i] == vertex)
      return {corners[i + 1 < corners.size() ? i + 1 : 0], corners[i > 0 ? i - 1 : corners.size() - 1]};
  return {vertex, vertex};
}

}  // namespace

OrderedFaces::OrderedFaces(std::span<const Point> points, const Vertices& vertices, const Polygons& faces,
                           const ForEach& for_each)
    : vertices_(vertices.in_order) {
  collect(points, vertices, faces, for_each);
  collect_around(points.size());
  across_.resize(faces_.corners.size());
  across_count_.resize(size());
  std::atomic<bool> encloses = size() > 0;
  for_mesh_blocks(size(), for_each, [&](std::size_t first, std::size_t last, std::size_t) {
    bool all = true;
    for (std::size_t f = first; f < last; ++f) all = find_across(f) && all;
    if (!all) encloses = false;
  });
  faces_.encloses = encloses;
}

// Faces by their ranks: first by the least, of which there are few faces each.
void OrderedFaces::collect(std::span<const Point> points, const Vertices& vertices, const Polygons& faces,
                           const ForEach& for_each) {
  const std::vector<std::uint32_t>& order = vertices.in_order;
  std::vector<std::uint32_t> rank(points.size());
  for (std::uint32_t r = 0; r < order.size(); ++r) rank[order[r]] = r;

  std::vector<Part> parts(mesh_blocks(faces.size()));
  for_mesh_blocks(faces.size(), for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    Part& part = parts[block];
    FaceCorners each(points, faces, vertices.of_point);
    part.degenerate = each.for_each(first, last, [&](std::span<std::uint32_t> corners) {
      for (std::uint32_t& corner : corners) corner = rank[corner];
      std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
      part.ranks.insert(part.ranks.end(), corners.begin(), corners.end());
      part.sizes.push_back(std::uint32_t(corners.size()));
    });
  });

  const auto for_all = [&](const auto& visit) {
    for (const Part& part : parts) {
      const std::uint32_t* next = part.ranks.data();
      for (const std::uint32_t count : part.sizes) visit(Ranks(next, count)), next += count;
    }
  };
  std::vector<std::size_t> begin(order.size() + 1);
  for_all([&](Ranks ranks) { ++begin[ranks[0] + 1]; });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Ranks> sorted(begin.back());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  for_all([&](Ranks ranks) { sorted[next[ranks[0]]++] = ranks; });
  for_mesh_blocks(order.size(), for_each, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t r = first; r < last; ++r)
      std::sort(sorted.begin() + std::ptrdiff_t(begin[r]), sorted.begin() + std::ptrdiff_t(begin[r + 1]),
                [](Ranks a, Ranks b) { return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end()); });
  });

  for (const Part& part : parts) degenerate_ += part.degenerate;
  faces_.ends.resize(sorted.size());
  std::size_t end = 0;
  for (std::size_t f = 0; f < sorted.size(); ++f) faces_.ends[f] = end += sorted[f].size();
  faces_.corners.resize(end);
  for_mesh_blocks(sorted.size(), for_each, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t f = first; f < last; ++f)
      std::transform(sorted[f].begin(), sorted[f].end(),
                     faces_.corners.begin() + std::ptrdiff_t(faces_.ends[f]) - std::ptrdiff_t(sorted[f].size()),
                     [&](std::uint32_t r) { return order[r]; });
  });
}

void OrderedFaces::collect_around(std::size_t points) {
  std::vector<std::size_t>& begin = faces_.around_begin;
  begin.assign(points + 1, 0);
  for (const std::uint32_t v : faces_.corners) ++begin[v + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  faces_.around_faces.resize(faces_.corners.size());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  for (std::size_t f = 0; f < size(); ++f)
    for (const std::uint32_t v : corners(f)) faces_.around_faces[next[v]++] = std::uint32_t(f);
}

// Whether every edge of the face has one other face, which runs round alike.
bool OrderedFaces::find_across(std::size_t face) {
  const auto its = corners(face);
  Across* const found = across_.data() + (face == 0 ? 0 : faces_.ends[face - 1]);
  std::uint32_t count = 0;
  bool encloses = true;
  for (std::size_t i = 0; i < its.size(); ++i) {
    const std::uint32_t from = its[i], to = its[i + 1 < its.size() ? i + 1 : 0];
    int others = 0;
    Across other{};
    for (const std::uint32_t there : around(from)) {
      if (there == face) continue;
      const Beside its_beside = beside(corners(there), from);
      if (its_beside.after == to || its_beside.before == to) other = {there, its_beside.after == to}, ++others;
    }
    if (others == 1) found[count++] = other;
    encloses = encloses && others == 1 && !other.is_opposite;
  }
  std::sort(found, found + count, [](const Across& a, const Across& b) {
    return std::tie(a.face, a.is_opposite) < std::tie(b.face, b.is_opposite);
  });
  across_count_[face] = count;
  return encloses;
}

}  // namespace pointfair
