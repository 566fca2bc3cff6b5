// SPDX-License-Identifier: Apache-2.0
// What each stage reads: parameters with every `auto` resolved and every length in file units.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "point/settings.h"
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

struct NormalSettings : point::NormalSettings {
  int filter_rounds = 0;
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

struct FairingSettings : point::FairingSettings {
  Method method = Method::bilateral;  // method_rule (seam/rules.hpp) has the others
  AreaWeight area_weight = AreaWeight::none;
  ImplicitWeights implicit_weights = ImplicitWeights::automatic;  // of Method::implicit
  double implicit_lambda = 0;
  std::shared_ptr<const MeshEdges> kept_boundary{};  // whose boundary keeps its place; null: none does
  std::shared_ptr<const MeshFaces> faces{};          // of Method::implicit and jones along a mesh
  std::shared_ptr<const SensorPlaces> sensors{};     // null: reads_sensor() is false
  friend bool operator==(const FairingSettings&, const FairingSettings&) = default;
};

struct DisplacementLimits : point::DisplacementLimits {
  // Of the noise where the point was uploaded; null: 1 everywhere.
  std::shared_ptr<const NoiseLevels> levels{};
  friend bool operator==(const DisplacementLimits&, const DisplacementLimits&) = default;

  // Where there are none, those by which outliers keep their places and all else goes as far as it does.
  DisplacementLimits or_endless() const {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    return farthest > 0 ? *this : DisplacementLimits{{kInfinity, kInfinity}};
  }
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

// Points within this distance of each other are copies of the one that comes first by a hash of its offset from the
// corner of the cloud, which prefers no direction (seam/copies.hpp). 0: those at one place are; negative: none are.
struct CopyRule {
  double within = -1;
  Point corner{};  // as of Frame
  bool any() const { return within >= 0; }
};

// What the stages of an iteration read.
struct Settings {
  NeighborSettings neighbors;
  NormalSettings normals;
  FairingSettings fairing;
  DisplacementLimits limits;  // of the download: no stage reads them
  friend bool operator==(const Settings&, const Settings&) = default;
};

// The same with what the index reads.
struct FramedSettings : Settings {
  std::optional<Frame> frame;  // null: the index is in the fastest order
  CopyRule copies{};           // of points that are set aside, where tiles find them
};

}  // namespace pointfair
