// SPDX-License-Identifier: Apache-2.0
#include "surface.hpp"

#include <algorithm>
#include <cmath>
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

}  // namespace pointfair::cli
