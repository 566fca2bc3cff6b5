// SPDX-License-Identifier: Apache-2.0
// What the bodies of the stages read of a run's parameters, as kernels take it: no value is automatic, and lengths are
// in file units. src/seam/settings.hpp adds what the host alone reads.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

struct NormalSettings {
  float sigma = 0;
  bool of_radius = false;  // sigma is a multiple of the point's radius; only without a list
  int crease_angle = 0;    // degrees; 0: the filter is a plain Gaussian mean
  float flat_scale = 1;    // multiplies the radius of the bilateral step where the surface is flat
  friend bool operator==(const NormalSettings&, const NormalSettings&) = default;
};

struct FairingSettings {
  float closeness_sigma = 0;
  float similarity_sigma = 0;
  bool similarity_follows = false;          // the level of the noise at the point
  bool closeness_of_radius = false;         // as in NormalSettings
  bool symmetric = false;                   // Eq. 10 of docs/how-it-works.md instead of the paper's step
  int turn_angle = 0;                       // degrees, of Eq. 10; 0: normals do not weigh
  float strength = 1;                       // share of the displacement that is made
  float noise = 0;                          // at level 1, for Wiener's share of the step (Eq. 22); 0: a whole step
  float damage = 0;                         // c of Eq. 22
  float trusted = 0;                        // noise of which half a share is believed: less looks like shape
  bool is_further = false;                  // the points come from an iteration before
  float outlier_distance = 0;               // of an outlier to its neighbours (outliers.h); 0: none are looked for
  float level_outlier_distance = 0;         // times the level of the noise; the larger distance of both counts
  float outlier_radius = __builtin_inff();  // of larger neighbourhoods more must agree
  bool pull_outliers = false;               // outliers move to the mean of their neighbours; else they become NaN
  float beam_width = 0;                     // of the pattern of rays, in radians (sensor.h); 0: not looked at
  bool along_ray = false;                   // points move along their rays (sensor.h)
  float farthest = 0;                       // along_ray: soft limit of one displacement along the normal; 0: none
  bool farthest_follows = false;            // the level of the noise
  friend bool operator==(const FairingSettings&, const FairingSettings&) = default;

  // What the bilateral step does at all. Squares, since one that vanishes does nothing.
  POINTFAIR_INLINE bool seeks_outliers() const { return outlier_distance * outlier_distance > 0; }
  POINTFAIR_INLINE bool shares() const { return noise * noise > 0; }
  // Points that have moved lie no longer on their rays.
  POINTFAIR_INLINE bool seeks_mixed_pixels() const { return !is_further && beam_width * beam_width > 0; }
  POINTFAIR_INLINE bool reads_sensor() const { return along_ray || seeks_mixed_pixels(); }
};

// Limits of the whole way of a point since upload (outliers.h).
struct DisplacementLimits {
  float farthest = 0;                // a soft limit; 0: no limits at all
  float outlier_distance = 0;        // a point that would move farther than this, or became NaN, keeps its place
  float level_outlier_distance = 0;  // as in FairingSettings
  bool farthest_follows = false;     // the level of the noise
  friend bool operator==(const DisplacementLimits&, const DisplacementLimits&) = default;
};

}  // namespace pointfair::point
