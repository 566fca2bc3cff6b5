// SPDX-License-Identifier: Apache-2.0
// What is measured on a cloud before a run: its spacing, its noise, and where most of it lies.
#pragma once

#include <cstddef>
#include <memory>
#include <stop_token>

#include "estimate/copies_at_samples.hpp"
#include "estimate/sensor.hpp"
#include "seam/sampling.hpp"
#include "seam/settings.hpp"

namespace pointfair {

struct Spacing {
  double mean = 0;  // mean distance to the 6 nearest other points (as CGAL's compute_average_spacing), strays aside
  double rho = 0;   // 95 % quantile of the distance to the 6th: a sampling gap that is no feature
};

// Points of a cloud that estimates and its frame are made of.
inline constexpr std::size_t kSampledPoints = 2000;

// Its cube holds what lies between the 2 % and the 98 % quantiles of the sample on each axis, and a fifth of its side
// around that.
Frame frame_of(const CloudSample& sample);

// Standard deviation of the noise along the normal. Residuals of cubic fits over neighbourhoods that are grown until
// they are wide against the noise (Eq. 8 of docs/how-it-works.md); a low quantile over the samples, since edges and
// outliers only ever raise a residual.
struct Noise {
  double sigma = 0;
  // The surface spacing: the side of the square that holds one point, from the density of those wide neighbourhoods
  // (median). Noise does not enlarge it, as it does the distance to the nearest points.
  double surface_spacing = 0;
  // Of the variances in neighbourhoods of 30 points at a typical place; 0 where noise is large.
  double shape_to_noise = 0;
  // Between two sheets of a thin part that neighbourhoods of a few dozen points reach across; 0 where there are none.
  double gap = 0;
  double sheets = 0;  // the share of the samples that see both, if there is a gap
  // Depths take few values, as those of a camera that measures whole disparities.
  bool depth_has_steps = false;
  // Share of the samples around which no neighbourhood gets wide against the noise, however large: the shape is too
  // thin or bends too much there.
  double confined = 0;
  // The number of nearest points that lie in a plane and not along a line, at most samples; 0 where it is not known.
  int surface_points = 0;
  // The number of neighbouring points that make one measurement, being copies or sharing one error. Lengths here are
  // those of a cloud with one point for each measurement.
  int repeats = 1;
  // Neighbouring points share their noise, as those of depth cameras do, or several make one measurement that lie at
  // different places.
  bool is_shared = false;
  // Share of the samples around which no surface shows, in a cloud that has one somewhere; 1 where it has none.
  double without_surface = 0;
  // At most samples more points than a neighbourhood holds lie along a line.
  bool is_of_lines = false;
  // The coarsest step of coordinates that were rounded so that points lie over each other; 0: none shows.
  double coordinate_step = 0;
};

// The estimate with a known `sigma` in place of the measured one; what depends on sigma follows, the rest stays.
Noise of_sigma(Noise noise, double sigma);

// How many points of the cloud's sample, from the first on, the noise is estimated at, if `repeats` points make one
// measurement.
std::size_t noise_queries(const CloudSample& sample, int repeats = 1);

struct WantedEstimates {
  bool spacing = false, noise = false;
  int nearest = 0;            // points, of each, that the stages will probably begin with; 0: unknown
  bool seeks_copies = false;  // with the noise; the estimate ends where it finds some
};
struct Estimate {
  Spacing spacing;
  Noise noise;
  std::shared_ptr<const NoiseLevels> levels{};       // of the noise; null: 1 everywhere
  std::shared_ptr<const NodeLevels> reach_levels{};  // of NeighborSettings; null: 1 everywhere
  KnownSensor sensor{};                              // found with the noise
  CopiesFound copies{};                              // if there are any, all else is to be measured without them
};
// The estimates that are wanted, made at points of the cloud's sample; the others are zero. Needs the index of the
// first iteration. Throws Error(interrupted) once `stop` is triggered.
Estimate estimate(Sampling& from, const CloudSample& sample, WantedEstimates wanted, const std::stop_token& stop);

// Whether copies share the error of the point that they repeat: they lie nearer to it than the noise is large, as it
// was measured without them. Else they are measurements of their own, as those of a scan that was repeated.
bool share_an_error(const CopiesFound& copies, const Noise& noise);

}  // namespace pointfair
