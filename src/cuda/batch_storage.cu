// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "cuda/batch_storage.cuh"
#include "seam/noise_levels.hpp"
#include "seam/rules.hpp"

namespace pointfair::cuda {
namespace {

Vec vec(const Point& p) { return {p.x, p.y, p.z}; }

std::size_t nodes_of(const NodeLevels* levels) { return levels == nullptr ? 0 : levels->levels.size(); }

// As a chain has them for one cloud (chain.cu). `nodes`: of the noise, then of the reach.
CloudSettings on_card(const FramedSettings& its, const float* nodes) {
  CloudSettings result{};
  result.cube = point::curve_cube(vec(its.frame->reference), its.frame->side);
  result.corner = vec(its.frame->corner);
  result.squared_base = squared_base(its.neighbors.radius);
  result.squared_widest = squared_widest(its.neighbors);
  result.min_neighbors = its.neighbors.min_neighbors;
  result.noise_levels = field_of(its.neighbors.levels.get());
  if (its.neighbors.levels) result.noise_levels.values = nodes;
  result.reach_levels = field_of(its.neighbors.reach_levels.get());
  if (its.neighbors.reach_levels) result.reach_levels.values = nodes + nodes_of(its.neighbors.levels.get());
  result.normals = its.normals;
  result.fairing = its.fairing;
  result.limits = its.limits.or_endless();
  return result;
}

CloudBatch batch_of(const std::vector<CloudSpan>& spans, std::size_t uploaded) {
  CloudBatch batch{nullptr, nullptr, static_cast<Index>(spans.size()), 0, 0, uploaded};
  for (const CloudSpan& span : spans) {
    batch.largest = std::max<std::size_t>(batch.largest, span.end - span.first);
    batch.points += span.end - span.first;
  }
  return batch;
}

}  // namespace

CloudBatch BatchStorage::plan(std::span<const CloudSpan> clouds, std::size_t uploaded) {
  const std::vector<CloudSpan> spans(clouds.begin(), clouds.end());
  spans_.upload(spans, "uploading clouds");
  CloudBatch batch = batch_of(spans, uploaded);
  batch.spans = spans_.data();
  return batch;
}

CloudBatch BatchStorage::plan(std::span<const CloudSpan> clouds, std::span<const Index> which,
                              std::span<const FramedSettings> settings, std::size_t uploaded, const ForEach& for_each) {
  std::vector<CloudSpan> spans;
  std::vector<CloudSettings> of_clouds;
  Index place = 0;
  for (const Index cloud : which) {
    spans.push_back({clouds[cloud].first, clouds[cloud].end, place});
    place += clouds[cloud].end - clouds[cloud].first;
  }
  spans_.upload(spans, "uploading clouds");
  std::vector<std::size_t> begins{0};  // of each cloud's nodes
  for (std::size_t n = 0; n < which.size(); ++n) {
    const NeighborSettings& its = settings[n].neighbors;
    begins.push_back(begins.back() + nodes_of(its.levels.get()) + nodes_of(its.reach_levels.get()));
  }
  nodes_.resize(begins.back());
  pinned_nodes_.resize(begins.back());
  for (std::size_t n = 0; n < which.size(); ++n) of_clouds.push_back(on_card(settings[n], nodes_.data() + begins[n]));
  for_each(which.size(), [&](std::size_t n) {
    float* to = pinned_nodes_.get() + begins[n];
    const auto append = [&to](const NodeLevels* levels) {
      if (levels != nullptr) to = std::copy(levels->levels.begin(), levels->levels.end(), to);
    };
    append(settings[n].neighbors.levels.get());
    append(settings[n].neighbors.reach_levels.get());
  });
  settings_.upload(of_clouds, "uploading settings");
  nodes_.upload({pinned_nodes_.get(), begins.back()}, "uploading levels");
  CloudBatch batch = batch_of(spans, uploaded);
  batch.spans = spans_.data();
  batch.settings = settings_.data();
  return batch;
}

}  // namespace pointfair::cuda
