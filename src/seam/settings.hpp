// SPDX-License-Identifier: Apache-2.0
// What each stage reads: parameters with every `auto` resolved and every length in file units.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/params.hpp"
#include "seam/mesh_edges.hpp"

namespace pointfair {

// A length from place to place, divided by that of a typical place; fixed by a cloud as it was loaded. The nodes of a
// point::NodeField.
struct NodeLevels {
  std::vector<float> levels;
  int nodes = 0;  // along each axis
  Point first{};
  float nodes_per_unit = 0;
};
// Of the noise.
struct NoiseLevels : NodeLevels {
  std::array<double, 3> quantiles{1, 1, 1};  // of the samples' levels: 5, 50, 95 %
};

struct NeighborSettings {
  int k = 0;         // 0: no list; everything within `radius` is summed directly
  float radius = 0;  // 0: no limit
  bool constraint = false;
  float reach = 0;  // rho + delta
  // Without a list: a squared radius grows by the squared distance to the so many nearest point; 0: not at all.
  int min_neighbors = 0;
  // The levels of the noise, which this and later stages may follow where there is no list; null: 1 everywhere.
  std::shared_ptr<const NoiseLevels> levels{};
  bool radius_follows = false;
  // Factors on the distance to the min_neighbors-th nearest point; null: 1 everywhere.
  std::shared_ptr<const NodeLevels> reach_levels{};
  float widest = std::numeric_limits<float>::infinity();  // reach_levels and flat places enlarge no radius beyond it
  // Neighbours are those that edges reach; null: all. With k they are up to `rings` edges away, or with 0 what edges
  // reach within `radius`, k of them at most; else the edges stay within `mesh_growth` radii.
  std::shared_ptr<const MeshEdges> mesh{};
  int rings = 0;
  float mesh_growth = 1;
  friend bool operator==(const NeighborSettings&, const NeighborSettings&) = default;
};

struct NormalSettings {
  float sigma = 0;
  bool of_radius = false;  // sigma is a multiple of the point's radius; only without a list
  int filter_rounds = 0;
  int crease_angle = 0;  // degrees; 0: a plain Gaussian mean
  float flat_scale = 1;  // multiplies the radius of the bilateral step where the surface is flat
  // Normals are means of those of the faces at a vertex, weighted by area, and sigma is not read; null: they are those
  // of planes through neighbours. Needs NeighborSettings::mesh.
  std::shared_ptr<const MeshFaces> faces{};
  friend bool operator==(const NormalSettings&, const NormalSettings&) = default;
};

// Where the sensor stood, relative to the cloud's origin: one place for all points, or one for each in upload order. A
// place that is not finite is unknown.
struct SensorPlaces {
  std::vector<Point> places;
};

struct FairingSettings {
  Method method = Method::bilateral;  // method_rule (seam/rules.hpp) has the others
  AreaWeight area_weight = AreaWeight::none;
  float closeness_sigma = 0;
  float similarity_sigma = 0;
  bool similarity_follows = false;                                // the level of the noise at the point
  bool closeness_of_radius = false;                               // as in NormalSettings
  bool symmetric = false;                                         // Eq. 10 instead of the paper's step
  int turn_angle = 0;                                             // degrees, of Eq. 10; 0: normals do not weigh
  float strength = 1;                                             // share of the displacement that is made
  ImplicitWeights implicit_weights = ImplicitWeights::automatic;  // of Method::implicit
  double implicit_lambda = 0;
  float noise = 0;                   // at level 1; Wiener's share of the step (Eq. 22) follows from it; 0: a whole step
  float damage = 0;                  // c of Eq. 22
  bool is_further = false;           // the points come from an iteration before
  float outlier_distance = 0;        // of an outlier to its neighbours (src/point/outliers.h); 0: none are looked for
  float level_outlier_distance = 0;  // times the level of the noise; the larger distance of both counts
  float outlier_radius = std::numeric_limits<float>::infinity();  // of larger neighbourhoods more must agree
  bool pull_outliers = false;  // outliers move to the mean of their neighbours; else they become NaN
  std::shared_ptr<const MeshEdges> kept_boundary{};  // whose boundary keeps its place; null: none does
  std::shared_ptr<const MeshFaces> faces{};          // of Method::implicit and jones along a mesh
  std::shared_ptr<const SensorPlaces> sensors{};     // null: what follows is off
  float beam_width = 0;           // of the pattern of rays, in radians (point/sensor.h); 0: not looked at
  bool along_ray = false;         // points move along their rays (point/sensor.h)
  float farthest = 0;             // along_ray: soft limit of one displacement along the normal; 0: none
  bool farthest_follows = false;  // as in DisplacementLimits
  friend bool operator==(const FairingSettings&, const FairingSettings&) = default;
};

// Limits of the whole way of a point since upload.
struct DisplacementLimits {
  float farthest = 0;          // a soft limit (point::settled); 0: no limits at all
  float outlier_distance = 0;  // a point that would move farther than this, or became NaN, keeps its place
  // Of the noise where the point was uploaded; null: 1 everywhere.
  std::shared_ptr<const NoiseLevels> levels{};
  bool farthest_follows = false;
  float level_outlier_distance = 0;  // as in FairingSettings
  friend bool operator==(const DisplacementLimits&, const DisplacementLimits&) = default;
};

// What is fixed by a cloud as it was loaded, for all its iterations and tiles. It depends on the set of points alone,
// and moves with them: every number is a coordinate of some point, or a difference of such.
struct Frame {
  Point corner{};     // the least coordinates of valid points; positions are hashed relative to it
  Point reference{};  // a coordinate of some point on each axis, near the lower end of most of the cloud
  float side = 0;     // of the cube that holds most of the cloud; a power of two, 0 for a cloud without extent
  friend bool operator==(const Frame& a, const Frame& b) {
    const auto same = [](const Point& p, const Point& q) { return p.x == q.x && p.y == q.y && p.z == q.z; };
    return same(a.corner, b.corner) && same(a.reference, b.reference) && a.side == b.side;
  }
};

}  // namespace pointfair
