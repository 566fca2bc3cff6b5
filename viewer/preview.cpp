// SPDX-License-Identifier: Apache-2.0
#include "preview.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>

namespace pointfair::viewer {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kBudgetMilliseconds = 80;  // of the larger part; 150 are promised for the whole answer
constexpr std::size_t kSamples = 4096;
constexpr std::size_t kWorthwhile = 3;  // times the points of a part; smaller clouds are shown as a whole

float squared_distance(const Point& a, const Point& b) {
  const float x = a.x - b.x, y = a.y - b.y, z = a.z - b.z;
  return x * x + y * y + z * z;  // NaN for a point that is not finite, which compares as "not near"
}

// The squared radius about `center` that holds about `size` points, from an even sample of distances.
float squared_radius_for(std::span<const Point> points, const Point& center, std::size_t size) {
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kSamples);
  std::vector<float> sample;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    const float squared = squared_distance(points[i], center);
    if (std::isfinite(squared)) sample.push_back(squared);
  }
  const std::size_t rank = size / stride;
  if (rank + 1 >= sample.size()) return std::numeric_limits<float>::max();
  std::nth_element(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(rank), sample.end());
  return sample[rank];
}

std::vector<std::uint32_t> indices_within(std::span<const Point> points, const Point& center, float squared_radius) {
  std::vector<std::uint32_t> indices;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (squared_distance(points[i], center) <= squared_radius) indices.push_back(static_cast<std::uint32_t>(i));
  return indices;
}

// Whether a method reads the displacements of neighbours, and so the neighbours of neighbours.
bool looks_twice(Method method) {
  return method == Method::taubin || method == Method::hc_laplacian || method == Method::wiener;
}

// The distance up to which other points change a point's result, over all iterations.
double reach_of(const Params& params, double spacing) {
  const double listed = spacing * std::sqrt((params.k > 0 ? params.k : params.min_neighbors) / std::numbers::pi);
  double reach = listed;
  if (!params.radius.is_automatic())
    reach = params.k > 0 ? std::min(listed, params.radius.value)
                         : std::sqrt(listed * listed + params.radius.value * params.radius.value);
  return reach * std::max(1, params.iterations) * (looks_twice(params.method) ? 2 : 1);
}

}  // namespace

Patch cut_patch(std::span<const Point> points, const Point& center, std::size_t size) {
  Patch patch;
  float squared = squared_radius_for(points, center, size);
  patch.indices = indices_within(points, center, squared);
  // a sample of distances cannot know how many points lie just beside the center
  if (patch.indices.size() > 2 * size) {
    std::vector<float> squares;
    for (const std::uint32_t i : patch.indices) squares.push_back(squared_distance(points[i], center));
    const auto nth = squares.begin() + static_cast<std::ptrdiff_t>(size);
    std::nth_element(squares.begin(), nth, squares.end());
    squared = *nth;
    std::erase_if(patch.indices, [&](std::uint32_t i) { return squared_distance(points[i], center) > squared; });
    if (patch.indices.size() > 2 * size) patch.indices.resize(2 * size);  // identical points
  }
  patch.radius = std::sqrt(squared);
  return patch;
}

void Preview::reset() {
  for (Part& part : parts_) part = Part{part.size, {}, {}, {}, {}, {}};
}

void Preview::aim(Part& part, std::span<const Point> points, const Point& center) {
  if (part.pipeline && squared_distance(center, part.center) == 0) return;
  part.patch = cut_patch(points, center, part.size);
  part.center = center;
  part.before.clear();
  for (const std::uint32_t i : part.patch.indices) part.before.push_back(points[i]);
  part.after.resize(part.before.size());
  if (!part.pipeline) part.pipeline.emplace(make_());
  part.pipeline->load(part.before);
  std::vector<Position> viewpoints = viewpoints_;
  if (viewpoints_.size() > 1) {
    viewpoints.clear();
    for (const std::uint32_t i : part.patch.indices) viewpoints.push_back(viewpoints_[i]);
  }
  part.pipeline->set_viewpoint(viewpoints);
}

// Points near the rim lack neighbours that the whole cloud has; they are left out, though never all.
Preview::Result Preview::run_part(Part& part, const Params& params, double spacing, std::stop_token stop) {
  part.pipeline->run(params, part.after, stop);
  const float inner = part.patch.radius - static_cast<float>(reach_of(params, spacing));
  const float shown = std::max(inner, 0.4f * part.patch.radius);
  Result result{part.center, shown, {}, {}};
  for (std::size_t i = 0; i < part.before.size(); ++i) {
    if (!(squared_distance(part.before[i], part.center) <= shown * shown)) continue;
    result.indices.push_back(part.patch.indices[i]);
    result.after.push_back(part.after[i]);
  }
  return result;
}

// Whether this part is shown next: it is larger than `done`, which took `milliseconds`, yet small enough
// to be worth its time.
bool Preview::is_next(std::size_t part, double milliseconds, std::size_t done, std::size_t points) const {
  if (part >= parts_.size() || kWorthwhile * parts_[part].size > points) return false;
  return milliseconds * static_cast<double>(parts_[part].size) <= kBudgetMilliseconds * static_cast<double>(done);
}

void Preview::run(std::span<const Point> points, const Point& center, const Params& params, double spacing,
                  std::stop_token stop, const Show& show) {
  bool next = true;
  for (std::size_t part = 0; next; ++part) {
    const auto start = Clock::now();
    aim(parts_[part], points, center);
    const auto aimed = Clock::now();
    Result result = run_part(parts_[part], params, spacing, stop);
    const auto end = Clock::now();
    result.milliseconds = std::chrono::duration<double, std::milli>(end - start).count();
    next = is_next(part + 1, std::chrono::duration<double, std::milli>(end - aimed).count(), parts_[part].before.size(),
                   points.size());
    result.more = next && part == 0;
    show(result);
  }
}

}  // namespace pointfair::viewer
