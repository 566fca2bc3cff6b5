// SPDX-License-Identifier: Apache-2.0
#include "estimate/automatic.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimate/automatic_values.hpp"
#include "portable.hpp"

namespace pointfair {
namespace {

bool reads_outlier_radius(const Params& p) { return seeks_outliers(p) && sums_within_radius(p); }

// A width in radii of the neighbourhood, which for lists is what they reach on average.
bool is_of_list(const Params& p, const Length& length) {
  return !sums_within_radius(p) && length.unit == Length::Unit::radius;
}

// Whether what is automatic follows the noise from place to place. Between sheets the gap sets lengths, and heights are
// of both.
bool follows_noise(const Params& p, const Noise& noise) {
  return sums_within_radius(p) && p.method == Method::bilateral && !(noise.gap > 0);
}

// Methods that are defined on the first ring of a mesh.
bool is_of_rings(Method method) {
  return method == Method::laplacian || method == Method::taubin || method == Method::hc_laplacian ||
         method == Method::implicit;
}

// Methods after which vertices do not even out, as none do where they were published.
bool is_as_published(Method method) {
  return (is_of_rings(method) && method != Method::implicit) || is_of_faces(method);
}

// Of a vertex, in a mesh of triangles of which six meet at each.
int points_of_rings(int rings) { return 3 * rings * (rings + 1); }

// Where a square of side s holds one point, pi (R / s)^2 points lie within R of one.
double radius_of(int points, double s) { return s * std::sqrt(points / std::numbers::pi); }

// Of the neighbourhood of a typical point, by the noise and `min_neighbors`.
double typical_radius(const Params& used, double s) {
  return portable::hypot(used.radius.value, radius_of(used.min_neighbors, s));
}

}  // namespace

bool follows_rings(const Params& p) {
  return p.connectivity == Connectivity::mesh &&
         (p.rings != kAutomatic || is_of_rings(p.method) || is_of_faces(p.method));
}

// The system of method implicit is over lists, which hold an edge of its graph each.
bool sums_within_radius(const Params& p) {
  return p.k == kAutomatic && !p.constraint && !follows_rings(p) && p.method != Method::implicit;
}

bool seeks_outliers(const Params& p) {
  if (p.outliers != Outliers::automatic) return p.outliers != Outliers::off;
  return sums_within_radius(p) && moves_along_normal(p.method);
}

namespace {

FollowedNoise followed_noise(const Params& asked, const Params& used, Estimate found) {
  const Noise& noise = found.noise;
  FollowedNoise followed;
  if (sums_within_radius(asked) && asked.method == Method::bilateral && noise.surface_spacing > 0)
    followed.widest = constants::kOutlierRadius * typical_radius(used, noise.surface_spacing);
  if (!follows_noise(asked, noise)) return followed;
  if (asked.min_neighbors == kAutomatic) followed.reach_levels = std::move(found.reach_levels);
  if (!asked.relaxation) followed.damage = share_damage(of_sigma(noise, used.noise.value), used.iterations);
  if (followed.damage > 0 && noise.sigma > 0) followed.trusted = constants::kTrustedNoise * noise.surface_spacing;
  // without levels no surface shows at all, and nothing moves unless a noise is given
  if (followed.damage > 0 && (found.levels || asked.noise.is_automatic()))
    followed.without_surface = noise.without_surface;
  if (!found.levels) return followed;
  followed.levels = std::move(found.levels);
  followed.radius = asked.radius.is_automatic();
  followed.similarity = asked.similarity_sigma.is_automatic();
  followed.limit = asked.displacement_limit.is_automatic();
  if (asked.outlier_distance.is_automatic()) followed.outlier_distance = constants::kOutlierDistance * used.noise.value;
  return followed;
}

bool needs_noise(const Params& p) {
  const bool neighbors_follow =
      sums_within_radius(p) ? p.radius.is_automatic() || p.min_neighbors == kAutomatic || !p.flat_scale || !p.relaxation
                            : p.k == kAutomatic && p.radius.is_automatic() && !follows_rings(p);
  const auto of_density = [&](const Length& l) { return l.is_automatic() || is_of_list(p, l); };
  return neighbors_follow || (p.method == Method::implicit && !p.implicit_lambda) || of_density(p.normal_sigma) ||
         of_density(p.closeness_sigma) || p.similarity_sigma.is_automatic() ||
         (p.constraint && p.delta.is_automatic() && p.noise.is_automatic()) ||  // sigma is all that it reads
         (seeks_outliers(p) && (p.displacement_limit.is_automatic() || p.outlier_distance.is_automatic() ||
                                (reads_outlier_radius(p) && p.outlier_radius.is_automatic())));
}

bool needs_spacing(const Params& p) {
  const auto of_spacing = [&](const Length& l) {
    return l.unit == Length::Unit::spacing || l.is_automatic() || is_of_list(p, l);
  };
  const bool has_radius = sums_within_radius(p) && !p.radius.is_automatic();
  const bool seeks_lambda = p.method == Method::implicit && !p.implicit_lambda;
  return (p.k == kAutomatic && !has_radius) || seeks_lambda || p.noise.unit == Length::Unit::spacing ||
         of_spacing(p.normal_sigma) || of_spacing(p.closeness_sigma) || of_spacing(p.similarity_sigma) ||
         p.radius.unit == Length::Unit::spacing || (p.constraint && (of_spacing(p.rho) || of_spacing(p.delta))) ||
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

// Turns parameters into what a run uses, group by group; later groups read earlier ones.
class Resolver {
 public:
  Resolver(const Params& params, const Spacing& spacing, const Noise& measured, double diagonal)
      : asked_(params),
        used_(params),
        spacing_(spacing),
        diagonal_(diagonal),
        its_(defaults_of(params.method)),
        within_radius_(sums_within_radius(params)),
        noise_(measured) {
    if (!asked_.noise.is_automatic() || needs_noise(asked_)) used_.noise = in_file_units(asked_.noise, measured.sigma);
    if (!asked_.noise.is_automatic()) noise_ = of_sigma(measured, used_.noise.value);
    s_ = noise_.surface_spacing > 0 ? noise_.surface_spacing : spacing_.mean;
  }

  Params resolved() {
    set_neighborhoods();
    set_widths();
    set_choices();
    set_relaxation();
    set_limits();
    return used_;
  }

 private:
  Length in_file_units(const Length& length, double automatic) const {
    switch (length.unit) {
      case Length::Unit::automatic:
        return std::max(automatic, least());
      case Length::Unit::percent:
        return positive(length.value * diagonal_ / 100);
      case Length::Unit::spacing:
        return positive(length.value * spacing_.mean);
      case Length::Unit::file:
      case Length::Unit::radius:
      case Length::Unit::metre:  // was turned into file units
        break;
    }
    return length;
  }
  // A cloud without extent or noise must still get lengths that can be given again.
  double positive(double length) const { return length > 0 ? length : least(); }
  double least() const { return 1e-6 * (spacing_.mean > 0 ? spacing_.mean : diagonal_ > 0 ? diagonal_ : 1.0); }

  void set_neighborhoods() {
    if (!asked_.radius.is_automatic()) used_.radius = in_file_units(asked_.radius, 0);
    if (within_radius_) {
      const double factor = its_.fits_radius ? radius_factor(noise_, s_) : 1;
      if (asked_.radius.is_automatic()) used_.radius = in_file_units({}, factor * its_.noise_radius * noise_.sigma);
      if (asked_.min_neighbors == kAutomatic)
        used_.min_neighbors = std::min(
            kMaxMinNeighbors, noise_.repeats * int(std::lround(factor * factor * automatic_min_neighbors(noise_, s_))));
    } else {
      const bool rings = follows_rings(asked_);
      if (rings && asked_.rings == kAutomatic && !is_of_faces(asked_.method)) used_.rings = 1;
      const bool is_graph = asked_.method == Method::implicit;
      if (!rings && asked_.k == kAutomatic) used_.k = is_graph ? constants::kGraphNeighbors : automatic_k(noise_, s_);
      list_radius_ = radius_of(rings ? points_of_rings(used_.rings) : used_.k, s_);
      if (rings && used_.rings == kAutomatic) list_radius_ = used_.radius.value;
      if (!used_.radius.is_automatic()) list_radius_ = std::min(list_radius_, used_.radius.value);
    }
    used_.rho = in_file_units(asked_.rho, spacing_.rho);
    used_.delta = in_file_units(asked_.delta, constants::kNoiseOfDelta * noise_.sigma);
  }

  // Of a Gaussian: by the radius of each point, or by what a list of k reaches on average.
  Length width(const Length& length, double of_radius, double of_list) const {
    if (within_radius_)
      return length.is_automatic() ? Length(of_radius, Length::Unit::radius) : in_file_units(length, 0);
    if (length.unit == Length::Unit::radius) return std::max(length.value * list_radius_, least());
    return in_file_units(length, of_list * list_radius_);
  }

  void set_widths() {
    used_.normal_sigma = width(asked_.normal_sigma, constants::kNormalWidth, 1);
    const bool is_uniform = follows_rings(asked_) && is_of_rings(asked_.method);
    used_.closeness_sigma = width(asked_.closeness_sigma, its_.closeness_width,
                                  is_uniform ? constants::kUniformCloseness : constants::kListCloseness);
    double similarity = its_.similarity_width * noise_.sigma;
    if (noise_.gap > 0)
      similarity = std::min(similarity, std::max(noise_.sigma, constants::kSheetSimilarity * noise_.gap));
    used_.similarity_sigma = in_file_units(asked_.similarity_sigma, std::max(similarity, its_.least_similarity * s_));
  }

  // A list is the paper's road: what the paper does not have is off unless asked for.
  void set_choices() {
    if (asked_.normal_filter == NormalFilter::automatic)
      used_.normal_filter = within_radius_ || its_.filter == NormalFilter::mollify ? its_.filter : NormalFilter::off;
    if (asked_.connectivity == Connectivity::automatic) used_.connectivity = Connectivity::points;
    if (!asked_.tangential && asked_.connectivity == Connectivity::mesh)
      used_.tangential = is_as_published(asked_.method) ? 0 : constants::kTangential;
    if (asked_.offset == Offset::automatic) used_.offset = within_radius_ ? Offset::symmetric : Offset::point;
    if (asked_.crease_angle == kAutomatic) used_.crease_angle = constants::kCreaseAngle;
    if (!asked_.flat_scale)
      used_.flat_scale = its_.fits_radius && within_radius_ ? automatic_flat_scale(noise_, s_) : 1;
    if (asked_.iterations == kAutomatic) used_.iterations = its_.iterations;
    if (asked_.implicit_weights == ImplicitWeights::automatic) used_.implicit_weights = ImplicitWeights::curvature;
    if (asked_.method == Method::implicit && !asked_.implicit_lambda)
      used_.implicit_lambda = automatic_lambda(noise_, s_);
    if (asked_.outliers == Outliers::automatic)
      used_.outliers = seeks_outliers(asked_) ? Outliers::keep : Outliers::off;
  }

  void set_relaxation() {
    if (asked_.relaxation) return;
    // many small iterations make the whole together
    const int whole_iterations = its_.iterations > constants::kIterations ? 1 : used_.iterations;
    used_.relaxation = within_radius_ ? automatic_relaxation(its_.relaxation_percent, whole_iterations, noise_, s_,
                                                             follows_noise(asked_, noise_))
                                      : its_.relaxation_percent / 100.0;
  }

  void set_limits() {
    used_.displacement_limit = in_file_units(asked_.displacement_limit,
                                             farthest_move(noise_, s_, follows_noise(asked_, noise_)) * noise_.sigma);
    const double least_outlier = constants::kOutlierSpacings * s_;
    used_.outlier_distance =
        in_file_units(asked_.outlier_distance, std::max(constants::kOutlierDistance * noise_.sigma, least_outlier));
    const double typical = within_radius_ ? typical_radius(used_, s_) : list_radius_;
    used_.outlier_radius = in_file_units(asked_.outlier_radius, constants::kOutlierRadius * typical);
  }

  const Params& asked_;
  Params used_;
  Spacing spacing_;
  double diagonal_;
  MethodDefaults its_;
  bool within_radius_;
  Noise noise_;
  double s_ = 0;            // of the surface
  double list_radius_ = 0;  // what lists reach on average
};

}  // namespace

Needed needed_by(const Params& asked) {
  // with all the room that Eq. 18 knows; noise that neighbours share may ask for more
  const int most = int(std::lround(constants::kRoominess * constants::kRoominess * constants::kMinNeighbors));
  const int usual = asked.min_neighbors == kAutomatic ? most : asked.min_neighbors;
  return {{needs_spacing(asked), needs_noise(asked), sums_within_radius(asked) ? usual : 0, needs_noise(asked)},
          needs_diagonal(asked)};
}

Resolved resolve(const Params& asked, Estimate found, double diagonal) {
  const Needed needed = needed_by(asked);
  if (!needed.estimates.spacing) found.spacing = {};
  if (!needed.estimates.noise) found.noise = {};
  Resolved result{Resolver(asked, found.spacing, found.noise, needed.diagonal ? diagonal : 0).resolved(), {}};
  if (!needed.estimates.noise) return result;
  result.sensor = found.sensor;
  result.followed = followed_noise(asked, result.params, std::move(found));
  return result;
}

}  // namespace pointfair
