// SPDX-License-Identifier: Apache-2.0
// Every parameter of a run, and the one table that describes each of them: flags, sliders, docs, range checks and the
// stage cache all read `kParams`.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

namespace pointfair {

/// A length in one of five units. Plain numbers convert: `params.radius = 0.02`.
struct Length {
  enum class Unit : std::uint8_t {
    automatic,  ///< chosen from the data
    file,       ///< the unit of the cloud's coordinates
    percent,    ///< percent of the bounding-box diagonal; "0.5%" is 0.5
    spacing,    ///< multiple of the mean spacing; "2s" is 2
    radius,     ///< multiple of the radius of each point's neighbourhood; "0.6r" is 0.6; widths of Gaussians only
  };
  double value = 0;
  Unit unit = Unit::automatic;

  constexpr Length() = default;
  constexpr Length(double in_file_units) : value(in_file_units), unit(Unit::file) {}
  constexpr Length(double amount, Unit its_unit) : value(amount), unit(its_unit) {}
  constexpr bool is_automatic() const { return unit == Unit::automatic; }
  friend constexpr bool operator==(const Length&, const Length&) = default;
};

/// Stages in the order of the road; each reads the results of the one before. `passes` repeats the whole chain.
enum class Stage : std::uint8_t { index, neighbors, normals, fairing, passes };

/// How a point moves; docs/methods.md has a section on each.
enum class Method : std::uint8_t { bilateral, laplacian, taubin, hc_laplacian, mls, wiener, mollified };
enum class AreaWeight : std::uint8_t { none, length, squared };
/// on: two rounds that keep edges (bilateral); mollify: one round that does not (a Gaussian mean, Jones 2003).
enum class NormalFilter : std::uint8_t { automatic, off, on, mollify };
/// Which planes an offset is measured to: the point's own (paper eq. 2), or its own and the neighbour's alike.
enum class Planes : std::uint8_t { automatic, own, both };
/// What is done with points off the surface: `off` does not look for them, `move` pulls them in, `keep` leaves them
/// where they are, `mark` keeps them and says so in an attribute.
enum class Outliers : std::uint8_t { automatic, off, move, keep, mark };

inline constexpr int kAutomatic = 0;       ///< for whole numbers: chosen from the data
inline constexpr int kMaxNeighbors = 512;  ///< the longest neighbour list
inline constexpr int kMaxWidening = 64;    ///< the most neighbours that widen a ball

/// What to do. Defaults come from the data, so `Params{}` is a sound run on any cloud.
struct Params {
  // neighbours: the k nearest, all within `radius`, or the k nearest within `radius`.
  // Only k given: k nearest. Only radius given: all within it, without a limit. Neither: chosen from the data.
  int k = kAutomatic;
  Length radius;
  int widening = kAutomatic;  ///< without k: squared radii grow by the squared distance to so many nearest
  bool constraint = false;    ///< a point joins N only if d(q, N) < rho + delta; needs a list, so k
  Length rho;
  Length delta;
  // normals, paper eq. 3-5
  bool normal_weights = true;  ///< false: equal weights (Hoppe 1992)
  Length normal_sigma;
  NormalFilter normal_filter = NormalFilter::automatic;
  int normal_angle = kAutomatic;  ///< with normal_filter on, degrees
  int flat_radius = kAutomatic;   ///< with normal_filter on and balls: those of flat places, percent of their radius
  // fairing, paper eq. 1, 2, 6
  Method method = Method::bilateral;
  Length closeness_sigma;
  Length similarity_sigma;
  AreaWeight area_weight = AreaWeight::none;
  Planes planes = Planes::automatic;
  int facing_angle = kAutomatic;  ///< with planes both: weight by the normals' agreement, degrees
  int step = kAutomatic;          ///< percent of the displacement that is made
  int passes = kAutomatic;
  // points off the surface
  Outliers outliers = Outliers::automatic;
  Length outlier_distance;
  Length outlier_radius;
  Length displacement_limit;

  friend bool operator==(const Params&, const Params&) = default;
};

/// The paper: k = 8, one pass, the constrained neighbourhood, squared area weight, nothing that it does not know;
/// lengths from the data.
Params paper_preset();

/// A pointer to the field that a row of the table describes.
using ParamField = std::variant<int Params::*, bool Params::*, Length Params::*, Method Params::*, AreaWeight Params::*,
                                NormalFilter Params::*, Planes Params::*, Outliers Params::*>;

/// One row of the table. `name` is the field's name; a flag writes it with '-' for '_'.
struct ParamInfo {
  std::string_view name;
  Stage stage;  ///< the first stage that reads it
  ParamField field;
  double min, max;          ///< range of a number, in the unit given; 0, 0 for words
  bool automatic;           ///< whether "auto" is allowed
  std::string_view values;  ///< the words allowed, separated by '|'; empty for numbers
  std::string_view help;    ///< one line
};

inline constexpr std::array kParams = {
    ParamInfo{"k", Stage::neighbors, &Params::k, 1, kMaxNeighbors, true, "",
              "nearest neighbours of a point, itself not counted"},
    ParamInfo{"radius", Stage::neighbors, &Params::radius, 0, 1e30, true, "",
              "neighbours lie within this distance; without --k there is no limit on their number"},
    ParamInfo{"widening", Stage::neighbors, &Params::widening, 1, kMaxWidening, true, "",
              "without --k: widens each point's radius by its distance to so many nearest (squares add), so that it "
              "follows the density"},
    ParamInfo{"constraint", Stage::neighbors, &Params::constraint, 0, 0, false, "on|off",
              "grow the neighbourhood without jumping a gap of rho + delta, so that it does not cross sharp features"},
    ParamInfo{"rho", Stage::neighbors, &Params::rho, 0, 1e30, true, "",
              "with --constraint: the largest gap of a sound sampling"},
    ParamInfo{"delta", Stage::neighbors, &Params::delta, 0, 1e30, true, "",
              "with --constraint: what noise adds to a gap"},
    ParamInfo{"normal_weights", Stage::normals, &Params::normal_weights, 0, 0, false, "on|off",
              "Gaussian weights in the normals; off: equal weights (Hoppe)"},
    ParamInfo{"normal_sigma", Stage::normals, &Params::normal_sigma, 0, 1e30, true, "",
              "width of the normals' Gaussian"},
    ParamInfo{"normal_filter", Stage::normals, &Params::normal_filter, 0, 0, true, "off|on|mollify",
              "on: two rounds of bilateral filtering of the normals, which keeps edges; mollify: one Gaussian mean"},
    ParamInfo{"normal_angle", Stage::normals, &Params::normal_angle, 1, 90, true, "",
              "with the normal filter: normals that differ by more than so many degrees do not mix"},
    ParamInfo{"flat_radius", Stage::normals, &Params::flat_radius, 100, 200, true, "",
              "with the normal filter, without --k: percent of its radius that a ball has for the step of method "
              "bilateral where the surface is flat; 100: as elsewhere"},
    ParamInfo{"method", Stage::fairing, &Params::method, 0, 0, false,
              "bilateral|laplacian|taubin|hc-laplacian|mls|wiener|mollified",
              "how a point moves; bilateral keeps edges best, see docs/methods.md"},
    ParamInfo{"closeness_sigma", Stage::fairing, &Params::closeness_sigma, 0, 1e30, true, "",
              "width of the Gaussian over distance"},
    ParamInfo{"similarity_sigma", Stage::fairing, &Params::similarity_sigma, 0, 1e30, true, "",
              "width of the Gaussian over height above the tangent plane; smaller keeps more; with method wiener: the "
              "standard deviation of the noise"},
    ParamInfo{"area_weight", Stage::fairing, &Params::area_weight, 0, 0, false, "none|length|squared",
              "weight of a neighbour by the area it stands for: mean distance to its 5 nearest, squared, plain, or 1"},
    ParamInfo{"planes", Stage::fairing, &Params::planes, 0, 0, true, "own|both",
              "with method bilateral: planes that offsets are measured to: the point's own (the paper), or its own and "
              "its neighbours' alike"},
    ParamInfo{"facing_angle", Stage::fairing, &Params::facing_angle, 1, 90, true, "",
              "with planes both: neighbours whose normals differ by more than so many degrees hardly count"},
    ParamInfo{"step", Stage::fairing, &Params::step, 1, 200, true, "",
              "percent of the displacement that each pass makes; with taubin: lambda"},
    ParamInfo{"outliers", Stage::fairing, &Params::outliers, 0, 0, true, "off|move|keep|mark",
              "points off the surface: do not look for them, pull them in, keep them, or keep and mark them (attribute "
              "'outlier')"},
    ParamInfo{"outlier_distance", Stage::fairing, &Params::outlier_distance, 0, 1e30, true, "",
              "an outlier is a point with fewer than a tenth of its neighbours this close to its plane, or that would "
              "move farther; auto: 6 times the noise, at least half a spacing"},
    ParamInfo{"outlier_radius", Stage::fairing, &Params::outlier_radius, 0, 1e30, true, "",
              "without --k: where a ball is wider than this, an outlier is a point with fewer than seven tenths of its "
              "neighbours that close to its plane; auto: 6 times the radius of a typical ball"},
    ParamInfo{"passes", Stage::passes, &Params::passes, 1, 100, true, "",
              "how often the whole is repeated, neighbours searched again"},
    ParamInfo{
        "displacement_limit", Stage::passes, &Params::displacement_limit, 0, 1e30, true, "",
        "with outliers kept or marked no point moves farther, all passes together, and what would moves the less; "
        "auto: 4 times the noise, down to 1.5 times where it is far below the spacing"},
};

/// The row called `name` ('-' and '_' alike), or null.
const ParamInfo* find_param(std::string_view name);

/// Reads a value as the command line writes it ("8", "auto", "0.02", "0.5%", "2s", "on", "squared") into its field.
/// Throws ErrorKind::usage with name, value and range.
void set_param(Params& params, const ParamInfo& info, std::string_view text);

/// The value as `set_param` reads it; numbers in the shortest form that reads back the same.
std::string param_text(const Params& params, const ParamInfo& info);

/// Whether the method moves each point along its own normal only; a point without one then keeps its place.
constexpr bool moves_along_normal(Method method) {
  return method == Method::bilateral || method == Method::mls || method == Method::wiener;
}

/// Throws ErrorKind::usage if a value is out of its range or two contradict each other.
void check_params(const Params& params);

}  // namespace pointfair
