// SPDX-License-Identifier: Apache-2.0
#include "distances.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <numbers>
#include <numeric>

#include "pointfair/pipeline.hpp"

namespace pointfair::cli {
namespace {

// All measuring happens where B's bounding sphere, as the standard test set defines it (the centre of its bounding box,
// the largest distance to it), is the unit sphere, whatever the files' units.
struct Frame {
  Vec3 centre;  // in file coordinates
  double radius = 0, diagonal = 0;

  double scale() const { return radius > 0 ? 1 / radius : 1; }
};

Vec3 file_place(const Cloud& cloud, const Point& p) {
  return {cloud.origin[0] + p.x, cloud.origin[1] + p.y, cloud.origin[2] + p.z};
}

Frame frame_of(const Cloud& cloud) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Vec3 min = {kInfinity, kInfinity, kInfinity}, max = {-kInfinity, -kInfinity, -kInfinity};
  for (const Point& point : cloud.points) {
    const Vec3 p = file_place(cloud, point);
    if (!is_finite(p)) continue;
    min = {std::min(min.x, p.x), std::min(min.y, p.y), std::min(min.z, p.z)};
    max = {std::max(max.x, p.x), std::max(max.y, p.y), std::max(max.z, p.z)};
  }
  Frame frame = {0.5 * (min + max), 0, length(max - min)};
  for (const Point& point : cloud.points) {
    const Vec3 p = file_place(cloud, point);
    if (is_finite(p)) frame.radius = std::max(frame.radius, length(p - frame.centre));
  }
  return frame;
}

// All points, in order; one that is not finite stays so.
std::vector<Vec3> places(const Cloud& cloud, const Frame& frame) {
  std::vector<Vec3> result;
  result.reserve(cloud.points.size());
  for (const Point& p : cloud.points) result.push_back(frame.scale() * (file_place(cloud, p) - frame.centre));
  return result;
}

std::vector<Vec3> finite(std::vector<Vec3> points) {
  std::erase_if(points, [](Vec3 p) { return !is_finite(p); });
  return points;
}

// nanoflann's view of an array of points.
struct PointArray {
  const std::vector<Vec3>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const { return coordinate(points[i], static_cast<int>(axis)); }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

template <class Of, class F>
std::vector<double> for_each_point(const std::vector<Of>& points, const F& measure) {
  std::vector<double> result(points.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 1024), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) result[i] = measure(i);
  });
  return result;
}

// Squared distance of each point of `from` to the nearest of `to`.
std::vector<double> squared_distances(const std::vector<Vec3>& from, const std::vector<Vec3>& to) {
  using Metric = nanoflann::L2_Simple_Adaptor<double, PointArray>;
  const PointArray array = {to};
  const nanoflann::KDTreeSingleIndexAdaptor<Metric, PointArray, 3, std::size_t> tree(3, array, {10});
  return for_each_point(from, [&](std::size_t i) {
    const double query[3] = {from[i].x, from[i].y, from[i].z};
    std::size_t index = 0;
    double squared = 0;
    static_cast<void>(tree.knnSearch(query, 1, &index, &squared));  // the number found: one, as `to` is not empty
    return squared;
  });
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// Squared distance and foot of every point; the feet decide which points lie near an edge.
std::vector<double> measure_surface(const std::vector<Vec3>& points, const Surface& surface, std::vector<Foot>& feet) {
  feet.resize(points.size());
  return for_each_point(points, [&](std::size_t i) {
    feet[i] = surface.closest(points[i]);
    return feet[i].squared_distance;
  });
}

// Unit normals of the planes through the k nearest points (Hoppe 1992), zero where there is none. They are those of the
// first stages of a run; lengths of which nothing depends here are given, so that none is looked for.
std::vector<Point> plane_normals(const Cloud& cloud, int k, unsigned threads) {
  Params params{.k = k, .iterations = 1};
  params.normal_sigma = 1e15;  // so wide that weights are equal
  params.closeness_sigma = params.similarity_sigma = 1;
  Pipeline pipeline({Device::cpu, 0, threads});
  pipeline.load(cloud.points);
  std::vector<Point> normals(cloud.points.size());
  pipeline.run(params, normals);
  pipeline.normals(normals);
  return normals;
}

// Mean angle between the normals of the points and of the faces nearest to them; `feet` are of the finite points.
std::optional<double> mean_normal_error(const Cloud& cloud, const std::vector<Point>& normals,
                                        const std::vector<Foot>& feet, const std::vector<Triangle>& mesh) {
  double sum = 0, count = 0;
  auto foot = feet.begin();
  for (std::size_t i = 0; i < normals.size(); ++i) {
    if (!is_finite(file_place(cloud, cloud.points[i]))) continue;
    const auto& [a, b, c] = mesh[(foot++)->triangle];
    const Vec3 face = cross(b - a, c - a), normal = {normals[i].x, normals[i].y, normals[i].z};
    const double lengths = length(face) * length(normal);
    if (!(lengths > 0)) continue;
    sum += std::acos(std::min(1.0, std::abs(dot(face, normal)) / lengths));
    ++count;
  }
  return count > 0 ? std::optional(sum / count * 180 / std::numbers::pi) : std::nullopt;
}

// Points whose foot lies within 1 % of the diagonal of a sharp edge.
void measure_edges(const std::vector<double>& squared, const std::vector<Foot>& feet, std::vector<Triangle> edges,
                   const Frame& frame, Distances& result) {
  if (edges.empty()) return;
  const Surface surface(std::move(edges));
  const double reach = 0.01 * frame.diagonal * frame.scale();
  const std::vector<double> to_edge =
      for_each_point(feet, [&](std::size_t i) { return surface.closest(feet[i].place).squared_distance; });
  double sum = 0;
  for (std::size_t i = 0; i < feet.size(); ++i) {
    if (to_edge[i] > reach * reach) continue;
    sum += squared[i];
    ++result.edge_points;
  }
  if (result.edge_points == 0) return;
  result.edge_rms = std::sqrt(sum / static_cast<double>(result.edge_points)) / frame.scale();
}

// One face's side of an edge between two welded vertices.
struct HalfEdge {
  std::uint32_t low, high;
  bool forward;  // the face runs from low to high
  Vec3 normal;
  Triangle segment;
  bool same_edge(const HalfEdge& other) const { return low == other.low && high == other.high; }
};

std::vector<HalfEdge> half_edges(std::span<const Vec3> vertices, std::span<const std::array<std::uint32_t, 3>> faces) {
  const std::vector<std::uint32_t> welded = weld(vertices);
  std::vector<HalfEdge> result;
  for (const auto& face : faces) {
    const Vec3 normal = cross(vertices[face[1]] - vertices[face[0]], vertices[face[2]] - vertices[face[0]]);
    const double size = length(normal);
    if (!(size > 0) || !std::isfinite(size)) continue;
    for (std::size_t side = 0; side < 3; ++side) {
      const std::uint32_t from = face[side], to = face[(side + 1) % 3];
      const std::uint32_t a = welded[from], b = welded[to];
      result.push_back(
          {std::min(a, b), std::max(a, b), a < b, (1 / size) * normal, {vertices[from], vertices[to], vertices[to]}});
    }
  }
  std::ranges::sort(
      result, [](const HalfEdge& x, const HalfEdge& y) { return x.low != y.low ? x.low < y.low : x.high < y.high; });
  return result;
}

// The edges between two faces that turn by more than `degrees`, as segments. Vertices at the same place count as one;
// faces may be oriented either way.
std::vector<Triangle> sharp_edges(std::span<const Vec3> vertices, std::span<const std::array<std::uint32_t, 3>> faces,
                                  double degrees) {
  const std::vector<HalfEdge> halves = half_edges(vertices, faces);
  const double limit = std::cos(degrees * std::numbers::pi / 180);
  std::vector<Triangle> result;
  for (std::size_t begin = 0, end; begin < halves.size(); begin = end) {
    end = begin + 1;
    while (end < halves.size() && halves[end].same_edge(halves[begin])) ++end;
    if (end - begin != 2) continue;
    const HalfEdge &one = halves[begin], &other = halves[begin + 1];
    const double sign = one.forward == other.forward ? -1 : 1;  // alike: the two faces are oriented against each other
    if (sign * dot(one.normal, other.normal) < limit) result.push_back(one.segment);
  }
  return result;
}

FaceComparison in_file_units(FaceComparison faces, const Frame& frame) {
  const double unit = 1 / frame.scale();
  for (double* value : {&faces.back.mean, &faces.back.rms, &faces.back.p95, &faces.back.max}) *value *= unit;
  for (std::optional<double>* volume : {&faces.volume, &faces.reference})
    if (*volume) **volume *= unit * unit * unit;
  return faces;
}

}  // namespace

Distances compare_clouds(const Cloud& a, const Cloud& b, const CompareOptions& options) {
  const Frame frame = frame_of(b);
  const std::vector<Vec3> vertices = places(b, frame);
  const std::vector<Vec3> from = finite(places(a, frame));
  const std::vector<Vec3> to = finite(vertices);
  for (const auto& [points, name] : {std::pair(&to, &options.names[1]), std::pair(&from, &options.names[0])})
    if (points->empty())
      throw Error(ErrorKind::file, *name + ": has no finite point, so there is no distance; choose another file");

  const Polygons faces = options.as_cloud ? Polygons() : polygons(b);
  const std::vector<Triangle> mesh = finite_triangles(vertices, faces);
  if ((options.edge_degrees || options.normal_neighbors) && mesh.empty())
    throw Error(ErrorKind::usage, std::string(options.edge_degrees ? "--edges" : "--normals") +
                                      " needs a mesh, but the second file is taken as a cloud");
  Distances result;
  result.points = from.size();
  result.mesh = !mesh.empty();
  result.diagonal = frame.diagonal;
  std::vector<double> squared = squared_distances(from, to);
  result.chamfer = mean(squared) + mean(squared_distances(to, from));
  if (result.mesh) {
    std::vector<Foot> feet;
    const Surface surface(mesh);
    squared = measure_surface(from, surface, feet);
    if (options.edge_degrees)
      measure_edges(squared, feet, sharp_edges(vertices, triangles(b), *options.edge_degrees), frame, result);
    if (const Polygons own = polygons(a); own.size() > 0)
      result.faces = in_file_units(compare_faces(places(a, frame), own, vertices, faces, surface), frame);
    if (options.normal_neighbors)
      result.normal_error =
          mean_normal_error(a, plane_normals(a, *options.normal_neighbors, options.threads), feet, mesh);
  }
  for (double& value : squared) value = std::sqrt(value) / frame.scale();
  result.distance = summarize(squared);
  return result;
}

}  // namespace pointfair::cli
