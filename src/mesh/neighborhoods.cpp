// SPDX-License-Identifier: Apache-2.0
#include "mesh/neighborhoods.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_set>

#include "mesh/folds.hpp"

namespace pointfair {
namespace {

using Vec = point::Vec3<double>;

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

MeshNeighborhoods::MeshNeighborhoods(const LoadedMesh& mesh) : mesh_(mesh) {
  const MeshEdges& edges = mesh.topology.edges;
  std::vector<std::uint32_t> all;
  for (const bool within : {true, false}) {
    for (std::uint32_t v = 0; v < edges.vertices(); ++v)
      if (!edges.neighbors_of(v).empty() && (edges.is_boundary[v] == 0 || !within)) all.push_back(v);
    if (!all.empty()) break;  // a mesh without any vertex within is all boundary
  }
  const std::size_t count = std::min(all.size(), kMeasuredVertices);
  for (std::size_t i = 0; i < count; ++i) measured_.push_back(all[i * all.size() / count]);
}

double MeshNeighborhoods::two_ring_radius() const {
  const MeshEdges& edges = mesh_.topology.edges;
  std::vector<double> radii;
  for (const std::uint32_t v : measured_) {
    const Vec here = place_of(mesh_.places, v);
    double farthest = 0;
    for (const std::uint32_t first : edges.neighbors_of(v)) {
      farthest = std::max(farthest, squared_length(place_of(mesh_.places, first) - here));
      for (const std::uint32_t second : edges.neighbors_of(first))
        farthest = std::max(farthest, squared_length(place_of(mesh_.places, second) - here));
    }
    radii.push_back(std::sqrt(farthest));
  }
  return median(std::move(radii));
}

double MeshNeighborhoods::height_deviation(double radius) const {
  const MeshEdges& edges = mesh_.topology.edges;
  std::vector<double> deviations;
  for (const std::uint32_t v : measured_) {
    const Vec here = place_of(mesh_.places, v);
    Vec normal{};
    for (const std::uint32_t f : mesh_.faces.around(v))
      normal = normal + face_normal(mesh_.faces.corners(f), mesh_.places);
    const double length = std::sqrt(squared_length(normal));
    if (!(length > 0)) continue;
    std::vector<std::uint32_t> reached{v};
    std::unordered_set<std::uint32_t> seen{v};
    std::vector<double> heights;
    double sum = 0;
    for (std::size_t i = 0; i < reached.size(); ++i)
      for (const std::uint32_t there : edges.neighbors_of(reached[i])) {
        const Vec offset = place_of(mesh_.places, there) - here;
        if (squared_length(offset) > radius * radius || !seen.insert(there).second) continue;
        reached.push_back(there);
        heights.push_back(dot(offset, normal) / length);
        sum += heights.back();
      }
    if (heights.empty()) continue;
    const double mean = sum / double(heights.size());
    double squares = 0;
    for (const double h : heights) squares += (h - mean) * (h - mean);
    deviations.push_back(std::sqrt(squares / double(heights.size())));
  }
  return median(std::move(deviations));
}

}  // namespace pointfair
