// SPDX-License-Identifier: Apache-2.0
#include "shading.hpp"

namespace pointfair::viewer {
namespace {

constexpr int kNeighbors = 12;

}  // namespace

void Shading::compute(std::span<const Point> points, std::span<Point> normals, std::stop_token stop) {
  if (!pipeline_) pipeline_.emplace(make_pipeline_());
  pipeline_->load(points);
  pipeline_->run({.k = kNeighbors, .iterations = 1}, normals, stop);  // where points go is not asked for
  pipeline_->normals(normals);
}

}  // namespace pointfair::viewer
