// SPDX-License-Identifier: Apache-2.0
// No method but what the best move along the normals would leave: puts each point at the closest place of the true
// mesh, by CGAL's tree of boxes. The CGAL headers used are GPL: this program is built for comparison only, is never
// installed, and shares no code with pointfair.
#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Polygon_mesh_processing/IO/polygon_mesh_io.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>

#include <exception>
#include <iostream>
#include <stdexcept>

#include "peer.hpp"

namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_face_graph_triangle_primitive<Mesh>>>;

std::vector<peer::Point> feet(const std::vector<peer::Point>& points, const std::string& mesh_path) {
  Mesh mesh;
  if (!CGAL::Polygon_mesh_processing::IO::read_polygon_mesh(mesh_path, mesh) || mesh.is_empty()) {
    throw std::runtime_error(mesh_path + ": no mesh of triangles");
  }
  Tree tree(faces(mesh).begin(), faces(mesh).end(), mesh);
  tree.accelerate_distance_queries();
  std::vector<peer::Point> result;
  result.reserve(points.size());
  for (const peer::Point& p : points) {
    const Kernel::Point_3 foot = tree.closest_point({p.x, p.y, p.z});
    result.push_back({static_cast<float>(foot.x()), static_cast<float>(foot.y()), static_cast<float>(foot.z())});
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 4) throw std::runtime_error("use NOISY.ply MESH OUT.ply");
  peer::write_ply(argv[3], feet(peer::read_ply(argv[1]), argv[2]));
  return 0;
} catch (const std::exception& error) {
  std::cerr << "on_mesh: " << error.what() << '\n';
  return 1;
}
