// SPDX-License-Identifier: Apache-2.0
#include "mesh_distances.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace pointfair::cli {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kLeafSize = 4;

Vec3 closest_on_segment(Vec3 p, Vec3 a, Vec3 b) {
  const double l2 = squared_length(b - a);
  return l2 > 0 ? a + std::clamp(dot(p - a, b - a) / l2, 0.0, 1.0) * (b - a) : a;
}

Vec3 closest_on_outline(Vec3 p, const Triangle& t) {
  Vec3 best = closest_on_segment(p, t.a, t.b);
  for (const Vec3 candidate : {closest_on_segment(p, t.b, t.c), closest_on_segment(p, t.c, t.a)})
    if (squared_length(candidate - p) < squared_length(best - p)) best = candidate;
  return best;
}

struct Box {
  Vec3 low{kInfinity, kInfinity, kInfinity}, high{-kInfinity, -kInfinity, -kInfinity};

  void unite(Vec3 p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  double squared_distance(Vec3 p) const {
    return squared_length({std::max({0.0, low.x - p.x, p.x - high.x}), std::max({0.0, low.y - p.y, p.y - high.y}),
                           std::max({0.0, low.z - p.z, p.z - high.z})});
  }
};

Vec3 middle_of(const Triangle& t) { return t.a + t.b + t.c; }  // three times it

int widest_axis(const Box& box) {
  const Vec3 size = box.high - box.low;
  return size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
}

// Inside the prism over the triangle the foot lies on its plane, elsewhere on its outline.
Vec3 closest_on_triangle(Vec3 p, const Triangle& t) {
  const Vec3 normal = cross(t.b - t.a, t.c - t.a);
  const double n2 = squared_length(normal);
  const bool inside = n2 > 0 && dot(cross(t.b - t.a, p - t.a), normal) >= 0 &&
                      dot(cross(t.c - t.b, p - t.b), normal) >= 0 && dot(cross(t.a - t.c, p - t.c), normal) >= 0;
  return inside ? p - (dot(p - t.a, normal) / n2) * normal : closest_on_outline(p, t);
}

using FaceVertices = std::span<const std::uint32_t>;

// Calls visit(corners) for each face.
template <class Visit>
void for_faces(const Polygons& faces, const Visit& visit) {
  std::uint64_t begin = 0;
  for (const std::uint64_t end : faces.ends) {
    visit(FaceVertices(faces.corners.data() + begin, end - begin));
    begin = end;
  }
}

// Twice the area long; zero for a face without area, or with a corner that is not finite.
Vec3 area_normal(std::span<const Vec3> vertices, FaceVertices corners) {
  Vec3 sum;
  for (std::size_t i = 2; i < corners.size(); ++i)
    sum = sum + cross(vertices[corners[i - 1]] - vertices[corners[0]], vertices[corners[i]] - vertices[corners[0]]);
  return is_finite(sum) ? sum : Vec3{};
}

Vec3 middle(std::span<const Vec3> vertices, FaceVertices corners) {
  Vec3 sum;
  for (const std::uint32_t corner : corners) sum = sum + vertices[corner];
  return (1 / static_cast<double>(corners.size())) * sum;
}

// Of one face of A: its normal, and B's there.
struct NormalPair {
  Vec3 own, reference;
};

std::vector<NormalPair> normals_by_number(std::span<const Vec3> a, std::span<const Vec3> b, const Polygons& faces) {
  std::vector<NormalPair> pairs;
  for_faces(faces, [&](FaceVertices corners) { pairs.push_back({area_normal(a, corners), area_normal(b, corners)}); });
  return pairs;
}

std::vector<NormalPair> normals_by_place(std::span<const Vec3> a, const Polygons& faces,
                                         const std::vector<Triangle>& mesh, const Surface& surface) {
  std::vector<NormalPair> pairs;
  std::vector<Vec3> places;
  for_faces(faces, [&](FaceVertices corners) {
    const Vec3 normal = area_normal(a, corners);
    if (!(squared_length(normal) > 0)) return;
    pairs.push_back({normal, {}});
    places.push_back(middle(a, corners));
  });
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pairs.size(), 1024), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) {
      const auto& [p, q, r] = mesh[surface.closest(places[i]).triangle];
      pairs[i].reference = cross(q - p, r - p);
    }
  });
  return pairs;
}

void compare_normals(const std::vector<NormalPair>& pairs, FaceComparison& result) {
  double agreement = 0;  // by the area of A's faces
  for (const auto& [own, reference] : pairs)
    if (const double size = length(reference); size > 0) agreement += dot(own, reference) / size;
  result.turned = agreement < 0;
  double sum = 0;
  for (const auto& [own, reference] : pairs) {
    const double sizes = length(own) * length(reference);
    if (!(sizes > 0)) continue;
    const double cosine = std::clamp((result.turned ? -1 : 1) * dot(own, reference) / sizes, -1.0, 1.0);
    sum += std::acos(cosine);
    ++result.faces;
    result.folded += cosine < 0;
  }
  if (result.faces > 0) result.normal_error = sum / static_cast<double>(result.faces) * 180 / std::numbers::pi;
}

// A side of a face, from one place to another.
using Side = std::pair<std::uint32_t, std::uint32_t>;

// Whether each side has one in the opposite direction, and none is there twice.
bool encloses(std::vector<Side> sides) {
  std::vector<Side> back;
  for (const auto& [from, to] : sides) back.emplace_back(to, from);
  std::ranges::sort(sides);
  std::ranges::sort(back);
  return sides == back && std::ranges::adjacent_find(sides) == sides.end();
}

std::optional<double> volume_of(std::span<const Vec3> vertices, const Polygons& faces) {
  const std::vector<std::uint32_t> welded = weld(vertices);
  std::vector<Side> sides;
  double sum = 0;
  bool all_finite = true;
  for_faces(faces, [&](FaceVertices corners) {
    for (std::size_t i = 0; i < corners.size(); ++i) {
      all_finite = all_finite && is_finite(vertices[corners[i]]);
      const std::uint32_t from = welded[corners[i]], to = welded[corners[(i + 1) % corners.size()]];
      if (from != to) sides.emplace_back(from, to);
    }
    for (std::size_t i = 2; i < corners.size(); ++i)
      sum += dot(vertices[corners[0]], cross(vertices[corners[i - 1]], vertices[corners[i]])) / 6;
  });
  if (!all_finite || sides.empty() || !encloses(std::move(sides))) return std::nullopt;
  return std::abs(sum);
}

}  // namespace

// A tree of boxes over the triangles, halved along the widest axis. The triangles of a node follow each other. The
// first half of a node's triangles is the node behind it.
struct Surface::Tree {
  struct Node {
    Box box;
    std::uint32_t begin = 0, end = 0, second = 0;  // triangles, and the node of their second half; 0: a leaf
  };
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> order;
  std::vector<Node> nodes;

  explicit Tree(std::vector<Triangle> its_triangles) : triangles(std::move(its_triangles)), order(triangles.size()) {
    std::iota(order.begin(), order.end(), 0u);
    if (!order.empty()) add_node(0, static_cast<std::uint32_t>(order.size()));
  }

  std::uint32_t add_node(std::uint32_t begin, std::uint32_t end) {
    const auto number = static_cast<std::uint32_t>(nodes.size());
    Node node{{}, begin, end, 0};
    Box middles;
    for (std::uint32_t i = begin; i < end; ++i) {
      const Triangle& t = triangles[order[i]];
      for (const Vec3 corner : {t.a, t.b, t.c}) node.box.unite(corner);
      middles.unite(middle_of(t));
    }
    nodes.push_back(node);
    if (end - begin <= kLeafSize) return number;
    const std::uint32_t half = begin + (end - begin) / 2;
    std::nth_element(order.begin() + begin, order.begin() + half, order.begin() + end,
                     [&, axis = widest_axis(middles)](std::uint32_t s, std::uint32_t t) {
                       return coordinate(middle_of(triangles[s]), axis) < coordinate(middle_of(triangles[t]), axis);
                     });
    add_node(begin, half);
    nodes[number].second = add_node(half, end);
    return number;
  }

  void ask(Vec3 point, std::uint32_t number, Foot& foot) const {
    const Node& node = nodes[number];
    if (node.second == 0) {
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const Vec3 place = closest_on_triangle(point, triangles[order[i]]);
        const double squared_distance = squared_length(place - point);
        if (squared_distance < foot.squared_distance) foot = {place, squared_distance, order[i]};
      }
      return;
    }
    std::uint32_t near = number + 1, far = node.second;
    double to_near = nodes[near].box.squared_distance(point), to_far = nodes[far].box.squared_distance(point);
    if (to_far < to_near) std::swap(near, far), std::swap(to_near, to_far);
    if (to_near < foot.squared_distance) ask(point, near, foot);
    if (to_far < foot.squared_distance) ask(point, far, foot);
  }
};

Surface::Surface(std::vector<Triangle> triangles) : tree_(std::make_unique<Tree>(std::move(triangles))) {}
Surface::~Surface() = default;

Foot Surface::closest(Vec3 point) const {
  Foot foot;
  if (!tree_->nodes.empty()) tree_->ask(point, 0, foot);
  return foot;
}

std::vector<Triangle> finite_triangles(std::span<const Vec3> vertices, const Polygons& faces) {
  std::vector<Triangle> result;
  for_faces(faces, [&](FaceVertices corners) {
    for (std::size_t i = 2; i < corners.size(); ++i) {
      const Triangle t = {vertices[corners[0]], vertices[corners[i - 1]], vertices[corners[i]]};
      if (is_finite(t.a) && is_finite(t.b) && is_finite(t.c)) result.push_back(t);
    }
  });
  return result;
}

std::vector<std::uint32_t> weld(std::span<const Vec3> vertices) {
  const auto key = [&](std::uint32_t i) { return std::array{vertices[i].x, vertices[i].y, vertices[i].z}; };
  std::vector<std::uint32_t> order(vertices.size()), first(vertices.size());
  std::iota(order.begin(), order.end(), 0u);
  std::erase_if(order, [&](std::uint32_t i) { return !is_finite(vertices[i]); });
  std::ranges::sort(order,
                    [&](std::uint32_t i, std::uint32_t j) { return key(i) != key(j) ? key(i) < key(j) : i < j; });
  for (std::size_t n = 0; n < order.size(); ++n) {
    const bool same = n > 0 && key(order[n]) == key(order[n - 1]);
    first[order[n]] = same ? first[order[n - 1]] : order[n];
  }
  return first;
}

FaceComparison compare_faces(std::span<const Vec3> a, const Polygons& faces_a, std::span<const Vec3> b,
                             const Polygons& faces_b, const Surface& surface) {
  FaceComparison result;
  const bool same = a.size() == b.size() && faces_a.ends == faces_b.ends && faces_a.corners == faces_b.corners;
  compare_normals(
      same ? normals_by_number(a, b, faces_a) : normals_by_place(a, faces_a, finite_triangles(b, faces_b), surface),
      result);
  const Surface own(finite_triangles(a, faces_a));
  std::vector<Vec3> from(b.begin(), b.end());
  std::erase_if(from, [](Vec3 p) { return !is_finite(p); });
  std::vector<double> back(from.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, from.size(), 1024), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i)
      back[i] = std::sqrt(own.closest(from[i]).squared_distance);
  });
  result.back = summarize(back);
  result.volume = volume_of(a, faces_a);
  result.reference = volume_of(b, faces_b);
  return result;
}

}  // namespace pointfair::cli
