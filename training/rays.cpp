// SPDX-License-Identifier: Apache-2.0
// First hits of rays and closest points of a triangle mesh, in double precision, over a tree of boxes (binned surface
// area heuristic), and dart throwing. Called from rays.py through C; needs nothing but a compiler.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <vector>

namespace {

constexpr int kLeafTriangles = 4;
constexpr int kBins = 12;
constexpr int kStack = 128;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Vector {
  double x, y, z;
  double operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
};
Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vector operator*(double s, Vector a) { return {s * a.x, s * a.y, s * a.z}; }
double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vector cross(Vector a, Vector b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
Vector low(Vector a, Vector b) { return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}; }
Vector high(Vector a, Vector b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }

struct Box {
  Vector lo{kInfinity, kInfinity, kInfinity}, hi{-kInfinity, -kInfinity, -kInfinity};
  void add(Vector p) { lo = low(lo, p), hi = high(hi, p); }
  void add(const Box& b) { lo = low(lo, b.lo), hi = high(hi, b.hi); }
  double area() const {
    const Vector d = hi - lo;
    return d.x < 0 ? 0 : d.x * d.y + d.y * d.z + d.z * d.x;
  }
  double distance2(Vector p) const {
    const Vector d = high(high(lo - p, p - hi), {0, 0, 0});
    return dot(d, d);
  }
};

// count > 0: a leaf of triangles from first on; else the children are first and first + 1
struct Node {
  Box box;
  int32_t first = 0, count = 0;
};

struct Triangle {
  Vector a, b, c;
  int32_t id;
};

struct Mesh {
  std::vector<Triangle> triangles;
  std::vector<Node> nodes;

  Mesh(const double* vertices, const int32_t* corners, int64_t count) {
    std::vector<Box> boxes(count);
    std::vector<Triangle> all(count);
    std::vector<int32_t> order(count);
    std::iota(order.begin(), order.end(), 0);
    for (int64_t i = 0; i < count; ++i) {
      const auto at = [&](int k) {
        const double* v = vertices + 3 * static_cast<int64_t>(corners[3 * i + k]);
        return Vector{v[0], v[1], v[2]};
      };
      all[i] = {at(0), at(1), at(2), static_cast<int32_t>(i)};
      boxes[i].add(all[i].a), boxes[i].add(all[i].b), boxes[i].add(all[i].c);
    }
    nodes.reserve(2 * count / kLeafTriangles + 2);
    nodes.push_back({});
    build(0, 0, static_cast<int32_t>(count), order, boxes);
    triangles.reserve(count);
    for (int32_t i : order) triangles.push_back(all[i]);
  }

  void build(int32_t node, int32_t begin, int32_t end, std::vector<int32_t>& order, const std::vector<Box>& boxes) {
    Box box, middles;
    for (int32_t i = begin; i < end; ++i) {
      const Box& b = boxes[order[i]];
      box.add(b);
      middles.add(0.5 * (b.lo + b.hi));
    }
    nodes[node].box = box;
    nodes[node].first = begin, nodes[node].count = end - begin;
    if (end - begin <= kLeafTriangles) return;
    const Vector size = middles.hi - middles.lo;
    const int axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    const int32_t middle = split(axis, begin, end, middles, order, boxes);
    const auto child = static_cast<int32_t>(nodes.size());
    nodes.resize(child + 2);
    nodes[node].first = child, nodes[node].count = 0;
    build(child, begin, middle, order, boxes);
    build(child + 1, middle, end, order, boxes);
  }

  static int32_t split(int axis, int32_t begin, int32_t end, const Box& middles, std::vector<int32_t>& order,
                       const std::vector<Box>& boxes) {
    const double origin = middles.lo[axis], size = middles.hi[axis] - origin;
    const auto bin = [&](int32_t i) {
      const double m = 0.5 * (boxes[i].lo[axis] + boxes[i].hi[axis]);
      return std::min(kBins - 1, static_cast<int>((m - origin) / size * kBins));
    };
    if (!(size > 0)) return (begin + end) / 2;
    std::array<Box, kBins> box;
    std::array<int32_t, kBins> count{};
    for (int32_t i = begin; i < end; ++i) {
      const int k = bin(order[i]);
      box[k].add(boxes[order[i]]), ++count[k];
    }
    std::array<double, kBins> cost{};
    Box left, right;
    int32_t n = 0;
    for (int k = 0; k + 1 < kBins; ++k) left.add(box[k]), n += count[k], cost[k + 1] += n * left.area();
    n = 0;
    for (int k = kBins - 1; k > 0; --k) right.add(box[k]), n += count[k], cost[k] += n * right.area();
    const int best = static_cast<int>(std::min_element(cost.begin() + 1, cost.end()) - cost.begin());
    const auto middle =
        std::partition(order.begin() + begin, order.begin() + end, [&](int32_t i) { return bin(i) < best; });
    const auto at = static_cast<int32_t>(middle - order.begin());
    return at == begin || at == end ? (begin + end) / 2 : at;
  }
};

// entry of a ray into a box, infinite where it misses or begins beyond `limit`
double entry(const Box& box, Vector o, Vector inverse, double limit) {
  double from = 0, to = limit;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.lo[axis] - o[axis]) * inverse[axis], b = (box.hi[axis] - o[axis]) * inverse[axis];
    from = std::max(from, std::min(a, b)), to = std::min(to, std::max(a, b));
  }
  return from <= to * (1 + 1e-12) + 1e-300 ? from : kInfinity;
}

double hit(const Triangle& t, Vector o, Vector d) {
  const Vector u = t.b - t.a, v = t.c - t.a, p = cross(d, v);
  const double det = dot(u, p);
  if (det == 0) return kInfinity;
  const Vector s = o - t.a, q = cross(s, u);
  const double a = dot(s, p) / det, b = dot(d, q) / det, way = dot(v, q) / det;
  return a >= -1e-9 && b >= -1e-9 && a + b <= 1 + 1e-9 && way > 0 ? way : kInfinity;
}

void first_hit(const Mesh& mesh, Vector o, Vector d, double* range, int32_t* id) {
  const auto safe = [](double x) { return 1 / (std::abs(x) > 1e-30 ? x : 1e-30); };
  const Vector inverse{safe(d.x), safe(d.y), safe(d.z)};
  double best = kInfinity;
  int32_t found = -1;
  int32_t stack[kStack];
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Node& node = mesh.nodes[stack[--top]];
    if (entry(node.box, o, inverse, best) == kInfinity) continue;
    if (node.count > 0) {
      for (int32_t i = node.first; i < node.first + node.count; ++i) {
        const double t = hit(mesh.triangles[i], o, d);
        if (t < best) best = t, found = mesh.triangles[i].id;
      }
      continue;
    }
    const double a = entry(mesh.nodes[node.first].box, o, inverse, best);
    const double b = entry(mesh.nodes[node.first + 1].box, o, inverse, best);
    const int near = a <= b ? 0 : 1;
    if (std::max(a, b) < kInfinity) stack[top++] = node.first + 1 - near;
    if (std::min(a, b) < kInfinity) stack[top++] = node.first + near;
  }
  *range = best, *id = found;
}

// C. Ericson, Real-Time Collision Detection, 5.1.5
Vector closest_on(const Triangle& t, Vector p) {
  const Vector ab = t.b - t.a, ac = t.c - t.a, ap = p - t.a;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return t.a;
  const Vector bp = p - t.b;
  const double d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return t.b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return t.a + (d1 - d3 > 0 ? d1 / (d1 - d3) : 0) * ab;
  const Vector cp = p - t.c;
  const double d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return t.c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return t.a + (d2 - d6 > 0 ? d2 / (d2 - d6) : 0) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = d4 - d3 + d5 - d6 > 0 ? (d4 - d3) / (d4 - d3 + d5 - d6) : 0;
    return t.b + w * (t.c - t.b);
  }
  const double sum = va + vb + vc;
  return sum > 0 ? t.a + vb / sum * ab + vc / sum * ac : t.a;
}

void closest(const Mesh& mesh, Vector p, double* point, int32_t* id) {
  double best = kInfinity;
  Vector at{0, 0, 0};
  int32_t found = -1;
  int32_t stack[kStack];
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Node& node = mesh.nodes[stack[--top]];
    if (node.box.distance2(p) >= best) continue;
    if (node.count > 0) {
      for (int32_t i = node.first; i < node.first + node.count; ++i) {
        const Vector q = closest_on(mesh.triangles[i], p);
        const double d = dot(q - p, q - p);
        if (d < best) best = d, at = q, found = mesh.triangles[i].id;
      }
      continue;
    }
    const double a = mesh.nodes[node.first].box.distance2(p), b = mesh.nodes[node.first + 1].box.distance2(p);
    const int near = a <= b ? 0 : 1;
    if (std::max(a, b) < best) stack[top++] = node.first + 1 - near;
    if (std::min(a, b) < best) stack[top++] = node.first + near;
  }
  point[0] = at.x, point[1] = at.y, point[2] = at.z, *id = found;
}

// The places taken so far, by cells as wide as the distance that they keep.
struct Cells {
  double width;
  std::unordered_map<int64_t, std::vector<Vector>> taken;

  int64_t cell(double x) const { return static_cast<int64_t>(std::floor(x / width)); }
  static int64_t key(int64_t x, int64_t y, int64_t z) { return (x * 73856093) ^ (y * 19349663) ^ (z * 83492791); }

  bool is_free(Vector p) const {
    for (int64_t x = cell(p.x) - 1; x <= cell(p.x) + 1; ++x)
      for (int64_t y = cell(p.y) - 1; y <= cell(p.y) + 1; ++y)
        for (int64_t z = cell(p.z) - 1; z <= cell(p.z) + 1; ++z) {
          const auto found = taken.find(key(x, y, z));
          if (found == taken.end()) continue;
          for (Vector q : found->second)
            if (dot(p - q, p - q) < width * width) return false;
        }
    return true;
  }
  void take(Vector p) { taken[key(cell(p.x), cell(p.y), cell(p.z))].push_back(p); }
};

}  // namespace

extern "C" {

void* rays_mesh(const double* vertices, const int32_t* triangles, int64_t count) {
  return new Mesh(vertices, triangles, count);
}

void rays_free(void* mesh) { delete static_cast<Mesh*>(mesh); }

void rays_cast(const void* mesh, const double* origins, const double* directions, int64_t count, double* ranges,
               int32_t* ids) {
  for (int64_t i = 0; i < count; ++i) {
    const double *o = origins + 3 * i, *d = directions + 3 * i;
    first_hit(*static_cast<const Mesh*>(mesh), {o[0], o[1], o[2]}, {d[0], d[1], d[2]}, ranges + i, ids + i);
  }
}

void rays_closest(const void* mesh, const double* points, int64_t count, double* nearest, int32_t* ids) {
  for (int64_t i = 0; i < count; ++i) {
    const double* p = points + 3 * i;
    closest(*static_cast<const Mesh*>(mesh), {p[0], p[1], p[2]}, nearest + 3 * i, ids + i);
  }
}

// Dart throwing: keeps each point that is at least `distance` from those kept before it.
void rays_spread(const double* points, int64_t count, double distance, uint8_t* keep) {
  Cells cells{distance, {}};
  for (int64_t i = 0; i < count; ++i) {
    const Vector p{points[3 * i], points[3 * i + 1], points[3 * i + 2]};
    keep[i] = cells.is_free(p);
    if (keep[i]) cells.take(p);
  }
}

}  // extern "C"
