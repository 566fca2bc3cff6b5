// SPDX-License-Identifier: Apache-2.0
// Peer: CGAL's bilateral_smooth_point_set. The CGAL headers used are GPL: this program is built for comparison only,
// is never installed, and shares no code with pointfair.
// The function wants oriented normals, which a scan does not bring: they are made while preparing, which is not
// counted, though at a million points it takes longer than the smoothing.
#include <CGAL/Simple_cartesian.h>
#include <CGAL/bilateral_smooth_point_set.h>
#include <CGAL/mst_orient_normals.h>
#include <CGAL/pca_estimate_normals.h>
#include <CGAL/property_map.h>
#include <CGAL/tags.h>
#include <CGAL/version.h>
#include <tbb/global_control.h>

#include <memory>

#include "peer.hpp"

namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Oriented = std::pair<Kernel::Point_3, Kernel::Vector_3>;
using OrientedPoints = std::vector<Oriented>;

auto maps() {
  return CGAL::parameters::point_map(CGAL::First_of_pair_property_map<Oriented>())
      .normal_map(CGAL::Second_of_pair_property_map<Oriented>());
}

OrientedPoints with_normals(const std::vector<peer::Point>& points, unsigned k) {
  OrientedPoints oriented;
  oriented.reserve(points.size());
  for (const peer::Point& p : points) oriented.emplace_back(Kernel::Point_3(p.x, p.y, p.z), Kernel::Vector_3());
  CGAL::pca_estimate_normals<CGAL::Parallel_tag>(oriented, k, maps());
  CGAL::mst_orient_normals(oriented, k, maps());  // reorders: those without a sign come last
  return oriented;
}

peer::Outcome run(OrientedPoints oriented, unsigned k) {
  CGAL::bilateral_smooth_point_set<CGAL::Parallel_tag>(oriented, k, maps());
  peer::Outcome outcome;
  outcome.points.reserve(oriented.size());
  for (const auto& [p, normal] : oriented) {
    outcome.points.push_back({static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())});
  }
  return outcome;
}

peer::Run prepare(const std::vector<peer::Point>& points, const peer::Arguments& arguments) {
  const auto limit =
      std::make_shared<tbb::global_control>(tbb::global_control::max_allowed_parallelism, arguments.threads);
  const unsigned k = static_cast<unsigned>(arguments.k);
  return [limit, k, oriented = with_normals(points, k)] { return run(oriented, k); };
}

}  // namespace

int main(int argc, char** argv) {
  return peer::peer_main(argc, argv, "cgal_bilateral", "CGAL " CGAL_VERSION_STR, prepare);
}
