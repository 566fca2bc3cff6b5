// SPDX-License-Identifier: Apache-2.0
// How far a cloud lies from a mesh or another cloud.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "mesh_distances.hpp"
#include "pointfair/cloud.hpp"
#include "statistics.hpp"

namespace pointfair::cli {

struct CompareOptions {
  bool as_cloud = false;                ///< take a mesh by its vertices
  std::optional<double> edge_degrees;   ///< measure near edges whose faces turn by more
  std::optional<int> normal_neighbors;  ///< measure the normals of planes through so many nearest points
  unsigned threads = 0;                 ///< of the normals; 0: all cores
  std::array<std::string, 2> names;     ///< of the files, for errors
};

/// Lengths in file units.
struct Distances {
  std::uint64_t points = 0;  ///< finite points of A
  bool mesh = false;         ///< B was taken as a mesh
  double diagonal = 0;       ///< of B's bounding box
  Statistics distance;       ///< of A's points to B
  double chamfer = 0;        ///< squared, both ways, where B's bounding sphere has radius 1
  std::optional<double> edge_rms;
  std::uint64_t edge_points = 0;        ///< points that edge_rms is about
  std::optional<double> normal_error;   ///< mean angle to the nearest face's normal, signs left out, degrees
  std::optional<FaceComparison> faces;  ///< where both are meshes, and B was taken as one
};

/// Throws ErrorKind::file where there is nothing to measure, ErrorKind::usage for edges or normals of a cloud.
Distances compare_clouds(const Cloud& a, const Cloud& b, const CompareOptions& options);

}  // namespace pointfair::cli
