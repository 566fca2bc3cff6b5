// SPDX-License-Identifier: Apache-2.0
#include "estimate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <numeric>
#include <span>
#include <vector>

#include "share_between.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kSpacingSamples = 2000, kNoiseSamples = 500;
constexpr int kSpacingNeighbors = 6;
constexpr int kFirstFit = 30, kLargestFit = 600;
constexpr double kFitGrowth = 1.4;
// Of the radius from a quarter of the points to all of them: 2 on a plane, 4 on a line.
constexpr double kSurfaceGrowth = 2.6;
constexpr int kGroupingRounds = 5;
constexpr double kSheetShare = 0.1;      // of the samples; fewer that see two sheets are corners and outliers
constexpr double kSheetVariance = 0.12;  // of all variance, left within two groups of heights that are two sheets
// Rows are asked for in two lengths: a row of the nearest begins with every shorter one, so each serves several rounds
// of growth. The first is a round's size (30 times 1.4^4).
constexpr int kFitRows[] = {115, kLargestFit};
constexpr double kDoubtfulNoise = 0.6;  // spacings; below it residuals may be shape
// How residuals grow from one neighbourhood to one of twice the points where they are noise, where they are shape.
constexpr double kNoiseGrowth = 1.35, kShapeGrowth = 1.5;
// The same of the medians: of noise alone (fewer points scatter more), and of the variances of shape.
constexpr double kOwnGrowth = 1.05, kShapeVarianceGrowth = 4;
constexpr double kNearFlat = 2;  // of the flattest places' residual; larger ones are beyond the similarity sigma
constexpr double kEndless = 1e9;
// Noise that is alike in neighbouring points: how much residuals grow even in the flattest places (1.09 is chance), the
// variance at most (more is shape), what it grows then over that (more is shape), and the noise in spacings.
constexpr double kAlikeGrowth[] = {1.14, 1.18}, kUnlikeGrowth[] = {1.5, 1.0};
constexpr double kAlikeSlowing[] = {1.2, 0.9}, kAlikeNoise[] = {0.05, 0.1};

// Scattered over the upload order by a low-discrepancy sequence (multiples of the golden ratio), so that a period in
// the order of the file (rows of a scanner) is not met in step.
std::vector<std::uint32_t> sample_queries(std::uint64_t points, std::size_t samples) {
  std::vector<std::uint32_t> queries;
  if (points <= samples) {
    for (std::uint64_t i = 0; i < points; ++i) queries.push_back(std::uint32_t(i));
    return queries;
  }
  constexpr double kGolden = 0.6180339887498949;
  for (std::size_t i = 0; i < samples; ++i) {
    const double place = double(i + 1) * kGolden;
    queries.push_back(std::uint32_t((place - std::floor(place)) * double(points)));
  }
  return queries;
}

void throw_if_stopped(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
}

struct Vec {
  double x, y, z;
};
Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double length(Vec a) { return std::sqrt(dot(a, a)); }
Vec to_vec(Point p) { return {p.x, p.y, p.z}; }

// The known part of a row of sample_neighborhoods, relative to its query; empty if the query is invalid.
std::vector<Vec> offsets_of(std::span<const Point> row) {
  std::vector<Vec> offsets;
  offsets.reserve(row.size());
  for (const Point& p : row.subspan(1)) {
    if (std::isnan(p.x)) break;
    offsets.push_back(to_vec(p) - to_vec(row[0]));
  }
  return offsets;
}

struct Frame {
  Vec centroid;
  std::array<Vec, 3> axes;  // by falling eigenvalue: the last is the normal
  double least_eigenvalue;  // variance along the normal
};

// Cyclic Jacobi rotations; exact enough after 12 sweeps for any symmetric 3 x 3, which most never need.
Frame principal_frame(Vec centroid, double (&m)[3][3]) {
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
  for (int i = 0; i < 3; ++i) frame.axes[i] = {e[0][order[i]], e[1][order[i]], e[2][order[i]]};
  return frame;
}

// First and second moments of offsets from the query. It lies among them, so little is lost when the mean is taken off
// at the end, and a neighbourhood that grows adds its new points only.
class Moments {
 public:
  void add(Vec o) {
    first_ = {first_.x + o.x, first_.y + o.y, first_.z + o.z};
    const double products[6] = {o.x * o.x, o.x * o.y, o.x * o.z, o.y * o.y, o.y * o.z, o.z * o.z};
    for (int i = 0; i < 6; ++i) second_[i] += products[i];
  }
  Frame frame(double n) const {
    const Vec c = {first_.x / n, first_.y / n, first_.z / n};
    const auto [xx, xy, xz, yy, yz, zz] = second_;
    double m[3][3] = {{xx / n - c.x * c.x, xy / n - c.x * c.y, xz / n - c.x * c.z},
                      {xy / n - c.x * c.y, yy / n - c.y * c.y, yz / n - c.y * c.z},
                      {xz / n - c.x * c.z, yz / n - c.y * c.z, zz / n - c.z * c.z}};
    return principal_frame(c, m);
  }

 private:
  Vec first_{0, 0, 0};
  std::array<double, 6> second_{};
};

Frame frame_of(std::span<const Vec> offsets) {
  Moments moments;
  for (const Vec& o : offsets) moments.add(o);
  return moments.frame(double(offsets.size()));
}

constexpr int kTerms = 10;
// 1, u, v, u u, u v, v v, .. : the powers of u and of v in each term of a cubic.
constexpr int kPowersU[kTerms] = {0, 1, 0, 2, 1, 0, 3, 2, 1, 0}, kPowersV[kTerms] = {0, 0, 1, 0, 1, 2, 0, 1, 2, 3};

// A neighbourhood in its frame, prepared for sums of products: powers of the two coordinates in the plane, and powers
// of the second times the height. Padded with zeros to whole strides.
class CubicFit {
 public:
  CubicFit(std::span<const Vec> offsets, const Frame& frame, double radius)
      : count_(offsets.size()), padded_((count_ + kStride - 1) / kStride * kStride) {
    for (std::size_t i = 0; i < padded_; ++i) {
      const bool exists = i < count_;
      const Vec d = exists ? offsets[i] - frame.centroid : Vec{0, 0, 0};
      u_[0][i] = v_[0][i] = exists ? 1 : 0;
      u_[1][i] = dot(d, frame.axes[0]) / radius;
      v_[1][i] = dot(d, frame.axes[1]) / radius;
      height_[0][i] = dot(d, frame.axes[2]);
    }
    for (int power = 2; power < 7; ++power) {
      multiply(u_[power - 1], u_[1], u_[power]);
      multiply(v_[power - 1], v_[1], v_[power]);
    }
    for (int power = 1; power < 4; ++power) multiply(height_[power - 1], v_[1], height_[power]);
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
  static constexpr std::size_t kStride = 8;
  using Column = std::array<double, (kLargestFit + kStride - 1) / kStride * kStride>;

  void multiply(const Column& a, const Column& b, Column& product) const {
    for (std::size_t i = 0; i < padded_; ++i) product[i] = a[i] * b[i];
  }
  // In strides, which the compiler turns into vectors without changing the order of any sum.
  double sum_of_products(const Column& a, const Column& b) const {
    double part[kStride] = {};
    for (std::size_t i = 0; i < padded_; i += kStride)
      for (std::size_t j = 0; j < kStride; ++j) part[j] += a[i + j] * b[i + j];
    return std::accumulate(part, part + kStride, 0.0);
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
      for (double& value : a[i]) value /= pivot;
      for (int r = 0; r < kTerms; ++r) {
        if (r == i) continue;
        const double factor = a[r][i];
        for (int j = 0; j <= kTerms; ++j) a[r][j] -= factor * a[i][j];
      }
    }
    std::array<double, kTerms> result;
    for (int i = 0; i < kTerms; ++i) result[std::size_t(i)] = a[i][kTerms];
    return result;
  }

  std::size_t count_, padded_;
  std::array<Column, 7> u_, v_;   // u^p, v^p
  std::array<Column, 4> height_;  // height v^p
};

// A ball of radius r cuts the slab of noise: near its rim only small offsets are inside. Undoes that to second order.
double without_slab_bias(double variance, double radius) {
  double s2 = variance;
  for (int round = 0; round < 8; ++round) {
    const double t = std::min(0.15, s2 / (radius * radius));
    s2 = variance * (1 - t) / (1 - 3 * t);
  }
  return s2;
}

struct Sheet {
  std::vector<Vec> offsets;
  double gap = 0;  // to the other sheet; 0 if there is one only
};

// The offsets on the query's side where heights over the plane lie in two groups with a gap between, as those of two
// sheets of a thin part do; all of them elsewhere. Groups by two-means: of Gaussian heights its groups keep 0.36 of the
// variance, of two sheets 6 sigmas apart 0.1.
Sheet own_sheet(std::span<const Vec> offsets, const Frame& frame) {
  const auto height = [&](Vec offset) { return dot(offset - frame.centroid, frame.axes[2]); };
  double threshold = 0, below = 0, above = 0, low = 0, high = 0;
  for (int round = 0; round < kGroupingRounds; ++round) {
    below = above = low = high = 0;
    for (const Vec& o : offsets) {
      const double h = height(o);
      (h < threshold ? below : above) += 1;
      (h < threshold ? low : high) += h;
    }
    if (below == 0 || above == 0) return {{offsets.begin(), offsets.end()}};
    low /= below;
    high /= above;
    threshold = (low + high) / 2;
  }
  const double n = double(offsets.size()), between = below * above / (n * n) * (high - low) * (high - low);
  if (frame.least_eigenvalue - between >= kSheetVariance * frame.least_eigenvalue)
    return {{offsets.begin(), offsets.end()}};
  const bool is_above = height({0, 0, 0}) >= threshold;
  Sheet own{{}, high - low};
  for (const Vec& o : offsets)
    if ((height(o) >= threshold) == is_above) own.offsets.push_back(o);
  return own;
}

// False of points along a line, as those of one turn of a scanner are, and of identical points: what they leave of a
// cubic is no noise. Rows of nearest points, n >= 4.
bool are_on_a_surface(std::span<const Vec> offsets, std::size_t n) {
  return length(offsets[n - 1]) < kSurfaceGrowth * length(offsets[n / 4 - 1]);
}

// What the nearest `offsets` of a query show, of `asked` that there should be.
struct Sight {
  bool is_short = false;       // all of them are not enough, but more could be
  std::optional<Noise> noise;  // none where there is no surface, or too few of its points
};

// The neighbourhood grows until it is wide against the noise.
Sight local_noise(std::span<const Vec> offsets, std::size_t asked) {
  Moments moments;
  std::size_t added = 0;
  for (double wanted = kFirstFit;; wanted *= kFitGrowth) {
    const std::size_t k = std::min(std::min(std::size_t(wanted), std::size_t(kLargestFit)), offsets.size());
    for (; added < k; ++added) moments.add(offsets[added]);
    const double radius = length(offsets[k - 1]);
    Frame frame = moments.frame(double(k));
    const Sheet own = own_sheet(offsets.first(k), frame);
    const double n = double(own.offsets.size());
    const bool has_enough = own.offsets.size() >= kFirstFit / 2;
    if (own.gap > 0 && has_enough) frame = frame_of(own.offsets);
    const bool is_surface = are_on_a_surface(offsets, k);
    const bool wide = has_enough && is_surface && radius >= 3.7 * std::sqrt(frame.least_eigenvalue * n / (n - 3));
    if (wide || k == kLargestFit || offsets.size() < std::min(asked, std::size_t(wanted))) {
      if (!is_surface || !has_enough) return {};
      return {false, Noise{std::sqrt(without_slab_bias(CubicFit(own.offsets, frame, radius).variance(), radius)),
                           radius * std::sqrt(std::numbers::pi / n), 0, 0, own.gap}};
    }
    if (k == asked) return {true, {}};
  }
}

double quantile(std::vector<double> values, double share) {
  const auto place = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

}  // namespace

std::vector<Point> curve_sample(std::span<const Point> points) {
  constexpr std::size_t kAll = 2048, kSample = 256;  // a small cloud's cube does not depend on the order of its points
  const std::size_t count = points.size() <= kAll ? points.size() : kSample;
  std::vector<Point> sample;
  for (std::size_t i = 0; i < count; ++i) sample.push_back(points[i * points.size() / count]);
  return sample;
}

CurveCube curve_cube(std::span<const Point> sample) {
  const auto is_indexed = [](float coordinate) { return std::abs(coordinate) < 1e18f; };
  std::array<std::vector<double>, 3> axes;
  for (const Point& p : sample) {
    if (!is_indexed(p.x) || !is_indexed(p.y) || !is_indexed(p.z)) continue;
    axes[0].push_back(p.x);
    axes[1].push_back(p.y);
    axes[2].push_back(p.z);
  }
  if (axes[0].empty()) return {};
  std::array<double, 3> low{};
  double side = 0, widest = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = quantile(axes[a], 0.02);
    side = std::max(side, quantile(axes[a], 0.98) - low[a]);
    const auto [least, most] = std::minmax_element(axes[a].begin(), axes[a].end());
    widest = std::max(widest, *most - *least);
  }
  if (!(side > 0)) side = widest;  // nearly all in one place
  if (!(side > 0)) return {{float(low[0]), float(low[1]), float(low[2])}, 0};
  // On a grid that small moves hardly change, so that a pass on its own and as one of several order sums alike. From a
  // quarter of the side below the sample to a quarter above are inside wherever the grid lies.
  const double power = std::exp2(std::ceil(std::log2(1.75 * side))), step = power / 8;
  for (double& l : low) l = std::floor((l - side / 4) / step) * step;
  return {{float(low[0]), float(low[1]), float(low[2])}, float(power)};
}

Spacing measure_spacing(Backend& backend, std::uint64_t points, const std::stop_token& stop) {
  throw_if_stopped(stop);
  const std::vector<std::uint32_t> queries = sample_queries(points, kSpacingSamples);
  std::vector<Point> rows(queries.size() * (kSpacingNeighbors + 1));
  backend.sample_neighborhoods(queries, kSpacingNeighbors, rows);
  std::vector<double> means, last;
  for (std::size_t q = 0; q < queries.size(); ++q) {
    const auto offsets = offsets_of({rows.data() + q * (kSpacingNeighbors + 1), kSpacingNeighbors + 1});
    if (offsets.empty()) continue;
    double mean = 0;
    for (const Vec& o : offsets) mean += length(o) / double(offsets.size());
    means.push_back(mean);
    last.push_back(length(offsets.back()));
  }
  if (last.empty()) return {};
  // without the loneliest 2 %: a stray point's distance is no spacing
  std::sort(means.begin(), means.end());
  means.resize(means.size() - means.size() / 50);
  return {std::accumulate(means.begin(), means.end(), 0.0) / double(means.size()), quantile(last, 0.95)};
}

namespace {

// The noise seen from the first n of the offsets; -1 if the query's sheet has too few of them or they are no surface.
double noise_of_first(std::span<const Vec> offsets, std::size_t n) {
  if (!are_on_a_surface(offsets, n)) return -1;
  const double radius = length(offsets[n - 1]);
  Frame frame = frame_of(offsets.first(n));
  const Sheet own = own_sheet(offsets.first(n), frame);
  if (own.offsets.size() < kFirstFit / 2) return -1;
  if (own.gap > 0) frame = frame_of(own.offsets);
  const CubicFit fit(own.offsets, frame, radius);
  return std::sqrt(without_slab_bias(fit.variance(), radius));
}

// How residuals grow from neighbourhoods of some points to those of twice as many: hardly where they are noise.
struct Growth {
  double flat = 1, typical = 1;  // of the 15 % quantiles and of the medians
  double first = 0, second = 0;  // of the mean variance in flat places, less one; from there to twice as many again
};

Growth residual_growth(Backend& backend, std::span<const Point> rows, std::size_t row, const std::stop_token& stop) {
  const std::size_t samples = rows.size() / row;
  std::vector<double> narrow(samples, -1), wide(samples, -1), widest(samples, -1);
  backend.for_each_on_host(samples, [&](std::size_t q) {
    throw_if_stopped(stop);
    const auto offsets = offsets_of(rows.subspan(q * row, row));
    if (offsets.size() < 2 * kFirstFit) return;
    narrow[q] = noise_of_first(offsets, kFirstFit);
    wide[q] = noise_of_first(offsets, 2 * kFirstFit);
    if (offsets.size() + 1 == row) widest[q] = noise_of_first(offsets, offsets.size());
  });
  const auto growth_at = [&](double share, double most) {
    std::vector<double> from, to;
    for (std::size_t q = 0; q < samples; ++q) {
      if (narrow[q] < 0 || wide[q] < 0 || narrow[q] > most) continue;
      from.push_back(narrow[q]);
      to.push_back(wide[q]);
    }
    if (from.empty()) return 1.0;
    const double low = quantile(from, share), high = quantile(to, share);
    return low > 0 ? high / low : high > 0 ? kEndless : 1;
  };
  std::vector<double> known = narrow;
  std::erase_if(known, [](double s) { return s < 0; });
  if (known.empty()) return {};
  const double near_flat = kNearFlat * quantile(known, 0.15);
  Growth growth{growth_at(0.15, kEndless), growth_at(0.5, near_flat)};
  double variance[3] = {};
  for (std::size_t q = 0; q < samples; ++q) {
    if (narrow[q] < 0 || wide[q] < 0 || widest[q] < 0) continue;
    if (narrow[q] > near_flat || widest[q] > kNearFlat * near_flat) continue;
    variance[0] += narrow[q] * narrow[q];
    variance[1] += wide[q] * wide[q];
    variance[2] += widest[q] * widest[q];
  }
  if (variance[0] > 0 && variance[1] > 0) {
    growth.first = variance[1] / variance[0] - 1;
    growth.second = variance[2] / variance[1] - 1;
  }
  return growth;
}

// Residuals of shape grow faster and faster with the neighbourhood, those of noise that is alike in neighbouring points
// ever less.
double alikeness(const Growth& growth, double sigma_in_spacings) {
  const auto share = [](const double(&ends)[2], double value) { return share_between(ends[0], ends[1], value); };
  if (!(growth.first > 0)) return 0;
  return share(kAlikeGrowth, growth.flat) * share(kUnlikeGrowth, growth.first) *
         share(kAlikeSlowing, growth.second / growth.first) * share(kAlikeNoise, sigma_in_spacings);
}

double likeness_to_shape(double flat_growth) { return share_between(kNoiseGrowth, kShapeGrowth, flat_growth); }

// Variances of noise stay, those of shape grow fourfold: g^2 = (1 + 4 x) / (1 + x).
double shape_to_noise(double typical_growth) {
  const double squared = typical_growth * typical_growth / (kOwnGrowth * kOwnGrowth);
  if (squared >= kShapeVarianceGrowth) return kEndless;
  return std::max(0.0, (squared - 1) / (kShapeVarianceGrowth - squared));
}

}  // namespace

Noise measure_noise(Backend& backend, std::uint64_t points, const std::stop_token& stop) {
  std::vector<std::uint32_t> queries = sample_queries(points, kNoiseSamples);
  std::vector<double> sigmas, spacings, gaps;
  std::unique_ptr<Point[]> first_rows;
  const std::size_t samples = queries.size();
  for (const int k : kFitRows) {
    throw_if_stopped(stop);
    const std::size_t row = std::size_t(k) + 1;
    auto rows = std::make_unique_for_overwrite<Point[]>(queries.size() * row);  // megabytes, all written below
    backend.sample_neighborhoods(queries, k, {rows.get(), queries.size() * row});
    std::vector<Sight> found(queries.size());
    backend.for_each_on_host(queries.size(), [&](std::size_t q) {
      throw_if_stopped(stop);
      const auto offsets = offsets_of({rows.get() + q * row, row});
      if (offsets.size() >= kFirstFit / 2) found[q] = local_noise(offsets, std::size_t(k));
    });
    std::vector<std::uint32_t> again;
    for (std::size_t q = 0; q < queries.size(); ++q) {
      if (found[q].is_short) again.push_back(queries[q]);
      if (!found[q].noise) continue;
      sigmas.push_back(found[q].noise->sigma);
      spacings.push_back(found[q].noise->surface_spacing);
      if (found[q].noise->gap > 0) gaps.push_back(found[q].noise->gap);
    }
    if (first_rows == nullptr) first_rows = std::move(rows);
    queries = std::move(again);
    if (queries.empty()) break;
  }
  if (sigmas.empty()) return {};
  // Where noise is all there is, residuals spread little; where curvature adds to them, the least ones know more.
  const double sigma = std::min(quantile(sigmas, 0.35), 1.2 * quantile(sigmas, 0.15));
  Noise noise{sigma, quantile(spacings, 0.5)};
  if (double(gaps.size()) > kSheetShare * double(sigmas.size())) noise.gap = quantile(gaps, 0.25);
  if (sigma < kDoubtfulNoise * noise.surface_spacing) {
    const std::size_t row = std::size_t(kFitRows[0]) + 1;
    const Growth growth = residual_growth(backend, {first_rows.get(), samples * row}, row, stop);
    noise.likeness_to_shape = likeness_to_shape(growth.flat);
    noise.alikeness = alikeness(growth, sigma / noise.surface_spacing);
    // between two sheets, wide neighbourhoods see the other one and not shape
    if (noise.gap == 0) noise.shape_to_noise = (1 - noise.alikeness) * shape_to_noise(growth.typical);
  }
  return noise;
}

}  // namespace pointfair
