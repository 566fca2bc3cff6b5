// SPDX-License-Identifier: Apache-2.0
// Runs along the faces of the loaded cloud.
#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "mesh/evening.hpp"
#include "mesh/face_filter.hpp"
#include "mesh/neighborhoods.hpp"
#include "mesh/ring_sums.hpp"
#include "pipeline/run_state.hpp"
#include "seam/cloud_sample.hpp"
#include "seam/noise_levels.hpp"

namespace pointfair {
namespace {

constexpr double kLeastDeviation = 1e-6;  // of the heights, in radii; a plane without noise has none

// The points of each vertex but the first.
std::vector<Copy> seams_of(const MeshEdges& edges, std::span<const Point> points) {
  std::vector<Copy> seams;
  for (std::uint32_t i = 0; i < points.size(); ++i)
    if (const std::uint32_t v = edges.vertex[i]; v != kNoVertex && edges.first[v] != i)
      seams.push_back({i, edges.first[v], points[i]});
  return seams;
}

}  // namespace

void Pipeline::State::set_faces(Polygons faces) {
  check_faces(faces, cloud.points());
  faces_ = std::move(faces);
  mesh_.reset();
}

const LoadedMesh& Pipeline::State::mesh() {
  if (mesh_) return *mesh_;
  std::optional<Polygons> read;
  const Polygons& faces = faces_ ? *faces_ : read.emplace(polygons(shell));
  if (faces.size() == 0)
    throw Error(ErrorKind::usage,
                "--connectivity mesh needs faces, and this cloud has none: leave it out, or give a mesh");
  check_faces(faces, cloud.points());
  std::vector<Point> points(cloud.points());
  cloud.backend().download_input(points);
  const auto start = Clock::now();
  mesh_ = std::make_shared<const LoadedMesh>(points, faces, cloud.backend().sampling().on_host());
  cloud.keep_seams(seams_of(mesh_->topology.edges, points));
  log_.note("faces", milliseconds_since(start));
  return *mesh_;
}

// With used.connectivity mesh: a vertex is one point to all stages. What finish_mesh() asks for is measured before, as
// it may need other points set aside.
void Pipeline::State::set_seams_aside(const Params& used) {
  if (used.tangential.value_or(0) > 0) sigma_of(used);
  mesh();
  set_aside(Aside::seams);
}

// With used.connectivity mesh.
void Pipeline::State::follow_mesh(const Params& used, Settings& settings) {
  const MeshEdges& edges = mesh().topology.edges;
  settings.neighbors.mesh = {mesh_, &edges};
  if (used.keep_boundary) settings.fairing.kept_boundary = {mesh_, &edges};
  if (is_of_faces(used.method)) settings.normals.faces = {mesh_, &mesh_->faces.faces()};
  if (used.method == Method::implicit || used.method == Method::jones)
    settings.fairing.faces = {mesh_, &mesh_->faces.faces()};
}

double Pipeline::State::in_file_units(const Length& length, IndexOrder order, const std::stop_token& stop) {
  if (length.unit == Length::Unit::percent) return length.value * diagonal_of(sample().bounds) / 100;
  if (length.unit != Length::Unit::spacing) return length.value;
  measure({true, false}, order, stop);
  return length.value * spacing(false)->mean;
}

// What methods fleishman and jones measure along the faces; other parameters stay as they are.
Params Pipeline::State::with_mesh_values(const Params& params, IndexOrder order, const std::stop_token& stop) {
  Params result = params;
  if (!is_of_faces(params.method)) return result;
  const MeshNeighborhoods around(mesh());
  Length &radius = result.radius, &sigma = result.closeness_sigma;
  if (!sigma.is_automatic()) sigma = in_file_units(sigma, order, stop);
  if (!radius.is_automatic()) {
    radius = in_file_units(radius, order, stop);
  } else {
    radius = sigma.is_automatic() ? around.two_ring_radius() : 2 * sigma.value;
  }
  if (!(radius.value > 0)) radius = 1;  // no vertex has neighbours
  if (sigma.is_automatic()) sigma = radius.value / 2;
  if (result.similarity_sigma.is_automatic())
    result.similarity_sigma = std::max(around.height_deviation(radius.value), kLeastDeviation * radius.value);
  if (result.normal_sigma.is_automatic()) result.normal_sigma = sigma;  // not read
  return result;
}

// The boundary that kept its place was counted by vertices; this adds the other points at their places, as of STL
// files. Where a vertex of it had another reason, such as no normal, nobody knows which, and they are left out.
void Pipeline::State::count_seams_on_boundary(UnmovedCounts& unmoved) {
  const MeshTopology& topology = mesh().topology;
  if (unmoved.boundary == 0 || unmoved.boundary != topology.found.boundary_vertices) return;
  for (const Copy& copy : cloud.copies_aside()) unmoved.boundary += topology.edges.is_on_boundary(copy.point);
}

// The standard deviation of the noise, given or measured.
double Pipeline::State::sigma_of(const Params& used) {
  if (!used.noise.is_automatic()) return used.noise.value;
  measure({false, true}, last_order_, {});
  return noise().sigma;
}

platform::LargeVector<double> Pipeline::State::noise_of_vertices(const Params& used) {
  const double sigma = sigma_of(used);
  const NoiseLevels* const its_levels = levels().get();
  const platform::LargeVector<Point>& places = mesh().places;
  platform::LargeVector<double> noise(places.size());
  for_vertices(places.size(), cloud.backend().sampling().on_host(),
               [&](std::uint32_t v) { noise[v] = sigma * double(noise_level_at(its_levels, places[v])); });
  return noise;
}

// What a run does to its result by the faces: vertices that it moved even out along the surface, and steps that fold
// faces are shortened. Points that kept their place, as outliers and the boundary do, stay.
MeshReport Pipeline::State::finish_mesh(const Params& used, std::span<Point> out) {
  const LoadedMesh& its = mesh();
  const MeshEdges& edges = its.topology.edges;
  const ForEach for_each = cloud.backend().sampling().on_host();
  const auto start = Clock::now();
  platform::LargeVector<Point> places(edges.vertices()), found_by_stages(edges.vertices());
  for_mesh_items(places.size(), for_each, [&](std::size_t v) { places[v] = found_by_stages[v] = out[edges.first[v]]; });
  std::optional<Folds> folds;
  if (const double share = used.tangential.value_or(0); share > 0) {
    platform::LargeVector<std::uint8_t> stays(places.size());
    for_mesh_items(places.size(), for_each, [&](std::size_t v) {
      const Point &now = places[v], &before = its.places[v];
      stays[v] = edges.is_boundary[v] != 0 || (now.x == before.x && now.y == before.y && now.z == before.z);
    });
    const platform::LargeVector<double> by_steps =
        noise_by_steps(its.faces, stays, sigma_of(used), its.places, places, for_each);
    even_out(its.faces, stays, share, by_steps, places, for_each);
    if (used.method == Method::bilateral) {
      follow_filtered_normals(its.faces, its.topology, stays, by_steps, places, for_each);
      give_back_shape(its.faces, stays, noise_of_vertices(used), its.places, places, for_each);
    }
    folds.emplace(its.faces, its.topology, places, for_each);
    untangle(*folds, stays, by_steps, places);
  }
  if (!folds) folds.emplace(its.faces, its.topology, places, for_each);
  unfold(*folds, its.folded, its.places, places);
  for_mesh_items(out.size(), for_each, [&](std::size_t i) {
    const std::uint32_t v = edges.vertex[i];
    if (v != kNoVertex && std::memcmp(&places[v], &found_by_stages[v], sizeof(Point)) != 0) out[i] = places[v];
  });
  log_.note("faces", milliseconds_since(start));
  MeshReport found = its.topology.found;
  const auto count = [&](std::span<const std::uint8_t> folded) {
    return count_items(folded.size(), for_each, [&](std::size_t f) { return folded[f] != 0; });
  };
  found.folded_before = count(its.folded);
  found.folded_after = count(folds->folded());
  return found;
}

}  // namespace pointfair
