// SPDX-License-Identifier: Apache-2.0
#include "scale/given.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <mutex>
#include <optional>

#include "estimate/constants.hpp"
#include "io/parallel.hpp"
#include "io/points_of_source.hpp"
#include "io/scalar.hpp"
#include "seam/stop.hpp"

namespace pointfair::scale {
namespace {

std::size_t column_of(const std::shared_ptr<const Source>& source, const std::string& name) {
  const std::vector<io::Column> columns = source->columns();
  const std::optional<AttributeInfo> meant = meant_attribute({.source = source}, name);
  const auto its = std::ranges::find_if(columns, [&](const auto& c) { return meant && c.name == meant->name; });
  if (its != columns.end() && its->components == 1) return static_cast<std::size_t>(its - columns.begin());
  std::string known;
  for (const io::Column& column : columns)
    if (column.components == 1) known += (known.empty() ? "" : ", ") + column.name;
  throw Error(ErrorKind::usage, "--noise " + name + ": " + source->name() + " has no attribute '" + name +
                                    "' of one number a point; it has " + (known.empty() ? "none" : known) +
                                    ". Name one of them, or give a length");
}

// Points that have a noise, and what it is.
struct Known {
  std::vector<Point> points;
  std::vector<float> values;
};

Known known_of(const std::shared_ptr<const Source>& source, std::size_t column, std::size_t block,
               const Limits& limits) {
  const std::size_t count = source->block_size(block);
  std::vector<Point> points(count);
  io::OriginSample unused(count);
  place_seen(source, block, limits, points, unused);
  const io::NativeType type = source->columns()[column].type;
  std::vector<char> bytes(count * io::size_of(type));
  source->extract_block(column, block, bytes);
  Known known;
  for (std::size_t i = 0; i < count; ++i) {
    const auto value = static_cast<float>(io::load_double(bytes.data() + i * io::size_of(type), type, false));
    if (!(value > 0) || !std::isfinite(value) || !is_indexed(points[i])) continue;
    known.points.push_back(points[i]);
    known.values.push_back(value);
  }
  return known;
}

// Values by the bits of a half of them: positive floats have the order of their bits.
using Histogram = std::vector<std::uint64_t>;
constexpr std::size_t kHalf = 1 << 16;

// The half in which the value of this rank is, which becomes the rank among those of the half.
std::uint32_t half_at(const Histogram& histogram, std::uint64_t& rank) {
  std::uint32_t half = 0;
  for (; rank >= histogram[half]; ++half) rank -= histogram[half];
  return half;
}

}  // namespace

Cloud part_of(const std::shared_ptr<const Source>& source, std::uint64_t first, std::span<const Point> points) {
  Cloud part{.origin = source->origin()};
  part.points.assign(points.begin(), points.end());
  part.source = std::make_shared<io::PointsOfSource>(source, first, points.size());
  return part;
}

std::vector<std::uint8_t> held_by_any(const std::vector<Selection>& selections, const Cloud& cloud) {
  std::vector<std::uint8_t> held;
  for (const Selection& selection : selections) {
    const std::vector<std::uint8_t> its = selected_points(selection, cloud);
    held.resize(its.size());
    for (std::size_t i = 0; i < held.size(); ++i) held[i] |= its[i];
  }
  return held;
}

std::uint64_t place_seen(const std::shared_ptr<const Source>& source, std::size_t block, const Limits& limits,
                         std::span<Point> points, io::OriginSample& sample) {
  source->place_block(block, points, sample);
  if (limits.ignore.empty()) return 0;
  const std::vector<std::uint8_t> ignored =
      held_by_any(limits.ignore, part_of(source, source->block_begin(block), points));
  std::uint64_t finite = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!ignored[i]) continue;
    finite += is_finite(points[i]);
    points[i] = {kNan, kNan, kNan};
  }
  return finite;
}

void check_attributes(const std::shared_ptr<const Source>& source, const Limits& limits, const std::string& noise) {
  if (!limits.mask.empty())
    throw Error(ErrorKind::usage, "a run in tiles on disk takes no mask; use an attribute and --where");
  const Cloud none = part_of(source, 0, {});
  held_by_any(limits.where, none);
  held_by_any(limits.ignore, none);
  if (!noise.empty()) column_of(source, noise);
}

GivenNoise noise_of_attribute(Inputs& inputs, const Plan& plan, unsigned threads, const std::stop_token& stop) {
  const auto for_all = [&](const std::function<void(const Known&)>& visit) {
    std::mutex mutex;
    for (const InputChunk& chunk : plan.chunks) {
      const std::shared_ptr<Source> source = inputs.open(chunk.file);
      source->place_at(plan.zones.origin);
      const std::size_t column = column_of(source, plan.noise_attribute);
      io::with_threads(threads, [&] {
        io::for_each_block(chunk.end_block - chunk.first_block, [&](std::size_t i) {
          throw_if_stopped(stop);
          const Known known = known_of(source, column, chunk.first_block + i, plan.limits);
          const std::lock_guard lock(mutex);
          visit(known);
        });
      });
    }
  };
  Histogram upper(kHalf, 0), lower(kHalf, 0);
  Bounds bounds = kNoBounds;
  for_all([&](const Known& known) {
    for (const Point& p : known.points) include(bounds, p);
    for (const float value : known.values) ++upper[std::bit_cast<std::uint32_t>(value) >> 16];
  });
  if (bounds.valid == 0)
    throw Error(ErrorKind::usage, "--noise " + plan.noise_attribute +
                                      ": no value of this attribute is positive, so none is a standard deviation; name "
                                      "another, or give a length");
  std::uint64_t rank = bounds.valid / 2;
  const std::uint32_t half = half_at(upper, rank);
  for_all([&](const Known& known) {
    for (const float value : known.values) {
      const auto bits = std::bit_cast<std::uint32_t>(value);
      if (bits >> 16 == half) ++lower[bits & (kHalf - 1)];
    }
  });
  const double sigma = std::bit_cast<float>(half << 16 | half_at(lower, rank));
  // a candidate's index is its value, which is all that is asked of it
  const CloudSample sample = draw_sample(bounds, constants::kMostGivenPlaces, [&](Candidates wanted) {
    const double cells = point::cells_per_unit(to_vec3(bounds.min), to_vec3(bounds.max), wanted.refinement);
    constexpr std::size_t kMostCandidates = 1 << 18;
    std::vector<SampleCandidate> all;
    for_all([&](const Known& known) {
      for (std::size_t i = 0; i < known.points.size(); ++i) {
        const Point& p = known.points[i];
        const std::uint32_t hash = point::cell_hash(to_vec3(p), to_vec3(bounds.min), cells);
        if (hash <= wanted.limit) all.push_back({hash, std::bit_cast<std::uint32_t>(known.values[i]), p});
      }
      if (all.size() > kMostCandidates) order_candidates(all);
    });
    return all;
  });
  std::vector<float> values;
  for (const std::uint32_t bits : sample.indices) values.push_back(std::bit_cast<float>(bits));
  return given_noise(sigma, sample, values,
                     [](std::size_t count, const auto& body) { io::for_each_block(count, body); });
}

}  // namespace pointfair::scale
