// SPDX-License-Identifier: Apache-2.0
#include "io/camera_centre.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "io/text.hpp"
#include "pointfair/viewpoint.hpp"

namespace pointfair::io {
namespace {

constexpr std::size_t kUnknowns = 12, kFewest = 64, kMost = 4096;  // points
constexpr double kPixelError = 0.1;                                // root mean square
constexpr double kApart = 20;        // times the least eigenvalue: of a plane, four are about as small
constexpr double kAgreement = 0.01;  // of the distance
constexpr double kFarthest = 1000;   // sizes of the cloud; beyond, rays count as parallel
constexpr double kNothing = 1e-6;    // of the distance: what rounding leaves of the 0 of a camera's own coordinates

using Row = std::array<double, kUnknowns>;
using Matrix = std::array<Row, kUnknowns>;

struct Least {
  Row vector{};
  double value = 0, next = 0;  // the least eigenvalue, and the one after it
};

// Of a symmetric matrix, by Jacobi's rotations.
Least least_of(Matrix a) {
  constexpr int kSweeps = 50;
  Matrix vectors{};
  for (std::size_t i = 0; i < kUnknowns; ++i) vectors[i][i] = 1;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    bool is_diagonal = true;
    for (std::size_t p = 0; p < kUnknowns; ++p) {
      for (std::size_t q = p + 1; q < kUnknowns; ++q) {
        if (std::abs(a[p][q]) <= 1e-300 || std::abs(a[p][q]) < 1e-18 * std::sqrt(std::abs(a[p][p] * a[q][q]))) continue;
        is_diagonal = false;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        const auto turn = [c, s](double& x, double& y) {
          const double before = x;
          x = c * before - s * y;
          y = s * before + c * y;
        };
        for (std::size_t k = 0; k < kUnknowns; ++k) turn(a[k][p], a[k][q]);
        for (std::size_t k = 0; k < kUnknowns; ++k) {
          turn(a[p][k], a[q][k]);
          turn(vectors[k][p], vectors[k][q]);
        }
      }
    }
    if (is_diagonal) break;
  }
  std::array<std::size_t, kUnknowns> order{};
  for (std::size_t i = 0; i < kUnknowns; ++i) order[i] = i;
  std::ranges::sort(order, [&](std::size_t i, std::size_t j) { return a[i][i] < a[j][j]; });
  Least result{{}, a[order[0]][order[0]], a[order[1]][order[1]]};
  for (std::size_t k = 0; k < kUnknowns; ++k) result.vector[k] = vectors[k][order[0]];
  return result;
}

double squared(double value) { return value * value; }

// Moves values to a mean of 0 and a mean square of 1.
struct Scale {
  double mean = 0, size = 1;
  double operator()(double value) const { return (value - mean) / size; }
};

struct Scales {
  std::array<double, 3> mean{};
  double size = 1;  // of the points
  std::array<Scale, 2> pixel{};
};

Scales scales_of(std::span<const PixelPoint> points) {
  Scales scales;
  const auto count = double(points.size());
  for (const PixelPoint& p : points) {
    for (std::size_t axis = 0; axis < 3; ++axis) scales.mean[axis] += p.point[axis] / count;
    for (std::size_t axis = 0; axis < 2; ++axis) scales.pixel[axis].mean += p.pixel[axis] / count;
  }
  double square = 0;
  std::array<double, 2> squares{};
  for (const PixelPoint& p : points) {
    for (std::size_t axis = 0; axis < 3; ++axis) square += squared(p.point[axis] - scales.mean[axis]) / count;
    for (std::size_t axis = 0; axis < 2; ++axis)
      squares[axis] += squared(p.pixel[axis] - scales.pixel[axis].mean) / count;
  }
  scales.size = std::sqrt(square);
  for (std::size_t axis = 0; axis < 2; ++axis) scales.pixel[axis].size = std::sqrt(squares[axis]);
  return scales;
}

std::array<double, 4> homogeneous(const PixelPoint& p, const Scales& scales) {
  return {(p.point[0] - scales.mean[0]) / scales.size, (p.point[1] - scales.mean[1]) / scales.size,
          (p.point[2] - scales.mean[2]) / scales.size, 1};
}

// The matrix, row by row, between scaled points and scaled pixels: of every second point from `first` on.
Least camera_of(std::span<const PixelPoint> points, const Scales& scales, std::size_t first, std::size_t step) {
  Matrix normal{};
  for (std::size_t i = first; i < points.size(); i += step) {
    const std::array<double, 4> x = homogeneous(points[i], scales);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double its = scales.pixel[axis](points[i].pixel[axis]);
      Row row{};
      for (std::size_t k = 0; k < 4; ++k) {
        row[4 * axis + k] = x[k];
        row[8 + k] = -its * x[k];
      }
      for (std::size_t r = 0; r < kUnknowns; ++r)
        for (std::size_t c = 0; c < kUnknowns; ++c) normal[r][c] += row[r] * row[c];
    }
  }
  return least_of(normal);
}

// Where the matrix gives nothing, by Cramer's rule, among scaled points; not finite where rays are parallel.
std::array<double, 3> centre_of(const Row& p) {
  const auto determinant = [&](std::size_t a, std::size_t b, std::size_t c) {
    return p[a] * (p[4 + b] * p[8 + c] - p[4 + c] * p[8 + b]) - p[b] * (p[4 + a] * p[8 + c] - p[4 + c] * p[8 + a]) +
           p[c] * (p[4 + a] * p[8 + b] - p[4 + b] * p[8 + a]);
  };
  const double whole = determinant(0, 1, 2);
  return {-determinant(3, 1, 2) / whole, -determinant(0, 3, 2) / whole, -determinant(0, 1, 3) / whole};
}

double distance(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::sqrt(squared(a[0] - b[0]) + squared(a[1] - b[1]) + squared(a[2] - b[2]));
}

// Whether the camera gives the pixels, and has all points before it.
bool fits(std::span<const PixelPoint> points, const Scales& scales, const Row& p) {
  double square = 0;
  std::size_t before = 0;
  for (const PixelPoint& point : points) {
    const std::array<double, 4> x = homogeneous(point, scales);
    std::array<double, 3> seen{};
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t k = 0; k < 4; ++k) seen[r] += p[4 * r + k] * x[k];
    before += seen[2] > 0;
    for (std::size_t axis = 0; axis < 2; ++axis)
      square += squared(seen[axis] / seen[2] * scales.pixel[axis].size + scales.pixel[axis].mean - point.pixel[axis]);
  }
  return square <= kPixelError * kPixelError * double(points.size()) && (before == 0 || before == points.size());
}

}  // namespace

std::optional<Position> camera_centre(std::span<const PixelPoint> points) {
  if (points.size() < kFewest) return std::nullopt;
  const Scales scales = scales_of(points);
  if (!(scales.size > 0) || !(scales.pixel[0].size > 0) || !(scales.pixel[1].size > 0)) return std::nullopt;
  const Least camera = camera_of(points, scales, 0, 1);
  if (!(camera.next > kApart * camera.value) || !fits(points, scales, camera.vector)) return std::nullopt;
  const std::array<double, 3> centre = centre_of(camera.vector),
                              of_one = centre_of(camera_of(points, scales, 0, 2).vector),
                              of_other = centre_of(camera_of(points, scales, 1, 2).vector);
  const double from_points = distance(centre, {});
  const double apart = std::max(distance(centre, of_one), distance(centre, of_other));
  if (!(from_points < kFarthest) || !(apart < kAgreement * from_points)) return std::nullopt;
  Position place{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    place[axis] = scales.mean[axis] + scales.size * centre[axis];
    if (std::abs(place[axis]) < kNothing * scales.size * from_points) place[axis] = 0;
  }
  return place;
}

namespace {

// Some thousand points of an image, row by row.
class PixelSample {
 public:
  PixelSample(std::uint64_t points, std::uint64_t width)
      : step_(std::max<std::uint64_t>(1, points / kMost) | 1), width_(width) {}  // not every second point of a row

  void take(std::uint64_t first, std::size_t count, const auto& position_of) {
    for (std::uint64_t i = (first + step_ - 1) / step_ * step_; i < first + count; i += step_) {
      const Position its = position_of(static_cast<std::size_t>(i - first));
      const bool is_finite = std::isfinite(its[0]) && std::isfinite(its[1]) && std::isfinite(its[2]);
      if (!is_finite || its == Position{}) continue;  // some cameras give zeros where they see nothing
      points_.push_back({its, {double(i % width_), double(i / width_)}});
    }
  }
  std::optional<Position> centre() const { return camera_centre(points_); }

 private:
  std::uint64_t step_, width_;
  std::vector<PixelPoint> points_;
};

}  // namespace

std::optional<Position> camera_centre(const Source& source, std::uint64_t width) {
  PixelSample sample(source.size(), width);
  for (std::size_t block = 0; block < source.block_count(); ++block) {
    std::vector<Position> own(source.block_size(block));
    source.positions(block, own);
    sample.take(source.block_begin(block), own.size(), [&](std::size_t i) { return own[i]; });
  }
  return sample.centre();
}

std::string where_rays_meet(const Position& place) {
  return listed_numbers(place, 6) + ", where the rays of the grid meet";
}

}  // namespace pointfair::io

namespace pointfair {

std::optional<Position> image_viewpoint(std::span<const Point> points, std::size_t width) {
  io::PixelSample sample(points.size(), width);
  sample.take(0, points.size(), [&](std::size_t i) { return Position{points[i].x, points[i].y, points[i].z}; });
  return sample.centre();
}

std::optional<Position> image_viewpoint(std::span<const Position> points, std::size_t width) {
  io::PixelSample sample(points.size(), width);
  sample.take(0, points.size(), [&](std::size_t i) { return points[i]; });
  return sample.centre();
}

}  // namespace pointfair
