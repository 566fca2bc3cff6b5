// SPDX-License-Identifier: Apache-2.0
#include "expectation.hpp"

#include <algorithm>
#include <string_view>

namespace pointfair::viewer {
namespace {

constexpr std::string_view kNames[] = {"index", "neighbors", "normals", "fairing"};
constexpr double kFirstGuess = 2.5e-4;  // milliseconds a point and stage, of a slow machine

// How often a stage runs where the first iteration begins at `first`.
double times(Stage stage, Stage first, int iterations) {
  return std::max(0, iterations - 1) + (stage >= first ? 1 : 0);
}

double growth(double now, double then) { return now > 0 && then > 0 ? now / then : 1; }

}  // namespace

Stage first_difference(const Params& a, const Params& b) {
  Stage first = Stage::iterations;
  for (const ParamInfo& info : kParams)
    if (param_text(a, info) != param_text(b, info)) first = std::min(first, info.stage);
  return first;
}

void Expectation::reset(std::uint64_t points) {
  stage_.fill(kFirstGuess * static_cast<double>(points));
  has_run_ = false;
}

void Expectation::learn(const Report& report) {
  const Stage first = has_run_ ? first_difference(params_, report.params) : Stage::index;
  for (std::size_t s = 0; s < kStages; ++s) {
    const double count = times(Stage(s), first, report.params.iterations);
    for (const StageTime& stage : report.stages)
      if (stage.name == kNames[s] && count > 0) stage_[s] = stage.milliseconds / count;
  }
  params_ = report.params;
  has_run_ = true;
}

double Expectation::milliseconds(const Params& params) const {
  const Stage first = has_run_ ? first_difference(params_, params) : Stage::index;
  const double wider = growth(params.radius.value, params_.radius.value);
  const double more = has_run_ ? growth(params.k, params_.k) * wider * wider : 1;
  double sum = 0;
  for (std::size_t s = 0; s < kStages; ++s)
    sum += stage_[s] * times(Stage(s), first, params.iterations) * (Stage(s) > Stage::index ? more : 1);
  return sum;
}

}  // namespace pointfair::viewer
