// SPDX-License-Identifier: Apache-2.0
// What a run delivers after any walk: the results of fresh pipelines.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "meddling_backend.h"
#include "pointfair/pipeline.hpp"
#include "pointfair/positions.hpp"
#include "shapes.h"

namespace pointfair {

using shapes::Points, shapes::same_bits;

// What a run delivers, or why it does not.
struct Outcome {
  std::string error;  // empty: none
  Points points, normals;
  std::vector<std::uint8_t> outliers;
  UnmovedCounts unmoved;
  std::uint64_t short_neighborhoods = 0;
  Params used;
};

inline Outcome of_last_run(Pipeline& pipeline, Points points) {
  const Report& report = pipeline.report();
  Outcome outcome{{}, std::move(points), {}, {}, report.unmoved, report.short_neighborhoods, report.params};
  outcome.outliers.assign(pipeline.outliers().begin(), pipeline.outliers().end());
  return outcome;
}

// Normals turn when another place of the sensor is given after the run.
inline bool same_up_to_sign(const Points& a, const Points& b) {
  const auto same = [](const Point& p, const Point& q) {
    return (p.x == q.x && p.y == q.y && p.z == q.z) || (p.x == -q.x && p.y == -q.y && p.z == -q.z);
  };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), same);
}

// What a caller says of where the sensor stood.
enum class Told { nothing, one_place, a_place_each };

inline std::vector<Position> viewpoints(Told told, std::size_t points) {
  if (told == Told::nothing) return {};
  if (told == Told::one_place) return {{0.4, 0.6, 3}};
  std::vector<Position> each;
  for (std::size_t i = 0; i < points; ++i)
    each.push_back(i % 10 == 3 ? Position{std::nan(""), 0, 0} : Position{0.4, 0.6 - double(i) / double(points), 2.5});
  return each;
}

using MakePipeline = std::function<Pipeline(Meddling&)>;

// Clouds and their results by fresh pipelines.
class Oracle {
 public:
  explicit Oracle(MakePipeline make) : make_(std::move(make)) {
    clouds_ = {shapes::with_noise(shapes::waves(420), 0.01), shapes::with_invalid(shapes::cube(350), 9),
               shapes::with_stray(shapes::with_noise(shapes::sphere(300), 0.02), 60), shapes::identical(30), Points{}};
    for (int i = 0; i < 60; ++i) clouds_[0][std::size_t(5 * i)] = clouds_[0][1];
  }
  const std::vector<Points>& clouds() const { return clouds_; }

  const Outcome& run(std::size_t cloud, Told told, const Params& params) {
    std::string key = std::to_string(cloud) + ' ' + std::to_string(int(told));
    for (const ParamInfo& info : kParams) key += ' ' + param_text(params, info);
    const auto [place, is_new] = runs_.try_emplace(key);
    if (is_new) place->second = fresh_run(cloud, told, params);
    return place->second;
  }
  const Estimates& estimates(std::size_t cloud) {
    const auto [place, is_new] = estimates_.try_emplace(cloud);
    if (is_new) {
      Pipeline pipeline = make_(quiet_);
      pipeline.load(clouds_[cloud]);
      place->second = pipeline.estimates();
    }
    return place->second;
  }

 private:
  Outcome fresh_run(std::size_t cloud, Told told, const Params& params) {
    Pipeline pipeline = make_(quiet_);
    pipeline.load(clouds_[cloud]);
    pipeline.set_viewpoint(viewpoints(told, clouds_[cloud].size()));
    Points out(clouds_[cloud].size());
    try {
      pipeline.run(params, out);
    } catch (const Error& error) {
      Outcome refused;
      refused.error = error.what();
      return refused;
    }
    Outcome outcome = of_last_run(pipeline, std::move(out));
    outcome.normals.resize(outcome.points.size());
    pipeline.normals(outcome.normals);
    return outcome;
  }

  MakePipeline make_;
  Meddling quiet_;
  std::vector<Points> clouds_;
  std::map<std::string, Outcome> runs_;
  std::map<std::size_t, Estimates> estimates_;
};

}  // namespace pointfair
