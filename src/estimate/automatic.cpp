// SPDX-License-Identifier: Apache-2.0
#include "estimate/automatic.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimate/share_between.hpp"

namespace pointfair {
namespace {

// Neighbourhoods are balls whose radius follows noise and density, unless the caller says otherwise.
bool chooses_balls(const Params& p) { return p.k == kAutomatic && p.radius.is_automatic() && !p.constraint; }
// Lists are the paper's road, which knows no outliers; and where points also move along the surface, a long way says
// nothing of noise.
bool seeks_outliers(const Params& p) {
  if (p.outliers != Outliers::automatic) return p.outliers != Outliers::off;
  return sums_balls(p) && moves_along_normal(p.method);
}
bool reads_outlier_radius(const Params& p) { return seeks_outliers(p) && sums_balls(p); }

// A width in radii of the neighbourhood, which for lists is what they reach on average.
bool is_of_list(const Params& p, const Length& length) { return !sums_balls(p) && length.unit == Length::Unit::radius; }

constexpr double kNoiseRadius = 2.5;                          // radius of a ball on top of the spacing, in sigmas
constexpr int kMinNeighbors = 16, kMinNeighborsIfAlike = 48;  // and the neighbours that make up the spacing's part
// Factors of a ball's radius, and the noise in spacings where they set in, and beyond which samples do not see far
// enough.
constexpr double kRoominess = 1.15, kConfinement = 0.67, kBendPower = 0.06, kLeastFactor = 0.75;
constexpr double kRoomyNoise[] = {0.5, 0.85}, kBendingNoise[] = {0.25, 0.45}, kUnseenNoise[] = {3.6, 4.4};
constexpr double kSeparableGap = 1.9;                 // spacings between two sheets
constexpr double kOneSheet = 0.65, kBothSheets = 14;  // of the points of one sheet within the gap
constexpr double kSheetSimilarity = 1.0 / 6;          // of the gap
constexpr double kNormalWidth = 1.4;                  // of a ball's radius
constexpr double kClosenessWidth = 0.6;               // of a ball's radius
constexpr double kSimilarityWidth = 3;                // sigmas
// Spacings; noise below it is hard to tell from shape: where residuals look like noise, and where they look like shape.
constexpr double kTrustedNoise = 0.02, kTrustedShape = 0.16;
constexpr double kShapeDamage = 3, kUnseenShape = 0.01;     // of the noise's variance; less shape looks like none
constexpr int kCreaseAngle = 15, kCreaseAngleOfNoise = 20;  // degrees
constexpr double kTurningNoise[] = {0.45, 1};               // spacings
constexpr int kFlatPercent = 160;                           // of the radius
constexpr double kFlatNoise[] = {0.1, 0.25};                // spacings
constexpr int kIterations = 2;
constexpr double kFarthestMove = 4, kFarthestOfLittleNoise = 1.5, kOutlierDistance = 6;  // sigmas
constexpr double kLittleNoise = 0.03, kMuchNoise = 0.5;         // spacings; between them the farthest move grows
constexpr double kSmoothingNoise = 0.1, kShapelessNoise = 0.6;  // spacings; between them shape matters less and less
constexpr double kDamage = 0.6;                  // of the variance that noise does not explain, by each iteration
constexpr double kHarmlessNoise[] = {0.2, 0.6};  // spacings; between them neighbourhoods begin to be wide for its sake
constexpr double kOutlierRadius = 6;             // of what holds a typical point's neighbours
constexpr double kOutlierSpacings = 0.5;         // and at least so many spacings, twice if residuals are shape

// What `auto` means for one method; the constants above are the bilateral one's.
struct MethodDefaults {
  double noise_radius = kNoiseRadius, closeness_width = kClosenessWidth;
  double similarity_width = kSimilarityWidth, least_similarity = 0.05;  // sigmas, spacings
  int relaxation_percent = 100, iterations = kIterations;
  NormalFilter filter = NormalFilter::off;
  bool fits_balls = false;  // to the shape; without filtered normals wider ones round edges
};

MethodDefaults defaults_of(Method method) {
  MethodDefaults its;
  switch (method) {
    case Method::bilateral:
      its.filter = NormalFilter::on;
      its.fits_balls = true;
      break;
    case Method::laplacian:
      its.closeness_width = 0.4;
      break;
    case Method::taubin:
      its.relaxation_percent = 63;  // his lambda
      its.iterations = 8;
      break;
    case Method::hc_laplacian:
      its.closeness_width = 0.5;
      its.iterations = 6;
      break;
    case Method::mls:
      its.noise_radius = 3;
      its.closeness_width = 0.5;
      break;
    case Method::wiener:
      its.closeness_width = 0.4;
      its.similarity_width = 1;  // the noise itself
      its.least_similarity = 0;
      break;
    case Method::mollified:
      its.closeness_width = 0.5;
      its.filter = NormalFilter::mollify;
      break;
  }
  return its;
}

// In spacings.
double level_of(const Noise& noise, double spacing) { return spacing > 0 ? noise.sigma / spacing : 0; }

// What multiplies the radius of balls (Eq. 18 of docs/how-it-works.md). Where only the noise sets their width, wider
// ones leave less noise if the shape has room for them; the more of it has none, the narrower. Balls between sheets
// follow the gap.
double ball_factor(const Noise& noise, double spacing) {
  const double level = level_of(noise, spacing);
  if (!(level > 0) || noise.gap > 0) return 1;
  const double room = std::pow(kRoominess, share_between(kRoomyNoise, level));
  const double shape = std::pow(kConfinement, noise.confined) *
                       std::pow(std::max(1.0, noise.bend), -kBendPower * share_between(kBendingNoise, level));
  return std::pow(std::max(kLeastFactor, room * shape), 1 - share_between(kUnseenNoise, level));
}

// Degrees. Normals that little noise tilts differ less by it.
int automatic_crease_angle(const Noise& noise, double spacing) {
  const double share = share_between(kTurningNoise, level_of(noise, spacing));
  return int(std::lround(std::lerp(kCreaseAngle, kCreaseAngleOfNoise, share)));
}

// In hundredths. Noise that is next to none leaves nothing to gain.
double automatic_flat_scale(const Noise& noise, double spacing) {
  const double share = share_between(kFlatNoise, level_of(noise, spacing));
  return double(std::lround(std::lerp(100, kFlatPercent, share))) / 100;
}

// Noise that is alike in neighbouring points does not average out among a few of them. Between the sheets of a thin
// part: balls that stop short of the other sheet, or, where that leaves them too few points for a normal, such as are
// so wide that the normal of both sheets is that of each.
int automatic_min_neighbors(const Noise& noise, double spacing) {
  if (!(noise.gap > 0 && spacing > 0))
    return int(std::lround(std::lerp(kMinNeighbors, kMinNeighborsIfAlike, noise.alikeness)));
  const double gap = noise.gap / spacing, count = std::numbers::pi * gap * gap;
  if (gap > kSeparableGap) return std::min(kMinNeighbors, int(kOneSheet * count));
  return std::clamp(int(kBothSheets * count), kMinNeighbors, kMaxMinNeighbors);
}

// In hundredths. Next to nothing where the noise estimate is small against the spacing, so that clean clouds stay
// clean. What a run does to the shape itself has about 3 times the variance that shape has in the estimate's
// neighbourhoods; the share of the displacement that leaves least of both, Wiener's, is that of the noise. Where balls
// are wide for the noise's sake and not for the 16 points', they damage less than that: the share has a least value
// that grows with the noise, up to all. `iterations` together make that share, each of which would make the whole.
double automatic_relaxation(int whole_percent, int iterations, const Noise& noise, double spacing, bool by_share) {
  if (!(noise.sigma > 0)) return 0.01;
  const double trusted = kTrustedNoise + noise.likeness_to_shape * (kTrustedShape - kTrustedNoise);
  const double ratio = trusted * spacing / noise.sigma;
  const double smallness = 1 - share_between(kSmoothingNoise, kShapelessNoise, noise.sigma / spacing);
  const double of_noise =
      by_share ? 1
               : std::max(1 / (1 + kShapeDamage * (kUnseenShape + noise.shape_to_noise)), 1 - std::pow(smallness, 4));
  const double share = 1 - std::pow(1 - of_noise, 1.0 / iterations);
  return double(std::max(1l, std::lround(whole_percent * share / (1 + ratio * ratio * ratio * ratio)))) / 100;
}

// Of the share of a displacement (point/noise_field.h). Neighbourhoods that are wide for the noise's sake damage the
// shape less than those that hold just 16 points, and noise that is alike in neighbouring points looks like shape.
double share_damage(const Noise& noise, int iterations) {
  const double level = level_of(noise, noise.surface_spacing);
  return kDamage * iterations * (1 - share_between(kHarmlessNoise, level)) * (1 - noise.alikeness);
}

// Whether what is automatic follows the noise from place to place. Between sheets the gap sets lengths, and heights are
// of both.
bool follows_noise(const Params& p, const Noise& noise) {
  return chooses_balls(p) && p.method == Method::bilateral && !(noise.gap > 0);
}

// Sigmas. Where noise is little against the spacing, what moves by more is edges, which balls reach across.
double farthest_move(const Noise& noise, double spacing, bool by_share) {
  if (by_share) return kFarthestMove;  // what moves far for its edge is held back by that
  const double level = spacing > 0 ? noise.sigma / spacing : kMuchNoise;
  return std::lerp(kFarthestOfLittleNoise, kFarthestMove, share_between(kLittleNoise, kMuchNoise, level));
}

}  // namespace

bool sums_balls(const Params& p) { return p.k == kAutomatic && !p.constraint; }

FollowedNoise followed_noise(const Params& asked, const Params& used, const Noise& noise,
                             std::shared_ptr<const NoiseLevels> levels) {
  if (!follows_noise(asked, noise)) return {};
  FollowedNoise followed;
  if (!asked.relaxation) followed.damage = share_damage(of_sigma(noise, used.noise.value), used.iterations);
  if (!levels) return followed;
  followed.levels = std::move(levels);
  followed.similarity = asked.similarity_sigma.is_automatic();
  followed.limit = asked.displacement_limit.is_automatic();
  if (asked.outlier_distance.is_automatic()) followed.outlier_distance = kOutlierDistance * used.noise.value;
  return followed;
}

bool needs_noise(const Params& p) {
  const bool k_follows = p.k == kAutomatic && p.radius.is_automatic();
  const auto of_density = [&](const Length& l) { return l.is_automatic() || is_of_list(p, l); };
  return k_follows || of_density(p.normal_sigma) || of_density(p.closeness_sigma) ||
         p.similarity_sigma.is_automatic() ||
         (p.constraint && p.delta.is_automatic() && p.noise.is_automatic()) ||  // sigma is all that it reads
         (seeks_outliers(p) && (p.displacement_limit.is_automatic() || p.outlier_distance.is_automatic() ||
                                (reads_outlier_radius(p) && p.outlier_radius.is_automatic())));
}

bool needs_spacing(const Params& p) {
  const auto of_spacing = [&](const Length& l) {
    return l.unit == Length::Unit::spacing || l.is_automatic() || is_of_list(p, l);
  };
  return p.k == kAutomatic || p.noise.unit == Length::Unit::spacing || of_spacing(p.normal_sigma) ||
         of_spacing(p.closeness_sigma) || of_spacing(p.similarity_sigma) || p.radius.unit == Length::Unit::spacing ||
         (p.constraint && (of_spacing(p.rho) || of_spacing(p.delta))) ||
         (seeks_outliers(p) && (of_spacing(p.displacement_limit) || of_spacing(p.outlier_distance))) ||
         (reads_outlier_radius(p) && of_spacing(p.outlier_radius));
}

bool needs_diagonal(const Params& p) {
  // lengths that follow the spacing fall back on the diagonal where there is none
  const auto given = [](const Length& l) { return l.unit == Length::Unit::file; };
  const auto is_set_aside = [&](const Length& l) { return !p.constraint && l.is_automatic(); };
  const auto is_unread = [&](const Length& l) { return !seeks_outliers(p) && l.is_automatic(); };
  const bool all_given = p.noise.unit != Length::Unit::percent && given(p.normal_sigma) && given(p.closeness_sigma) &&
                         given(p.similarity_sigma) &&
                         (given(p.radius) || (p.radius.is_automatic() && p.k != kAutomatic)) &&
                         (given(p.rho) || is_set_aside(p.rho)) && (given(p.delta) || is_set_aside(p.delta)) &&
                         (given(p.outlier_distance) || is_unread(p.outlier_distance)) &&
                         (given(p.outlier_radius) || (!reads_outlier_radius(p) && p.outlier_radius.is_automatic())) &&
                         (given(p.displacement_limit) || is_unread(p.displacement_limit));
  return !all_given;
}

Params resolve_params(const Params& params, const Spacing& spacing, const Noise& measured, double diagonal) {
  // A cloud without extent or noise must still get lengths that can be given again.
  const double least = 1e-6 * (spacing.mean > 0 ? spacing.mean : diagonal > 0 ? diagonal : 1.0);
  const auto in_file_units = [&](const Length& length, double automatic) -> Length {
    switch (length.unit) {
      case Length::Unit::automatic:
        return std::max(automatic, least);
      case Length::Unit::percent:
        return length.value * diagonal / 100;
      case Length::Unit::spacing:
        return length.value * spacing.mean;
      case Length::Unit::file:
      case Length::Unit::radius:
      case Length::Unit::metre:  // was turned into file units
        break;
    }
    return length;
  };
  Params used = params;
  if (!params.noise.is_automatic() || needs_noise(params)) used.noise = in_file_units(params.noise, measured.sigma);
  const Noise noise = params.noise.is_automatic() ? measured : of_sigma(measured, used.noise.value);
  const MethodDefaults its = defaults_of(params.method);
  const bool by_ball = sums_balls(params);
  // Where a square of side s holds one point, pi (R / s)^2 points lie within R of one.
  const double s = noise.surface_spacing > 0 ? noise.surface_spacing : spacing.mean;
  double list_radius = 0;
  if (!params.radius.is_automatic()) used.radius = in_file_units(params.radius, 0);
  if (chooses_balls(params)) {
    const double factor = its.fits_balls ? ball_factor(noise, s) : 1;
    used.radius = in_file_units({}, factor * its.noise_radius * noise.sigma);
    if (params.min_neighbors == kAutomatic)
      used.min_neighbors =
          std::min(kMaxMinNeighbors, int(std::lround(factor * factor * automatic_min_neighbors(noise, s))));
  } else if (!by_ball) {
    if (params.k == kAutomatic) {  // wide enough for 11 points and wide against the noise
      const double wide = std::hypot(3 * noise.sigma, s * std::sqrt(11 / std::numbers::pi));
      const double count = s > 0 ? std::numbers::pi * (wide / s) * (wide / s) : 11;
      used.k = int(std::min<double>(count, kMaxNeighbors));
    }
    list_radius = s * std::sqrt(used.k / std::numbers::pi);
    if (!used.radius.is_automatic()) list_radius = std::min(list_radius, used.radius.value);
  }
  // the width of a Gaussian: by the ball of each point, or by what a list of k reaches on average
  const auto width = [&](const Length& length, double of_ball, double of_list) -> Length {
    if (by_ball) return length.is_automatic() ? Length(of_ball, Length::Unit::radius) : in_file_units(length, 0);
    if (length.unit == Length::Unit::radius) return std::max(length.value * list_radius, least);
    return in_file_units(length, of_list * list_radius);
  };
  used.rho = in_file_units(params.rho, spacing.rho);
  used.delta = in_file_units(params.delta, 2.5 * noise.sigma);
  used.normal_sigma = width(params.normal_sigma, kNormalWidth, 1);
  used.closeness_sigma = width(params.closeness_sigma, its.closeness_width, 0.5);  // Fleishman 2003: radius = 2 sigma_c
  double similarity = its.similarity_width * noise.sigma;
  if (noise.gap > 0) similarity = std::min(similarity, std::max(noise.sigma, kSheetSimilarity * noise.gap));
  used.similarity_sigma = in_file_units(params.similarity_sigma, std::max(similarity, its.least_similarity * s));
  // A list is the paper's road: what the paper does not have is off unless asked for.
  if (params.normal_filter == NormalFilter::automatic)
    used.normal_filter = by_ball || its.filter == NormalFilter::mollify ? its.filter : NormalFilter::off;
  if (params.offset == Offset::automatic) used.offset = by_ball ? Offset::symmetric : Offset::point;
  if (params.crease_angle == kAutomatic) used.crease_angle = automatic_crease_angle(noise, s);
  if (!params.flat_scale)  // a radius that was asked for is kept to
    used.flat_scale = its.fits_balls && chooses_balls(params) ? automatic_flat_scale(noise, s) : 1;
  if (params.iterations == kAutomatic) used.iterations = its.iterations;
  if (!params.relaxation) {
    // many small iterations make the whole together
    const int whole_iterations = its.iterations > kIterations ? 1 : used.iterations;
    used.relaxation = chooses_balls(params) ? automatic_relaxation(its.relaxation_percent, whole_iterations, noise, s,
                                                                   follows_noise(params, noise))
                                            : its.relaxation_percent / 100.0;
  }
  if (params.outliers == Outliers::automatic) used.outliers = seeks_outliers(params) ? Outliers::keep : Outliers::off;
  used.displacement_limit =
      in_file_units(params.displacement_limit, farthest_move(noise, s, follows_noise(params, noise)) * noise.sigma);
  const double least_outlier = kOutlierSpacings * (1 + noise.likeness_to_shape) * s;
  used.outlier_distance =
      in_file_units(params.outlier_distance, std::max(kOutlierDistance * noise.sigma, least_outlier));
  const double widened = s * std::sqrt(used.min_neighbors / std::numbers::pi);
  const double typical = by_ball ? std::hypot(used.radius.value, widened) : list_radius;
  used.outlier_radius = in_file_units(params.outlier_radius, kOutlierRadius * typical);
  return used;
}

}  // namespace pointfair
