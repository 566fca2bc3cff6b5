// SPDX-License-Identifier: Apache-2.0
// Peer: CGAL's jet_smooth_point_set, with its default degrees. The CGAL headers used are GPL: this program is built for
// comparison only, is never installed, and shares no code with pointfair.
#include <CGAL/Simple_cartesian.h>
#include <CGAL/jet_smooth_point_set.h>
#include <CGAL/tags.h>
#include <CGAL/version.h>
#include <tbb/global_control.h>

#include <memory>

#include "peer.hpp"

namespace {

using Kernel = CGAL::Simple_cartesian<double>;

peer::Outcome run(const std::vector<peer::Point>& points, unsigned k) {
  std::vector<Kernel::Point_3> cloud;
  cloud.reserve(points.size());
  for (const peer::Point& p : points) cloud.emplace_back(p.x, p.y, p.z);
  CGAL::jet_smooth_point_set<CGAL::Parallel_tag>(cloud, k);
  peer::Outcome outcome;
  outcome.points.reserve(cloud.size());
  for (const Kernel::Point_3& p : cloud) {
    outcome.points.push_back({static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())});
  }
  return outcome;
}

peer::Run prepare(const std::vector<peer::Point>& points, const peer::Arguments& arguments) {
  const auto limit =
      std::make_shared<tbb::global_control>(tbb::global_control::max_allowed_parallelism, arguments.threads);
  return [&points, limit, k = static_cast<unsigned>(arguments.k)] { return run(points, k); };
}

}  // namespace

int main(int argc, char** argv) { return peer::peer_main(argc, argv, "cgal_jet", "CGAL " CGAL_VERSION_STR, prepare); }
