// SPDX-License-Identifier: Apache-2.0
// What estimates ask of a backend: a sample of the uploaded cloud, and what the neighbourhoods of its points show.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "point/sample.h"
#include "pointfair/cloud.hpp"

namespace pointfair {

struct Bounds {
  Point min{}, max{};       // of the valid points; zero if there is none
  std::uint64_t valid = 0;  // points that are indexed: finite, and small enough to be squared
};

// Points of a cloud, no two at one place, chosen and ordered by a hash of where they are: a function of the set of the
// cloud's points alone, which moves with them (src/point/position.h).
struct CloudSample {
  Bounds bounds;  // of the whole cloud
  std::vector<Point> points;
  std::vector<std::uint32_t> indices;  // of each of them in upload order; of points at one place, any
};

// Rows of queries and their nearest points, as Sampling::sample_neighborhoods() has them.
struct NearRows {
  std::vector<Point> points;
  int neighbors = 0;  // of each query
};

// What samples of a cloud show, each list in the order of its queries.
struct Samples {
  std::vector<point::SpacingSample> spacing;
  std::vector<point::NoiseSample> noise;
  // Of the queries for noise, which not every estimate needs: made when first asked for. To be called while the backend
  // lives, by one thread at a time.
  std::function<std::vector<point::ResidualSample>()> residuals;
  // Of the queries for noise that show it: rows of the point::kPool nearest of them, by their numbers, the query's own
  // among them, nearest first, and equally far ones in their order. Empty: the estimate looks for them.
  std::vector<std::uint32_t> pools{};
  NearRows near{};  // of the first point::kNearRows queries for noise; thinned samples have none
};

// Calls the function for each number below the given one, many at once.
using ForEach = std::function<void(std::size_t, const std::function<void(std::size_t)>&)>;

// How neighbourhoods of samples are looked at.
struct SampleRule {
  int stride = 1;       // every so many-th nearest point, which leaves copies of a point aside
  bool sheets = false;  // two groups of heights are taken for two sheets more readily: the cloud has thin parts
};

class Sampling {
 public:
  virtual ~Sampling() = default;

  // A sample of `count` points of the uploaded cloud, of all places where there are fewer. Needs no index.
  virtual CloudSample sample_cloud(std::size_t count) = 0;

  // The other calls need the index of the first iteration.

  // For each of `queries` (indices in upload order): the query itself, then its k nearest other points, nearest first,
  // row after row of k + 1; rows of invalid queries, and places past the last point, are NaN. k up to kLongestRow.
  virtual void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) = 0;
  // What such rows show (point/sample.h), at queries for the spacing and at queries for the noise. This body fits on
  // the host's cores; a device that fits by itself gives the same bits. Throws Error(interrupted) once `stop` is
  // triggered.
  virtual Samples take_samples(std::span<const std::uint32_t> for_spacing, std::span<const std::uint32_t> for_noise,
                               std::stop_token stop);
  // The same by any rule, for the noise alone. Rows end with the kLongestRow-th nearest.
  virtual Samples take_samples_by(SampleRule rule, std::span<const std::uint32_t> for_noise, std::stop_token stop);
  // For each of `queries`, whose noise is one of `sigmas`, the share of residuals beyond two standard deviations (.046
  // of Gaussian noise, none of noise that is even between two bounds), over a cubic through the nearest points up to 7
  // sigmas away, 115 to 600 of them; negative where they show no surface, or two sheets. By fits on the host's cores.
  std::vector<double> beyond_two(std::span<const std::uint32_t> queries, std::span<const double> sigmas,
                                 const std::stop_token& stop);
  static constexpr int kLongestRow = 1024;
  // Says that the stages will probably ask for so many nearest points of each; a device may find them meanwhile.
  virtual void foresee_nearest(int) {}
  // Calls body(i) for each i below count on the host's cores, as many at once as this backend may use.
  virtual void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body);
  ForEach on_host() {
    return [this](std::size_t count, const auto& body) { for_each_on_host(count, body); };
  }
};

}  // namespace pointfair
