// SPDX-License-Identifier: Apache-2.0
// What each stage reads: parameters with every `auto` resolved and every length in file units.
#pragma once

#include <cstdint>
#include <limits>

#include "pointfair/cloud.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

struct NeighborSettings {
  int k = 0;         // 0: no list; everything within `radius` is summed directly
  float radius = 0;  // 0: no limit
  bool constraint = false;
  float reach = 0;  // rho + delta
  int min_neighbors =
      0;  // without a list: squared radii grow by the squared distance to this many nearest; 0: not at all
  friend bool operator==(const NeighborSettings&, const NeighborSettings&) = default;
};

struct NormalSettings {
  float sigma = 0;
  bool of_radius = false;  // sigma is a multiple of the point's radius; only without a list
  int filter_rounds = 0;
  int crease_angle = 0;  // degrees; 0: a plain Gaussian mean
  float flat_scale = 1;  // what multiplies the radius, for the bilateral step, where the surface is flat
  friend bool operator==(const NormalSettings&, const NormalSettings&) = default;
};

struct FairingSettings {
  Method method = Method::bilateral;  // the others are put together in method_rule.hpp
  AreaWeight area_weight = AreaWeight::none;
  float closeness_sigma = 0;
  float similarity_sigma = 0;
  bool closeness_of_radius = false;  // as in NormalSettings
  bool symmetric = false;            // Eq. 10 instead of the paper's step
  int turn_angle = 0;                // degrees, of Eq. 10; 0: normals do not weigh
  float strength = 1;                // share of the displacement that is made
  float outlier_distance = 0;        // from its neighbours, to be an outlier (src/point/outliers.h); 0: not looked for
  float outlier_radius = std::numeric_limits<float>::infinity();  // in larger neighbourhoods outliers may be alone
  bool pull_outliers = false;  // in to the mean of their neighbours; else they become NaN
  friend bool operator==(const FairingSettings&, const FairingSettings&) = default;
};

// Of the whole way from upload; none if `farthest` is 0.
struct DisplacementLimits {
  float farthest = 0;          // a point moves no farther,
  float outlier_distance = 0;  // and one that would move farther than this, or became NaN, keeps its place
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
