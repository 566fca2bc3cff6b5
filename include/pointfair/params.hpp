// SPDX-License-Identifier: Apache-2.0
// Every parameter of a run, and the one table that describes each of them. Flags, sliders, documents, range checks and
// the cache of stages all read `kParams`.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "pointfair/export.hpp"

namespace pointfair {

/// A length in one of six units. Plain numbers convert: `params.radius = 0.02`.
struct Length {
  enum class Unit : std::uint8_t {
    automatic,  ///< chosen from the data
    file,       ///< the unit of the cloud's coordinates
    percent,    ///< percent of the bounding-box diagonal; "0.5%" is 0.5
    spacing,    ///< multiple of the mean spacing of the points; "2s" is 2
    radius,     ///< multiple of the radius of each point's neighbourhood; "0.6r" is 0.6; sigmas over distance only
    metre,      ///< metres, where the cloud's file says its unit; "5mm" is 0.005
  };
  double value = 0;
  Unit unit = Unit::automatic;

  constexpr Length() = default;
  constexpr Length(double in_file_units) : value(in_file_units), unit(Unit::file) {}
  constexpr Length(double amount, Unit its_unit) : value(amount), unit(its_unit) {}
  constexpr bool is_automatic() const { return unit == Unit::automatic; }
  friend constexpr bool operator==(const Length&, const Length&) = default;
};

/// Stages in their order; each reads the results of the one before. `iterations` repeats the whole chain.
enum class Stage : std::uint8_t { index, neighbors, normals, fairing, iterations };

/// How a point moves; docs/methods.md has a section on each.
enum class Method : std::uint8_t {
  bilateral,
  laplacian,
  taubin,
  hc_laplacian,
  mls,
  wiener,
  mollified,
  learned,
  implicit,
  fleishman,
  jones
};
/// Of method implicit: the weight of each edge. uniform: 1. scale: 1 / its length. curvature: cotangents on a mesh, a
/// Gaussian of the length on a cloud. automatic: curvature.
enum class ImplicitWeights : std::uint8_t { automatic, uniform, scale, curvature };
/// The weight of a neighbour by the area that it stands for, paper eq. 6.
enum class AreaWeight : std::uint8_t { none, length, squared };
/// on: two rounds of a bilateral filter, which keeps edges; mollify: one Gaussian mean, which does not (Jones 2003).
enum class NormalFilter : std::uint8_t { automatic, off, on, mollify };
/// Which heights of the neighbours method bilateral averages. point: over the plane of the point itself (paper eq. 2).
/// symmetric: the mean of the heights over the point's plane and over the neighbour's.
enum class Offset : std::uint8_t { automatic, point, symmetric };
/// What happens to outliers, points off the surface. off: they are not looked for. move: they are pulled in. keep: they
/// stay where they are. mark: as keep, and the attribute "outlier" tells which they are.
enum class Outliers : std::uint8_t { automatic, off, move, keep, mark };

/// What makes points neighbours. points: their distance alone. mesh: the edges of the faces, so that near sheets stay
/// apart. automatic is points.
enum class Connectivity : std::uint8_t { automatic, points, mesh };

inline constexpr int kAutomatic = 0;         ///< for whole numbers: chosen from the data
inline constexpr int kMaxNeighbors = 512;    ///< the largest k
inline constexpr int kMaxMinNeighbors = 64;  ///< the largest min_neighbors
inline constexpr int kMaxRings = 8;          ///< the largest number of rings

/// Which way a point moves: along its normal, or along the ray on which the sensor saw it, so that it keeps its pixel.
enum class Along : std::uint8_t { normal, ray };

/// What to do. Defaults come from the data, so `Params{}` suits any cloud. kParams describes each field.
struct Params {
  Length noise{};  ///< standard deviation along the normal; all automatic values below follow from it
  // Neighbours. Only k given: the k nearest. Both: the k nearest within the radius. Else all within a radius that grows
  // where points are sparse, from the given one or from one that follows the noise.
  int k = kAutomatic;
  Length radius{};
  /// without k: radius_i^2 = radius^2 + (distance to the n-th nearest)^2; 1: the radius alone
  int min_neighbors = kAutomatic;
  bool constraint = false;  ///< a point joins N only if d(q, N) < rho + delta; with radius also needs k
  Length rho{};
  Length delta{};
  Connectivity connectivity = Connectivity::automatic;  ///< mesh: needs faces (Pipeline::set_faces), and takes no k
  int rings = kAutomatic;     ///< with mesh: neighbours are so many edges away; automatic: by method (docs/methods.md)
  bool keep_boundary = true;  ///< with mesh: vertices of edges that have one face only stay where they are
  // Normals, paper eq. 3-5.
  Length normal_sigma{};
  NormalFilter normal_filter = NormalFilter::automatic;
  int crease_angle = kAutomatic;       ///< with normal_filter on: degrees beyond which normals do not mix
  std::optional<double> flat_scale{};  ///< with normal_filter on and without k: the factor on the radius in flat places
  // Fairing, paper eq. 1, 2, 6.
  Method method = Method::bilateral;
  Along along = Along::normal;  ///< ray: needs the place of the sensor, and a method that moves along the normal
  Length closeness_sigma{};
  Length similarity_sigma{};
  AreaWeight area_weight = AreaWeight::none;
  Offset offset = Offset::automatic;
  std::optional<double> relaxation{};  ///< the factor on each displacement
  ImplicitWeights implicit_weights = ImplicitWeights::automatic;
  std::optional<double> implicit_lambda{};  ///< with method implicit: how far a step smooths, in squared edge lengths
  // Points off the surface.
  Outliers outliers = Outliers::automatic;
  Length outlier_distance{};
  Length outlier_radius{};
  // The whole chain.
  int iterations = kAutomatic;
  Length displacement_limit{};
  std::optional<double> tangential{};  ///< with mesh: share of the way to the middle of the ring, along the surface

  friend bool operator==(const Params&, const Params&) = default;
};

/// The paper: k = 8, one iteration, the constrained neighbourhood, squared area weight, and nothing that the paper does
/// not have. Lengths come from the data.
POINTFAIR_EXPORT Params paper_preset();

/// A pointer to the field that a row of the table describes.
using ParamField = std::variant<int Params::*, bool Params::*, std::optional<double> Params::*, Length Params::*,
                                Method Params::*, AreaWeight Params::*, NormalFilter Params::*, Offset Params::*,
                                Outliers Params::*, Along Params::*, Connectivity Params::*, ImplicitWeights Params::*>;

/// One row of the table. `name` is the field's name; a flag writes it with '-' for '_'.
struct ParamInfo {
  std::string_view name;
  Stage stage;  ///< the first stage that reads it
  ParamField field;
  double min, max;          ///< range of a number, in the unit given; 0, 0 for words
  bool automatic;           ///< whether "auto" is allowed
  std::string_view values;  ///< the words allowed, separated by '|'; empty for numbers
  std::string_view help;    ///< one line
  bool expert = false;      ///< whether `--help` leaves it to `--help-all` and the viewer folds it away
  bool in_radii = false;    ///< whether a length may be a multiple of each point's radius, "0.6r"
};

inline constexpr std::array kParams = {
    ParamInfo{"noise", Stage::neighbors, &Params::noise, 0, 1e30, true, "",
              "standard deviation of the noise along the surface normal; all automatic values follow from it"},
    ParamInfo{"k", Stage::neighbors, &Params::k, 1, kMaxNeighbors, true, "",
              "number of nearest neighbours that count; auto: all within --radius"},
    ParamInfo{"radius", Stage::neighbors, &Params::radius, 0, 1e30, true, "",
              "distance within which neighbours count; auto: by noise, density and shape"},
    ParamInfo{"min_neighbors", Stage::neighbors, &Params::min_neighbors, 1, kMaxMinNeighbors, true, "",
              "without --k: radius_i^2 = radius^2 + (distance to the n-th nearest point)^2, which follows the density",
              true},
    ParamInfo{"constraint", Stage::neighbors, &Params::constraint, 0, 0, false, "on|off",
              "with --k: neighbourhoods do not cross gaps wider than rho + delta, so that thin parts stay apart"},
    ParamInfo{"rho", Stage::neighbors, &Params::rho, 0, 1e30, true, "",
              "with --constraint: the largest gap between neighbours on one surface", true},
    ParamInfo{"delta", Stage::neighbors, &Params::delta, 0, 1e30, true, "",
              "with --constraint: how much wider noise may make a gap; auto: 2.5 times the noise", true},
    ParamInfo{"connectivity", Stage::neighbors, &Params::connectivity, 0, 0, true, "points|mesh",
              "what makes points neighbours. points: their distance; mesh: the edges of the file's faces", true},
    ParamInfo{"rings", Stage::neighbors, &Params::rings, 1, kMaxRings, true, "",
              "with --connectivity mesh: how many edges away neighbours are; auto: 1 in laplacian, taubin, "
              "hc-laplacian and implicit, else all within --radius",
              true},
    ParamInfo{"normal_sigma", Stage::normals, &Params::normal_sigma, 0, 1e30, true, "",
              "sigma of the weights by distance in the normals", true, true},
    ParamInfo{"normal_filter", Stage::normals, &Params::normal_filter, 0, 0, true, "off|on|mollify",
              "filter the normals before points move. on: bilateral, keeps edges; mollify: Gaussian mean", true},
    ParamInfo{"crease_angle", Stage::normals, &Params::crease_angle, 1, 90, true, "",
              "with --normal-filter on: normals that differ by more degrees than this do not mix", true},
    ParamInfo{"flat_scale", Stage::normals, &Params::flat_scale, 1, 2, true, "",
              "with --normal-filter on and without --k: factor on the radius where the surface is flat", true},
    ParamInfo{"method", Stage::fairing, &Params::method, 0, 0, false,
              "bilateral|laplacian|taubin|hc-laplacian|mls|wiener|mollified|learned|implicit|fleishman|jones",
              "how points move; bilateral keeps edges best, learned refines its result by a net (docs/methods.md)"},
    ParamInfo{"along", Stage::fairing, &Params::along, 0, 0, false, "normal|ray",
              "direction in which points move. ray: towards the sensor or away from it, so that organised clouds keep "
              "their pixels; needs the place of the sensor"},
    ParamInfo{"keep_boundary", Stage::fairing, &Params::keep_boundary, 0, 0, false, "on|off",
              "with --connectivity mesh: vertices on the border of an open mesh stay where they are", true},
    ParamInfo{"closeness_sigma", Stage::fairing, &Params::closeness_sigma, 0, 1e30, true, "",
              "closeness (spatial) sigma: of the weights by distance", true, true},
    ParamInfo{"similarity_sigma", Stage::fairing, &Params::similarity_sigma, 0, 1e30, true, "",
              "similarity (range) sigma: of the weights by height above the tangent plane; smaller keeps more detail"},
    ParamInfo{
        "area_weight", Stage::fairing, &Params::area_weight, 0, 0, false, "none|length|squared",
        "weight by the area a neighbour stands for: mean distance to its 5 nearest points (length), or its square",
        true},
    ParamInfo{
        "offset", Stage::fairing, &Params::offset, 0, 0, true, "point|symmetric",
        "heights in method bilateral. point: over the point's own plane (the paper); symmetric: the mean of those "
        "over its plane and the neighbour's",
        true},
    ParamInfo{"relaxation", Stage::fairing, &Params::relaxation, 0, 2, true, "",
              "factor on each displacement; with --method taubin: lambda", true},
    ParamInfo{"implicit_weights", Stage::fairing, &Params::implicit_weights, 0, 0, true, "uniform|scale|curvature",
              "with --method implicit: weight of an edge. uniform: 1; scale: 1 / length; curvature: cotangents on a "
              "mesh, a Gaussian on a cloud",
              true},
    ParamInfo{"implicit_lambda", Stage::fairing, &Params::implicit_lambda, 0, 1e6, true, "",
              "with --method implicit: how far a step smooths, in squared mean edge lengths; auto: by the noise", true},
    ParamInfo{"outliers", Stage::fairing, &Params::outliers, 0, 0, true, "off|move|keep|mark",
              "points off the surface. off: do not look for them; move: pull them in; keep: leave them; mark: leave "
              "and mark"},
    ParamInfo{"outlier_distance", Stage::fairing, &Params::outlier_distance, 0, 1e30, true, "",
              "an outlier has few neighbours this close to its plane, or would move farther than this; auto: 6 times "
              "the noise",
              true},
    ParamInfo{"outlier_radius", Stage::fairing, &Params::outlier_radius, 0, 1e30, true, "",
              "without --k: a point with a larger radius is an outlier unless most neighbours lie near its plane; "
              "auto: 6 typical radii",
              true},
    ParamInfo{"iterations", Stage::iterations, &Params::iterations, 1, 100, true, "",
              "how often all stages run, each time on the moved points"},
    ParamInfo{"displacement_limit", Stage::iterations, &Params::displacement_limit, 0, 1e30, true, "",
              "soft bound on how far a point moves: d > limit becomes limit^2 / d; auto: 10 times the noise, "
              "without its levels 1.5 to 4 times",
              true},
    ParamInfo{"tangential", Stage::iterations, &Params::tangential, 0, 1, true, "",
              "with --connectivity mesh: how far vertices even out along the surface after the last iteration, which "
              "removes the noise along it and unfolds faces; 0: all stay where the method puts them",
              true},
};

/// The row called `name`, in which '-' and '_' are alike, or null if there is none.
POINTFAIR_EXPORT const ParamInfo* find_param(std::string_view name);

/// The flag of the parameter of that name: "--similarity-sigma".
POINTFAIR_EXPORT std::string flag_of(std::string_view name);

/// Sets a field from the text that the command line takes: "8", "auto", "0.02", "0.5%", "2s", "on", "squared". Throws
/// ErrorKind::usage with name, value and range.
POINTFAIR_EXPORT void set_param(Params& params, const ParamInfo& info, std::string_view text);

/// The text of a field, which set_param reads back as the same value.
POINTFAIR_EXPORT std::string param_text(const Params& params, const ParamInfo& info);

/// Whether the method moves each point along its normal only. A point without a normal then keeps its place.
constexpr bool moves_along_normal(Method method) {
  return method == Method::bilateral || method == Method::mls || method == Method::wiener ||
         method == Method::fleishman;
}

/// Whether the method is defined on the faces of a mesh alone, and so needs Connectivity::mesh.
constexpr bool is_of_faces(Method method) { return method == Method::fleishman || method == Method::jones; }

/// Whether the row says something only where neighbours follow the edges of faces (Params::connectivity).
constexpr bool is_of_meshes(const ParamInfo& info) {
  return info.name == "rings" || info.name == "keep_boundary" || info.name == "tangential";
}

/// Whether a run needs the whole cloud in the memory of one device: along the edges of faces, and where one system of
/// equations holds all points.
constexpr bool needs_whole_cloud(const Params& params) {
  return params.connectivity == Connectivity::mesh || params.method == Method::implicit;
}

/// Whether a run reads the faces themselves, and not only their edges: such a run computes on the CPU.
constexpr bool reads_faces(const Params& params) {
  return params.connectivity == Connectivity::mesh && (is_of_faces(params.method) || params.method == Method::implicit);
}

/// Throws ErrorKind::usage if a value is out of its range or if two contradict each other.
POINTFAIR_EXPORT void check_params(const Params& params);

/// `params` with lengths in metres turned into file units; `metres_per_unit` is what file_info says. Throws
/// ErrorKind::usage if there are such lengths and it says nothing.
POINTFAIR_EXPORT Params in_file_units(const Params& params, std::optional<double> metres_per_unit);

}  // namespace pointfair
