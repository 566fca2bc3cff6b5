// SPDX-License-Identifier: Apache-2.0
// What a pipeline reports: estimates of the loaded cloud, and what a run did.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pointfair/device.hpp"
#include "pointfair/params.hpp"

namespace pointfair {

/// Measured on the loaded cloud, once after `load`. Lengths in file units.
struct Estimates {
  std::array<double, 3> min{}, max{};  ///< bounds of the finite points, relative to the cloud's origin
  double diagonal = 0;                 ///< of those bounds
  double spacing = 0;                  ///< mean distance to the 6 nearest other points
  double noise = 0;                    ///< estimated standard deviation of the noise along the normal
  std::uint64_t points = 0;            ///< number of all points
  std::uint64_t finite = 0;            ///< number of points without NaN or infinity
  /// The noise at the quietest, the typical and the loudest places: the 5, 50 and 95 % quantiles of the samples.
  std::array<double, 3> noise_quantiles{};
  /// The largest step between coordinates, which are 32-bit floats relative to the cloud's origin: 1 mm at 16 km. 0 if
  /// that origin is 0, so that no digit is lost.
  double float_step = 0;
  /// Share of the cloud where no surface shows, as in crowns or clutter beside one; 1 where none shows anywhere, as of
  /// wires. What of it kept its place: Report::without_surface.
  double without_surface = 0;
  /// Neighbouring points share their noise (it is long-wave), or rows or copies of points repeat it: averaging removes
  /// a part only.
  bool noise_is_shared = false;
  /// At most places the nearest points, as many as a neighbourhood holds, lie along one line, as in rows far apart.
  bool is_of_lines = false;
  /// The coarsest step of coordinates that were rounded along two axes at least, so coarsely that points lie over each
  /// other; 0: none shows.
  double coordinate_step = 0;
};

/// How many outliers a run found, by reason (docs/how-it-works.md, "Outliers").
struct OutlierCounts {
  std::uint64_t isolated = 0;      ///< too few neighbours within reach
  std::uint64_t off_surface = 0;   ///< farther than the outlier distance from the surface that the neighbours show
  std::uint64_t mixed_pixels = 0;  ///< between two surfaces along the ray; only where the sensor's place is known
                                   ///< or found
  std::uint64_t total() const { return isolated + off_surface + mixed_pixels; }
  friend bool operator==(const OutlierCounts&, const OutlierCounts&) = default;
};

/// How many points kept their place, by reason. Of neighbours and normals, the first iteration tells.
struct UnmovedCounts {
  std::uint64_t non_finite = 0;         ///< a coordinate is NaN or infinite, or its square would overflow
  std::uint64_t too_few_neighbors = 0;  ///< fewer than 3 neighbours
  std::uint64_t no_normal = 0;          ///< neighbours identical or on a line
  std::uint64_t outliers = 0;           ///< off the surface (Params::outliers)
  OutlierCounts outliers_by_reason{};   ///< of those
  std::uint64_t boundary = 0;           ///< on the border of a mesh (Params::keep_boundary)
  std::uint64_t total() const { return non_finite + too_few_neighbors + no_normal + outliers + boundary; }
  friend bool operator==(const UnmovedCounts&, const UnmovedCounts&) = default;
};

/// How long a stage took.
struct StageTime {
  std::string name;
  double milliseconds = 0;
};

/// The mesh that a run followed (Connectivity::mesh), as it was found.
struct MeshReport {
  std::uint64_t faces = 0;               ///< all that were given
  std::uint64_t vertices = 0;            ///< places of points that faces have; points at one place are one vertex
  std::uint64_t degenerate_faces = 0;    ///< with fewer than 3 different places; they make no edges
  std::uint64_t boundary_edges = 0;      ///< with one face
  std::uint64_t non_manifold_edges = 0;  ///< with more than two faces
  std::uint64_t boundary_vertices = 0;   ///< of boundary edges
  std::uint64_t isolated_points = 0;     ///< of no face; they have no neighbours and keep their place
  /// Faces whose normal is more than 90 degrees off their filtered normal (docs/methods.md), of input and result.
  std::uint64_t folded_before = 0, folded_after = 0;
};

/// The solution of the linear systems of Method::implicit.
struct SolverReport {
  std::uint64_t iterations = 0;  ///< of conjugate gradients, over all iterations of the run
  double residual = 0;           ///< the largest that was left, relative to the right-hand side
};

/// What a run did.
struct Report {
  DeviceInfo device;
  std::uint64_t points = 0;
  /// As used in a typical place: lengths in file units, and `auto` only for values that the run did not read. What was
  /// `auto` followed the noise from place to place, so to repeat the run, give it the same parameters and not these.
  Params params;
  UnmovedCounts unmoved;
  std::uint64_t short_neighborhoods = 0;  ///< points whose constrained neighbourhood has fewer than k neighbours
  /// Points that repeat another one, exactly or nearly, if eight of 500 samples do: they count for nothing
  /// and got the result of that one, which brings them together. 0 where no parameter follows the noise.
  std::uint64_t copies = 0;
  /// Share of the finite points that kept their place because no surface shows there: Estimates::without_surface where
  /// displacements followed the noise from place to place, else 0.
  double without_surface = 0;
  /// The stages that ran, in order; further iterations add to the same names. Stages on a card are timed by the card.
  /// If one kernel does normals and fairing there, its time is divided three to two, as two kernels would take it.
  /// `upload` to a card lasts until the caller may change the array again; the index begins before that.
  std::vector<StageTime> stages;
  MeshReport mesh;      ///< zeros without Connectivity::mesh
  SolverReport solver;  ///< zeros without Method::implicit
  /// Number of tiles that the cloud was cut into because it does not fit into the card's memory; 1: not cut. A cloud in
  /// tiles stays in host memory, and its stages are `cut`, `tiles` and `download`.
  std::uint64_t tiles = 1;
  double total_milliseconds = 0;                             ///< from array to array
  std::uint64_t peak_host_bytes = 0, peak_device_bytes = 0;  ///< of the pipeline, without the caller's arrays
  /// Where the sensor stood by the distances between points (docs/how-it-works.md, "Where the sensor stood"), in the
  /// coordinates of the loaded cloud's file, or of its points where it has none. Nothing where no place was looked for,
  /// found or taken, as where one was given.
  std::optional<std::array<double, 3>> found_sensor{};
  OutlierCounts pulled{};  ///< outliers that Outliers::move pulled in; the first iteration tells
};

}  // namespace pointfair
