// SPDX-License-Identifier: Apache-2.0
// What a user should know of a result, in sentences for people: why it may not be what it seems. They are what the
// program prints as `note:` and the viewer shows; their wording may change with any version.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"
#include "pointfair/io.hpp"
#include "pointfair/positions.hpp"
#include "pointfair/report.hpp"
#include "pointfair/tiled_run.hpp"

namespace pointfair {

/// A length in file units with so many digits; where their length is known, as in FileInfo, in mm or m.
POINTFAIR_EXPORT std::string length_text(double length, std::optional<double> metres_per_unit, int digits = 4);

/// The largest step between 32-bit floats within these bounds. O(1).
POINTFAIR_EXPORT double stored_float_step(const Position& min, const Position& max);

/// The same within the bounds of a cloud whose file stores its coordinates as such floats; else 0. `estimates`: of that
/// cloud. O(1).
POINTFAIR_EXPORT double stored_float_step(const Cloud& cloud, const Estimates& estimates);

/// Of a cloud before a run: coordinates around one origin, as they are stored, or as they were rounded, whose steps are
/// coarse against the noise. `stored_step` as stored_float_step. Lengths are in file units. Empty where there is
/// nothing to say. O(1); never fails.
POINTFAIR_EXPORT std::vector<std::string> notes_on_cloud(const Estimates& estimates, double stored_step = 0);

/// Of a run in memory: the notes on its cloud; and that points are too sparse to tell noise from shape, that noise or
/// moves are large against the cloud, that the noise is long-wave, that rows of points are too far apart for
/// neighbourhoods, or that many points show no surface. `asked`: the parameters as they were given to Pipeline::run;
/// `estimates` and `report`: of that pipeline; `moved`: how far points moved in the end, with all limits; `stored_step`
/// as stored_float_step; `metres_per_unit`: as in FileInfo, to tell lengths in mm and m. Empty where there is nothing
/// to say. O(1); never fails.
POINTFAIR_EXPORT std::vector<std::string> notes_on_run(const Params& asked, const Estimates& estimates,
                                                       const Report& report, const Displacement& moved,
                                                       double stored_step = 0,
                                                       std::optional<double> metres_per_unit = {});

/// Of the places of sensors that a run took, in the coordinates of the file: one that lies more than a hundred
/// diagonals outside the bounds of the cloud, as where it is in another unit or another coordinate system. `origin`: of
/// the cloud that the estimates are of. O(number of places); never fails.
POINTFAIR_EXPORT std::vector<std::string> notes_on_viewpoints(std::span<const Position> viewpoints,
                                                              const Position& origin, const Estimates& estimates);

/// Of a run with automatic connectivity that moves points of a cloud with these faces: where it takes a mesh as a
/// cloud, because most points are corners, that the faces were not followed. `points`: of the cloud. O(points and
/// corners).
POINTFAIR_EXPORT std::vector<std::string> notes_on_faces(const Polygons& faces, std::size_t points);
/// The same of the faces of a cloud's file, which are not held in memory for it.
POINTFAIR_EXPORT std::vector<std::string> notes_on_faces(const Cloud& cloud);

/// Of a run on an organised cloud that was given no place of the sensor, and found none by distances: where the sensor
/// stood by the grid, or that neither the file nor its grid say it. Throws as file_info.
POINTFAIR_EXPORT std::vector<std::string> notes_on_grid(const Cloud& cloud);

/// The same of an image of points without a file, row by row: `viewpoint` as image_viewpoint gives it.
POINTFAIR_EXPORT std::vector<std::string> notes_on_grid(const std::optional<Position>& viewpoint);

/// Of a file whose heights have another unit than its X and Y: both, and what makes them one. Throws as file_info.
POINTFAIR_EXPORT std::vector<std::string> notes_on_units(const Cloud& cloud);

/// Of a file whose points moved and which keeps the normals that it had: that they are those from before, and what
/// renews them. `format`: of the file that is written; unset: that of the cloud's own. Throws as file_info.
POINTFAIR_EXPORT std::vector<std::string> notes_on_kept_normals(const Cloud& cloud, std::optional<Format> format);

/// Of an OBJ or PLY file `to` with the result of a cloud that was read from the file `from` of the same format: that
/// what it names (its libraries of materials; its pictures) lies beside `from` only. A path is "-", and `from` may be
/// empty, where there is none. Throws as file_info and texture.
POINTFAIR_EXPORT std::vector<std::string> notes_on_materials(const Cloud& cloud, const std::filesystem::path& from,
                                                             const std::filesystem::path& to,
                                                             std::optional<Format> format);

/// Of a LAS file whose header says that its waveforms are in a file of their own: that none lies beside it.
POINTFAIR_EXPORT std::vector<std::string> notes_on_waveforms(const Cloud& cloud);

/// The same as notes_on_run and notes_on_viewpoints, of a run in tiles.
POINTFAIR_EXPORT std::vector<std::string> notes_on_run(const TiledReport& report);

}  // namespace pointfair
