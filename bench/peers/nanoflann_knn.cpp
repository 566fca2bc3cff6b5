// SPDX-License-Identifier: Apache-2.0
// Peer: the neighbours alone, by nanoflann.
#include "nanoflann_neighbors.hpp"

namespace {

peer::Outcome run(const std::vector<peer::Point>& points, const peer::Arguments& arguments) {
  peer::Stopwatch watch;
  const peer::PointArray array{points};
  const peer::Tree tree(3, array);
  const double index_seconds = watch.lap();
  const peer::NeighborLists lists = peer::find_neighbors(tree, points, arguments.k, arguments.threads);
  return {{}, {{"index", index_seconds}, {"neighbors", watch.lap()}}};
}

peer::Run prepare(const std::vector<peer::Point>& points, const peer::Arguments& arguments) {
  return [&points, arguments] { return run(points, arguments); };
}

}  // namespace

int main(int argc, char** argv) {
  return peer::peer_main(argc, argv, "nanoflann_knn", peer::nanoflann_version(), prepare);
}
