// SPDX-License-Identifier: Apache-2.0
// Consistent signs of normals: Hoppe et al., Surface reconstruction from unorganized points, 1992, with neighbours
// compared as on a circle through both (the normals of a circle mirror each other), so that the two sides of a thin
// plate and of a sharp edge are told apart.
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "orient/agreement.hpp"
#include "orient/neighbors.hpp"
#include "pointfair/normals.hpp"
#include "pointfair/viewpoint.hpp"
#include "portable.hpp"

namespace pointfair {
namespace orient {
namespace {

constexpr std::size_t kNeighbors = 12, kSpacingNeighbors = 6, kBlock = 4096;
// A surface that is not steeper than this to the ray, as a cosine, looks to the sensor in all likelihood: less surely
// than its neighbours agree, since the back of a thing may be in the cloud, too.
constexpr double kLikelyCosine = 0.5, kLikely = 0.85;
constexpr double kFlatVote = 0.3;  // of the outermost points, below which a part encloses nothing

struct Sample {
  Point position, normal;
  std::uint64_t place;  // along a curve through space
  std::uint32_t index;  // in the cloud
};

float dot(const Point& a, const Point& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Point minus(const Point& a, const Point& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

// One of a normal and its opposite, the same whatever sign it came with.
Point without_sign(const Point& n) {
  const bool down = n.z != 0 ? n.z < 0 : n.y != 0 ? n.y < 0 : n.x < 0;
  return down ? Point{0 - n.x, 0 - n.y, 0 - n.z} : n;
}

std::array<float, 6> key(const Sample& s) {
  return {s.position.x, s.position.y, s.position.z, s.normal.x, s.normal.y, s.normal.z};
}

std::uint64_t spread_bits(std::uint64_t value) {  // 21 bits, each third one
  value &= 0x1FFFFF;
  value = (value | value << 32) & 0x1F00000000FFFF;
  value = (value | value << 16) & 0x1F0000FF0000FF;
  value = (value | value << 8) & 0x100F00F00F00F00F;
  value = (value | value << 4) & 0x10C30C30C30C30C3;
  return (value | value << 2) & 0x1249249249249249;
}

struct Box {
  std::array<float, 3> low, high;
};

Box box_of(const std::vector<Sample>& samples) {
  Box box;
  box.low.fill(std::numeric_limits<float>::infinity());
  box.high.fill(-std::numeric_limits<float>::infinity());
  for (const Sample& s : samples) {
    const std::array<float, 3> p{s.position.x, s.position.y, s.position.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.low[axis] = std::min(box.low[axis], p[axis]);
      box.high[axis] = std::max(box.high[axis], p[axis]);
    }
  }
  return box;
}

// The points that have a normal, in an order that does not depend on that of the cloud.
std::vector<Sample> samples_of(const Cloud& cloud, std::span<const Point> normals) {
  std::vector<Sample> samples;
  samples.reserve(normals.size());
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const Point& n = normals[i];
    if (!is_finite(cloud.points[i]) || !is_finite(n) || (n.x == 0 && n.y == 0 && n.z == 0)) continue;
    samples.push_back({cloud.points[i], without_sign(n), 0, static_cast<std::uint32_t>(i)});
  }
  const Box box = box_of(samples);
  const double longest = std::max(
      {double{box.high[0]} - box.low[0], double{box.high[1]} - box.low[1], double{box.high[2]} - box.low[2], 1e-30});
  for (Sample& s : samples) {
    const auto step = [&](float value, float low) {
      return spread_bits(static_cast<std::uint64_t>((double{value} - low) / longest * 0x1FFFFF));
    };
    s.place =
        step(s.position.x, box.low[0]) | step(s.position.y, box.low[1]) << 1 | step(s.position.z, box.low[2]) << 2;
  }
  tbb::parallel_sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) {
    return a.place != b.place ? a.place < b.place : key(a) < key(b);
  });
  return samples;
}

// The first of those that have place and normal in common, in their order, which stands for all of them.
std::vector<Sample> once_each(const std::vector<Sample>& points) {
  std::vector<Sample> samples;
  for (const Sample& s : points)
    if (samples.empty() || key(samples.back()) != key(s)) samples.push_back(s);
  return samples;
}

// Calls visit(point, the number of the sample that stands for it) for all points.
template <class Visit>
void visit_points(const std::vector<Sample>& points, const std::vector<Sample>& samples, const Visit& visit) {
  std::uint32_t at = 0;
  for (const Sample& s : points) {
    if (key(samples[at]) != key(s)) ++at;
    visit(s, at);
  }
}

template <class Body>
void for_samples(std::size_t count, const std::stop_token& stop, const Body& body) {
  tbb::parallel_for(std::size_t{0}, (count + kBlock - 1) / kBlock, [&](std::size_t block) {
    if (stop.stop_requested()) return;
    for (std::size_t i = block * kBlock; i < std::min(count, (block + 1) * kBlock); ++i) body(i);
  });
  if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
}

// How much two normals agree: the second against the first mirrored as along the arc of a circle. Within the spacing,
// an offset along the normal is noise rather than a turn.
float agreement(const Sample& a, const Sample& b, float squared_spacing) {
  const Point way = minus(b.position, a.position);
  const float square = dot(way, way) + squared_spacing;  // 0 where all of both's neighbours are at one place
  const float turn = square > 0 ? 2 * dot(a.normal, way) * dot(b.normal, way) / square : 0;
  return std::clamp(dot(a.normal, b.normal) - turn, -1.0F, 1.0F);
}

std::vector<Edge> edges_of(const std::vector<Sample>& samples, const std::stop_token& stop) {
  std::vector<Point> positions(samples.size());
  std::ranges::transform(samples, positions.begin(), [](const Sample& s) { return s.position; });
  const std::vector<std::uint32_t> lists = nearest_neighbors(positions, kNeighbors, stop);
  const auto list = [&](std::size_t i) { return std::span(lists).subspan(i * kNeighbors, kNeighbors); };
  std::vector<float> squared_spacing(samples.size());
  for_samples(samples.size(), stop, [&](std::size_t i) {
    float sum = 0, count = 0;
    for (std::size_t slot = 0; slot < kSpacingNeighbors && list(i)[slot] != kNone; ++slot, ++count) {
      const Point way = minus(positions[list(i)[slot]], positions[i]);
      sum += dot(way, way);
    }
    squared_spacing[i] = count > 0 ? sum / count : 0;
  });
  std::vector<std::vector<Edge>> of_block((samples.size() + kBlock - 1) / kBlock);
  for_samples(samples.size(), stop, [&](std::size_t i) {
    for (const std::uint32_t j : list(i)) {
      if (j == kNone) break;
      const auto back = list(j);
      if (j < i && std::ranges::find(back, std::uint32_t(i)) != back.end()) continue;  // j has it
      const float between = (squared_spacing[i] + squared_spacing[j]) / 2;
      of_block[i / kBlock].push_back({agreement(samples[i], samples[j], between), std::uint32_t(i), j});
    }
  });
  std::vector<Edge> edges;
  for (std::vector<Edge>& block : of_block) {
    edges.insert(edges.end(), block.begin(), block.end());
    block = {};
  }
  return edges;
}

// The cosine between a normal and the way to the sensor; 0 where its place is unknown.
double facing(const Cloud& cloud, const Sample& s, const Position& sensor) {
  const Position way{sensor[0] - cloud.origin[0] - s.position.x, sensor[1] - cloud.origin[1] - s.position.y,
                     sensor[2] - cloud.origin[2] - s.position.z};
  const double range = portable::hypot(way[0], way[1], way[2]);
  const double cosine = (s.normal.x * way[0] + s.normal.y * way[1] + s.normal.z * way[2]) / range;
  return std::isfinite(cosine) ? cosine : 0;
}

// The sensor is one more node, with which all agree that look there. Returns whether it has any edge.
bool add_sensor(const Cloud& cloud, const std::vector<Sample>& points, const std::vector<Sample>& samples,
                std::span<const Position> viewpoints, std::vector<Edge>& edges) {
  if (viewpoints.empty()) return false;
  const std::size_t before = edges.size();
  const auto node = static_cast<std::uint32_t>(samples.size());
  visit_points(points, samples, [&](const Sample& s, std::uint32_t at) {
    const double cosine = facing(cloud, s, viewpoints[viewpoints.size() > 1 ? s.index : 0]);
    const double likely = kLikely * std::clamp(cosine / kLikelyCosine, -1.0, 1.0);
    if (likely != 0) edges.push_back({static_cast<float>(likely), at, node});
  });
  return edges.size() > before;
}

// Where the outside of each part is: there the outermost points of 26 directions look. What encloses nothing, as ground
// or a wall seen from one side, looks up, or away from the middle of the cloud if it stands upright.
class Outside {
 public:
  Outside(const std::vector<Sample>& samples, const Signs& signs) : parts_(signs.parts) {
    const Box box = box_of(samples);
    for (std::size_t axis = 0; axis < 3; ++axis) middle_[axis] = (double{box.low[axis]} + box.high[axis]) / 2;
    for (const int x : {-1, 0, 1})
      for (const int y : {-1, 0, 1})
        for (const int z : {-1, 0, 1}) {
          if (x == 0 && y == 0 && z == 0) continue;
          const float length = std::sqrt(float(x * x + y * y + z * z));
          directions_.push_back({float(x) / length, float(y) / length, float(z) / length});
        }
    for (std::size_t i = 0; i < samples.size(); ++i) see(samples[i], signs.sign[i], parts_[signs.part[i]]);
  }

  bool looks_out(std::uint32_t part) const {
    const Part& p = parts_[part];
    double votes = 0, weight = 0;
    for (const Outermost& outermost : p.outermost) {
      votes += outermost.cosine * std::abs(outermost.cosine);
      weight += outermost.cosine * outermost.cosine;
    }
    if (std::abs(votes) > kFlatVote * weight) return votes > 0;
    if (std::abs(p.up) > kFlatVote * p.count) return p.up > 0;
    return p.outward >= 0;
  }

 private:
  struct Outermost {
    float reach = -std::numeric_limits<float>::infinity(), cosine = 0;
  };
  struct Part {
    std::array<Outermost, 26> outermost;
    double up = 0, outward = 0, count = 0;
  };

  void see(const Sample& s, int sign, Part& part) const {
    const auto own = static_cast<float>(sign);
    for (std::size_t d = 0; d < directions_.size(); ++d) {
      const float reach = dot(s.position, directions_[d]);
      if (reach > part.outermost[d].reach) part.outermost[d] = {reach, own * dot(s.normal, directions_[d])};
    }
    ++part.count;
    part.up += own * s.normal.z;
    part.outward += own * ((s.position.x - middle_[0]) * s.normal.x + (s.position.y - middle_[1]) * s.normal.y +
                           (s.position.z - middle_[2]) * s.normal.z);
  }

  std::vector<Point> directions_;
  std::array<double, 3> middle_{};
  std::vector<Part> parts_;
};

void check_sizes(const Cloud& cloud, std::size_t normals, std::size_t viewpoints) {
  const std::size_t points = cloud.points.size();
  if (normals == points && (viewpoints <= 1 || viewpoints == points)) return;
  throw Error(ErrorKind::usage, "the cloud has " + std::to_string(points) + " points, but there are " +
                                    std::to_string(normals) + " normals and " + std::to_string(viewpoints) +
                                    " viewpoints; give one for each point");
}

}  // namespace
}  // namespace orient

void orient_normals(const Cloud& cloud, std::span<Point> normals, std::span<const Position> viewpoints,
                    std::stop_token stop) {
  orient::check_sizes(cloud, normals.size(), viewpoints.size());
  std::vector<Position> of_file;
  if (viewpoints.empty()) viewpoints = of_file = file_viewpoints(cloud);
  const std::vector<orient::Sample> points = orient::samples_of(cloud, normals);
  const std::vector<orient::Sample> samples = orient::once_each(points);
  if (samples.empty()) return;
  const auto count = static_cast<std::uint32_t>(samples.size());
  std::vector<orient::Edge> edges = orient::edges_of(samples, stop);
  const bool has_sensor = orient::add_sensor(cloud, points, samples, viewpoints, edges);
  const orient::Signs signs = orient::agreeing_signs(count + 1, edges);
  if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
  const orient::Outside outside(samples, signs);
  std::vector<std::int8_t> of_part(signs.parts);
  for (std::uint32_t part = 0; part < signs.parts; ++part) of_part[part] = outside.looks_out(part) ? 1 : -1;
  if (has_sensor) of_part[signs.part[count]] = signs.sign[count];
  orient::visit_points(points, samples, [&](const orient::Sample& s, std::uint32_t at) {
    const Point& n = s.normal;
    const bool turn = signs.sign[at] * of_part[signs.part[at]] < 0;
    normals[s.index] = turn ? Point{0 - n.x, 0 - n.y, 0 - n.z} : n;
  });
}

}  // namespace pointfair
