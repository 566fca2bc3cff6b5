// SPDX-License-Identifier: Apache-2.0
#include "surface_fit.hpp"

#include <algorithm>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

namespace pointfair {
namespace {

using point::dot;

constexpr std::size_t kFewest = 15;  // points of a sheet
// Of the radius from a quarter of the points to all of them: 2 on a plane, 4 on a line.
constexpr double kSurfaceGrowth = 2.6;
constexpr double kWideRadius = 3.7;  // standard deviations of the heights
constexpr int kGroupingRounds = 5;
constexpr double kSheetVariance = 0.12;  // of all variance, left within two groups of heights that are two sheets

// Sums run in strides, which the compiler turns into vectors without changing the order of any of them.
constexpr std::size_t kStride = 8;
constexpr std::size_t padded(std::size_t count) { return (count + kStride - 1) / kStride * kStride; }
using Column = std::array<double, padded(kLargestFit)>;
using Strides = std::array<double, kStride>;
double sum(const Strides& parts) { return std::accumulate(parts.begin(), parts.end(), 0.0); }

constexpr int kTerms = 10;
// 1, u, v, u u, u v, v v, .. : the powers of u and of v in each term of a cubic.
constexpr int kPowersU[kTerms] = {0, 1, 0, 2, 1, 0, 3, 2, 1, 0}, kPowersV[kTerms] = {0, 0, 1, 0, 1, 2, 0, 1, 2, 3};

// A ball of radius r cuts the slab of noise: near its rim only small offsets are inside. Undoes that to second order.
double without_slab_bias(double variance, double radius) {
  double s2 = variance;
  for (int round = 0; round < 8; ++round) {
    const double t = std::min(0.15, s2 / (radius * radius));
    s2 = variance * (1 - t) / (1 - 3 * t);
  }
  return s2;
}

}  // namespace

void GrowingNeighborhood::Moments::add(Offset o) {
  first_ = first_ + o;
  const double products[6] = {o.x * o.x, o.x * o.y, o.x * o.z, o.y * o.y, o.y * o.z, o.z * o.z};
  for (std::size_t i = 0; i < 6; ++i) second_[i] += products[i];
}

GrowingNeighborhood::Frame GrowingNeighborhood::Moments::frame(std::size_t count) const {
  const double n = double(count);
  const Offset c = {first_.x / n, first_.y / n, first_.z / n};
  const auto [xx, xy, xz, yy, yz, zz] = second_;
  double m[3][3] = {{xx / n - c.x * c.x, xy / n - c.x * c.y, xz / n - c.x * c.z},
                    {xy / n - c.x * c.y, yy / n - c.y * c.y, yz / n - c.y * c.z},
                    {xz / n - c.x * c.z, yz / n - c.y * c.z, zz / n - c.z * c.z}};
  return principal_frame(c, m);
}

// Cyclic Jacobi rotations; exact enough after 12 sweeps for any symmetric 3 x 3, which most never need.
GrowingNeighborhood::Frame GrowingNeighborhood::principal_frame(Offset centroid, double (&m)[3][3]) {
  const double negligible = 1e-18 * (m[0][0] + m[1][1] + m[2][2]);
  double e[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (int sweep = 0; sweep < 12; ++sweep)
    for (int p = 0; p < 2; ++p)
      for (int q = p + 1; q < 3; ++q) {
        if (!(std::abs(m[p][q]) > negligible)) continue;
        const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
        const double t = (theta < 0 ? -1 : 1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double cosine = 1 / std::sqrt(t * t + 1), sine = t * cosine;
        for (int i = 0; i < 3; ++i) {
          const double a = m[i][p], b = m[i][q];
          m[i][p] = cosine * a - sine * b;
          m[i][q] = sine * a + cosine * b;
        }
        for (int i = 0; i < 3; ++i) {
          const double a = m[p][i], b = m[q][i];
          m[p][i] = cosine * a - sine * b;
          m[q][i] = sine * a + cosine * b;
          const double u = e[i][p], w = e[i][q];
          e[i][p] = cosine * u - sine * w;
          e[i][q] = sine * u + cosine * w;
        }
      }
  std::array<int, 3> order{0, 1, 2};
  std::sort(order.begin(), order.end(), [&](int a, int b) { return m[a][a] > m[b][b]; });
  Frame frame{centroid, {}, std::max(0.0, m[order[2]][order[2]])};
  for (std::size_t i = 0; i < 3; ++i) frame.axes[i] = {e[0][order[i]], e[1][order[i]], e[2][order[i]]};
  return frame;
}

void GrowingNeighborhood::grow_to(std::size_t n) {
  for (; count_ < n; ++count_) moments_.add(nearest_[count_]);
  radius_ = length(nearest_[n - 1]);
  is_surface_ = radius_ < kSurfaceGrowth * length(nearest_[n / 4 - 1]);
  frame_ = moments_.frame(n);
  find_own_sheet();
  if (gap_ == 0 || !has_enough()) return;
  Moments of_own;
  for (const Offset& o : own_) of_own.add(o);
  frame_ = of_own.frame(own_.size());
}

// The offsets on the query's side where heights over the plane lie in two groups with a gap between, as those of two
// sheets of a thin part do; all of them elsewhere. Groups by two-means: of Gaussian heights its groups keep 0.36 of the
// variance, of two sheets 6 sigmas apart 0.1.
void GrowingNeighborhood::find_own_sheet() {
  gap_ = 0;
  own_ = nearest_.first(count_);
  const auto height_of = [&](Offset o) { return dot(o - frame_.centroid, frame_.axes[2]); };
  Column height;
  Strides parts{};
  for (std::size_t i = 0; i < count_; ++i) parts[i % kStride] += height[i] = height_of(own_[i]);
  const double total = sum(parts);
  const std::size_t end = padded(count_);
  std::fill(height.begin() + std::ptrdiff_t(count_), height.begin() + std::ptrdiff_t(end),
            std::numeric_limits<double>::infinity());
  const double n = double(count_);
  double threshold = 0, below = 0, above = 0, low = 0, high = 0;
  for (int round = 0; round < kGroupingRounds; ++round) {
    Strides signs{}, least{};  // without a branch: what is above, the filling too, counts as the threshold
    for (std::size_t i = 0; i < end; i += kStride)
      for (std::size_t j = 0; j < kStride; ++j) {
        signs[j] += std::copysign(1.0, height[i + j] - threshold);
        least[j] += std::min(height[i + j], threshold);
      }
    below = (double(end) - sum(signs)) / 2;
    above = n - below;
    if (below == 0 || above == 0) return;
    const double sum_below = sum(least) - (double(end) - below) * threshold;
    low = sum_below / below;
    high = (total - sum_below) / above;
    const double middle = (low + high) / 2;
    if (std::exchange(threshold, middle) == middle) break;
  }
  const double between = below * above / (n * n) * (high - low) * (high - low);
  if (frame_.least_eigenvalue - between >= kSheetVariance * frame_.least_eigenvalue) return;
  gap_ = high - low;
  const bool is_above = height_of({0, 0, 0}) >= threshold;
  sheet_.clear();
  for (std::size_t i = 0; i < count_; ++i)
    if ((height[i] >= threshold) == is_above) sheet_.push_back(nearest_[i]);
  own_ = sheet_;
}

bool GrowingNeighborhood::has_enough() const { return own_.size() >= kFewest; }

bool GrowingNeighborhood::is_wide() const {
  const double n = double(own_.size());
  return shows_a_surface() && radius_ >= kWideRadius * std::sqrt(frame_.least_eigenvalue * n / (n - 3));
}

double GrowingNeighborhood::spacing() const { return radius_ * std::sqrt(std::numbers::pi / double(own_.size())); }

// A neighbourhood in its frame, prepared for sums of products: powers of the two coordinates in the plane, and powers
// of the second times the height. Padded with zeros to whole strides.
class GrowingNeighborhood::CubicFit {
 public:
  CubicFit(std::span<const Offset> offsets, const Frame& frame, double radius)
      : count_(offsets.size()), padded_(padded(count_)) {
    const double scale = 1 / radius;
    for (std::size_t i = 0; i < padded_; ++i) {
      const bool exists = i < count_;
      const Offset d = exists ? offsets[i] - frame.centroid : Offset{0, 0, 0};
      u_[0][i] = v_[0][i] = exists ? 1 : 0;
      u_[1][i] = dot(d, frame.axes[0]) * scale;
      v_[1][i] = dot(d, frame.axes[1]) * scale;
      height_[0][i] = dot(d, frame.axes[2]);
    }
    for (std::size_t power = 2; power < 7; ++power) {
      multiply(u_[power - 1], u_[1], u_[power]);
      multiply(v_[power - 1], v_[1], v_[power]);
    }
    for (std::size_t power = 1; power < 4; ++power) multiply(height_[power - 1], v_[1], height_[power]);
  }

  // Residual variance of the least-squares cubic, unbiased: divided by n - 10.
  double variance() const {
    const std::array<double, kTerms> c = coefficients();
    Column residual;
    for (std::size_t i = 0; i < padded_; ++i) {
      const double u = u_[1][i], v = v_[1][i];
      residual[i] = height_[0][i] - (c[0] * u_[0][i] + u * (c[1] + u * (c[3] + u * c[6])) +
                                     v * (c[2] + u * (c[4] + u * c[7]) + v * (c[5] + u * c[8] + v * c[9])));
    }
    return sum_of_products(residual, residual) / double(count_ - kTerms);
  }

 private:
  void multiply(const Column& a, const Column& b, Column& product) const {
    for (std::size_t i = 0; i < padded_; ++i) product[i] = a[i] * b[i];
  }
  double sum_of_products(const Column& a, const Column& b) const {
    Strides part{};
    for (std::size_t i = 0; i < padded_; i += kStride)
      for (std::size_t j = 0; j < kStride; ++j) part[j] += a[i + j] * b[i + j];
    return sum(part);
  }

  // By the normal equations and Gauss-Jordan elimination; a vanishing pivot drops its term. A product of two terms is a
  // monomial of degree 6 at most, of which there are 28.
  std::array<double, kTerms> coefficients() const {
    double monomial[7][7] = {}, a[kTerms][kTerms + 1];
    for (std::size_t p = 0; p < 7; ++p)
      for (std::size_t q = 0; p + q < 7; ++q) monomial[p][q] = sum_of_products(u_[p], v_[q]);
    for (int i = 0; i < kTerms; ++i) {
      for (int j = 0; j < kTerms; ++j) a[i][j] = monomial[kPowersU[i] + kPowersU[j]][kPowersV[i] + kPowersV[j]];
      a[i][kTerms] = sum_of_products(u_[std::size_t(kPowersU[i])], height_[std::size_t(kPowersV[i])]);
    }
    for (int i = 0; i < kTerms; ++i) {
      const double pivot = a[i][i];
      if (pivot < 1e-9 * double(count_)) {
        for (double& value : a[i]) value = 0;
        continue;
      }
      // columns up to i are not read again
      for (int j = i + 1; j <= kTerms; ++j) a[i][j] /= pivot;
      for (int r = 0; r < kTerms; ++r) {
        if (r == i) continue;
        const double factor = a[r][i];
        for (int j = i + 1; j <= kTerms; ++j) a[r][j] -= factor * a[i][j];
      }
    }
    std::array<double, kTerms> result;
    for (std::size_t i = 0; i < kTerms; ++i) result[i] = a[i][kTerms];
    return result;
  }

  std::size_t count_, padded_;
  std::array<Column, 7> u_, v_;   // u^p, v^p
  std::array<Column, 4> height_;  // height v^p
};

double GrowingNeighborhood::noise() const {
  return std::sqrt(without_slab_bias(CubicFit(own_, frame_, radius_).variance(), radius_));
}

}  // namespace pointfair
