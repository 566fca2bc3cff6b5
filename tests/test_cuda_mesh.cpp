// SPDX-License-Identifier: Apache-2.0
// Runs along meshes on a card against the CPU, bit for bit: meshes larger and stranger than those of test_mesh.cpp,
// whose runs are compared too (meshes.h).
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "meshes.h"
#include "slow_tools.h"

namespace pointfair {
namespace {

using meshes::along_mesh;
using meshes::Mesh;
using meshes::Sides;

class CudaMeshTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!test::why_no_card().empty()) GTEST_SKIP() << test::why_no_card();
  }
};

// Around and through, in about so many vertices.
Mesh torus(std::size_t vertices, double noise) {
  const auto n = std::uint32_t(std::sqrt(2.0 * double(slow_tools::most_points(vertices)))), m = n / 2;
  Mesh mesh;
  shapes::Random random(3);
  const double edge = 2 * std::numbers::pi / n;
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < m; ++j) {
      const double u = 2 * std::numbers::pi * i / n, v = 2 * std::numbers::pi * j / m, r = 1 + 0.4 * std::cos(v);
      Point p = shapes::make_point(r * std::cos(u), r * std::sin(u), 0.4 * std::sin(v));
      for (float* c : {&p.x, &p.y, &p.z}) *c += float(noise * edge * random.normal());
      mesh.points.push_back(p);
      const std::uint32_t right = (i + 1) % n, up = (j + 1) % m;
      mesh.faces.push_back({i * m + j, right * m + j, right * m + up});
      mesh.faces.push_back({i * m + j, right * m + up, i * m + up});
    }
  return mesh;
}

// What runs on the card, here compared with the CPU.
void expect_same(const Mesh& mesh, const Params& params, const std::string& what) {
  SCOPED_TRACE(what);
  meshes::run(mesh, params);
}

TEST_F(CudaMeshTest, equals_the_cpu_with_every_method_and_switch) {
  const Mesh mesh = torus(40000, 0.3);
  for (const Method method : {Method::bilateral, Method::laplacian, Method::taubin, Method::hc_laplacian, Method::mls,
                              Method::wiener, Method::mollified})
    for (const int rings : {kAutomatic, 1, 3}) {
      Params params = along_mesh(method);
      params.rings = rings;
      params.iterations = rings == 1 ? 3 : 2;
      expect_same(mesh, params, "method " + std::to_string(int(method)) + ", rings " + std::to_string(rings));
      params.area_weight = AreaWeight::squared;
      if (rings != 3) expect_same(mesh, params, "with area weights");
    }
  Params evened{.connectivity = Connectivity::mesh};
  expect_same(mesh, evened, "nothing set");
  evened.outliers = Outliers::move;
  expect_same(mesh, evened, "outliers move");
}

TEST_F(CudaMeshTest, equals_the_cpu_where_there_is_a_border_and_where_noise_is_large) {
  for (const double noise : {0.05, 0.6}) {
    Mesh mesh = meshes::sheet(slow_tools::most_points(40000) < 40000 ? 40 : 150, Sides::mixed);
    shapes::Random random(7);
    for (Point& p : mesh.points)
      for (float* c : {&p.x, &p.y, &p.z}) *c += float(noise / 150 * random.normal());
    mesh.points[300].x = std::nanf("");
    for (std::size_t i = 0; i < mesh.points.size(); i += 97) mesh.points[i].z += 0.2f;  // outliers, lost in iterations
    mesh.points.push_back({0.5f, 0.5f, 3});
    for (const bool keeps : {true, false}) {
      Params params{.connectivity = Connectivity::mesh, .keep_boundary = keeps, .iterations = 3};
      expect_same(mesh, params, "whole");
      expect_same(meshes::unwelded(mesh), params, "unwelded");
      params.rings = 2;
      expect_same(mesh, params, "rings");
    }
  }
}

// Neighbourhoods that are thinned, and those that are cut, of more vertices than a first table holds.
TEST_F(CudaMeshTest, equals_the_cpu_on_wide_balls) {
  const Mesh mesh = torus(20000, 0.1);
  for (const int least : {1, 6, 60}) {
    Params params = along_mesh();
    params.radius = 0.4;
    params.min_neighbors = least;
    params.iterations = 1;
    expect_same(mesh, params, "at least " + std::to_string(least));
  }
  Params rings = along_mesh();
  rings.rings = 8;
  expect_same(mesh, rings, "8 rings");
  rings.radius = 0.05;
  expect_same(mesh, rings, "8 rings within a radius");
}

TEST_F(CudaMeshTest, equals_the_cpu_around_a_hub) {
  Mesh fan;
  const std::uint32_t spokes = 3000;
  fan.points.push_back({0, 0, 0});
  for (std::uint32_t i = 0; i < spokes; ++i) {
    const double turn = 2 * std::numbers::pi * i / spokes;
    fan.points.push_back(shapes::make_point(std::cos(turn), std::sin(turn), 0.01 * std::sin(9 * turn)));
    fan.faces.push_back({0, i + 1, (i + 1) % spokes + 1});
  }
  const Mesh mesh = meshes::joined(fan, torus(4000, 0.2));
  for (const int rings : {kAutomatic, 1, 2}) {
    Params params = along_mesh();
    params.rings = rings;
    params.keep_boundary = false;
    params.noise = 0.01;
    if (rings == kAutomatic) params.radius = 1.5;
    expect_same(mesh, params, "rings " + std::to_string(rings));
  }
}

TEST_F(CudaMeshTest, a_stopped_run_can_be_repeated) {
  const Mesh mesh = torus(20000, 0.3);
  Params params{.connectivity = Connectivity::mesh, .iterations = 2};
  const meshes::Result expected = meshes::run(mesh, params);
  Pipeline pipeline = loaded(mesh.points, Device::cuda);
  pipeline.set_faces(meshes::polygons_of(mesh.faces));
  shapes::Points out(mesh.points.size());
  for (const int calls : {2, 3, 4, 7}) {
    std::stop_source stop;
    int made = 0;
    EXPECT_THROW(pipeline.run(params, out, stop.get_token(),
                              [&](double, std::string_view) {
                                if (++made == calls) stop.request_stop();
                              }),
                 Error);
    pipeline.run(params, out);
    EXPECT_TRUE(shapes::same_bits(out, expected.points)) << calls;
    pipeline.load(mesh.points);
    pipeline.set_faces(meshes::polygons_of(mesh.faces));
  }
}

TEST_F(CudaMeshTest, runs_with_and_without_the_mesh_take_turns) {
  Mesh mesh = meshes::sheet(40, Sides::triangles);
  shapes::Random random(11);
  for (Point& p : mesh.points) p.z += float(0.004 * random.normal());
  Pipeline cpu(Device::cpu), cuda(Device::cuda);
  for (Pipeline* pipeline : {&cpu, &cuda}) {
    pipeline->load(mesh.points);
    pipeline->set_faces(meshes::polygons_of(mesh.faces));
  }
  const Params along{.connectivity = Connectivity::mesh};
  const Params turns[] = {
      along, {.k = 8}, {.connectivity = Connectivity::mesh, .rings = 1}, {.method = Method::implicit}, along};
  for (const Params& params : turns) {
    shapes::Points expected(mesh.points.size()), out = expected;
    cpu.run(params, expected);
    cuda.run(params, out);
    EXPECT_TRUE(shapes::same_bits(out, expected));
    EXPECT_EQ(cuda.report().unmoved, cpu.report().unmoved);
    EXPECT_EQ(cuda.report().unmoved.boundary > 0, params.connectivity == Connectivity::mesh);
  }
}

TEST_F(CudaMeshTest, what_a_card_cannot_do_is_refused_in_one_line) {
  const Mesh mesh = torus(2000, 0.1);
  for (const Method method : {Method::fleishman, Method::jones, Method::implicit})
    expect_error(ErrorKind::usage, "--device cpu", [&] { meshes::run_on(Device::cuda, mesh, along_mesh(method)); });
}

}  // namespace
}  // namespace pointfair
