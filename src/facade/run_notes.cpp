// SPDX-License-Identifier: Apache-2.0
#include "pointfair/run_notes.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "io/source.hpp"
#include "platform/path_text.hpp"

namespace pointfair {
namespace {

// What a cloud and a run on it look like, lengths in file units; 0: unknown.
struct Look {
  double spacing = 0, noise = 0, diagonal = 0, float_step = 0, stored_step = 0, coordinate_step = 0;  // of the input
  bool is_noise_known = true;
  bool is_noise_given = false;
  bool pulls_outliers = false;
  Displacement moved;
  std::uint64_t finite = 0, without_surface = 0;  // points
  bool is_shared = false;                         // the noise, in neighbourhoods that the run chose
  bool is_of_lines = false;                       // the same
  std::uint64_t copies = 0;                       // points
  std::optional<double> metres_per_unit{};        // to tell lengths with their unit
};

std::string written(double value, std::chars_format format, int digits) {
  char text[512];  // the longest is a double without exponent
  return {text, std::to_chars(text, text + sizeof text, value, format, digits).ptr};
}

std::string told(double length, const Look& look, int digits = 4) {
  return length_text(length, look.metres_per_unit, digits);
}

std::string whole(double value) { return written(value, std::chars_format::fixed, 0); }

void add_coarse_floats(const Look& look, std::vector<std::string>& notes) {
  constexpr double kFewest = 3;  // steps in the noise; rounding then adds less than .5 % to it
  if (!(look.noise > 0) || !(kFewest * look.float_step > look.noise)) return;
  notes.push_back("coordinates far from the middle of the cloud are computed in steps of " +
                  told(look.float_step, look) + ", coarse against the noise of " + told(look.noise, look) +
                  "; split so wide a cloud");
}

// Of a step between coordinates that were written: what is finer is neither noise that a run removes nor shape.
bool is_coarse(double step, const Look& look) {
  constexpr double kTooFine = 0.01;  // spacings; a run takes less noise for shape
  return look.is_noise_known && step > std::max(look.noise, kTooFine * look.spacing);
}

void add_stored_floats(const Look& look, std::vector<std::string>& notes) {
  if (!is_coarse(look.stored_step, look)) return;
  notes.push_back("coordinates are stored as 32-bit floats, which lie " + told(look.stored_step, look) +
                  " apart so far from 0, coarse against the noise of " + told(look.noise, look) +
                  ": what is finer was lost when they were written; write doubles there, or coordinates near 0");
}

// That floats are so coarse was said with the steps of floats.
void add_rounded(const Look& look, std::vector<std::string>& notes) {
  if (is_coarse(look.stored_step, look) || !is_coarse(look.coordinate_step, look)) return;
  notes.push_back("coordinates were rounded to steps of up to " + told(look.coordinate_step, look) +
                  ", coarse against the noise of " + told(look.noise, look) +
                  ": noise and shape that are finer than the steps do not show");
}

constexpr double kFewPoints = 0.003;  // apart, in diagonals: a surface of some 100,000 points

void add_sparse(const Look& look, std::vector<std::string>& notes) {
  constexpr double kFarApart = 100;  // spacings in the noise; below a seventieth, run removes hardly any
  const bool is_sparse = look.diagonal > 0 && look.spacing > kFewPoints * look.diagonal;
  if (!is_sparse || !(look.noise > 0) || look.spacing <= kFarApart * look.noise) return;
  notes.push_back("points are " + told(look.spacing, look) + " apart, " + whole(look.spacing / look.noise) +
                  " times the noise of a typical place, " + told(look.noise, look, 2) +
                  ": where they are so far apart, noise and shape look the same, and hardly any noise is removed; " +
                  (look.is_noise_given ? "a larger --noise removes more" : "--noise gives the noise of a data sheet"));
}

void add_large(const Look& look, std::vector<std::string>& notes) {
  constexpr double kLarge = 0.02;  // of the diagonal; noise that anyone measured is a tenth of that
  const double large = kLarge * look.diagonal;
  const bool noise_is = look.noise > large, moves_are = look.moved.p95 > large;
  if (!(look.diagonal > 0) || (!noise_is && !moves_are)) return;
  std::string note = noise_is ? "the noise of " + told(look.noise, look) : "";
  if (moves_are) note += (noise_is ? " and moves of up to " : "moves of up to ") + told(look.moved.max, look);
  note += (moves_are ? " are" : " is") + (" large against the cloud, whose diagonal is " + told(look.diagonal, look));
  if (!noise_is && look.pulls_outliers)
    note += ": --outliers move pulls outliers in from so far; --outliers keep leaves them where they are";
  else if (look.spacing > kFewPoints * look.diagonal)
    note += ": its points, " + told(look.spacing, look) + " apart, may be too few to show a surface";
  notes.push_back(note + "; compare before and after");
}

void add_long_wave(const Look& look, std::vector<std::string>& notes) {
  if (!look.is_shared) return;
  notes.push_back(
      "the noise looks long-wave: neighbouring points share it, or rows or copies of points repeat it; of such noise, "
      "averaging removes a part only: measure a flat place before and after");
}

void add_lines(const Look& look, std::vector<std::string>& notes) {
  constexpr double kLittle = 0.5;  // of the noise; independent noise is removed by moves as large as the noise
  if (!look.is_of_lines || !(look.moved.rms < kLittle * look.noise)) return;
  notes.push_back("at most places the nearest " + std::to_string(kMaxMinNeighbors) +
                  " points lie along one line, as in rows far apart: a neighbourhood does not reach the next row, and "
                  "most of the noise is left; --method mls with a --radius beyond the next row removes more");
}

void add_copies(const Look& look, std::vector<std::string>& notes) {
  if (look.copies == 0) return;
  notes.push_back(std::to_string(look.copies) + (look.copies == 1 ? " point repeats" : " points repeat") +
                  " another one, exactly or nearly: each place counted once, and they got its result");
}

void add_no_surface(const Look& look, std::vector<std::string>& notes) {
  constexpr double kMuch = 0.05;  // of the points
  if (double(look.without_surface) <= kMuch * double(look.finite)) return;
  const std::string share =
      whole(100 * double(std::min(look.without_surface, look.finite)) / double(look.finite)) + " %";
  notes.push_back(share +
                  " of the points show no surface and were not moved, as crowns, wires, clutter or outliers; if a "
                  "surface is there, --noise with an attribute gives the noise of each point");
}

void add_far_sensors(std::span<const Position> sensors, const Position& min, const Position& max, double diagonal,
                     std::vector<std::string>& notes) {
  constexpr double kFar = 100;  // diagonals; a crop of a flight has some dozens
  if (!(diagonal > 0)) return;
  double farthest = 0;
  for (const Position& place : sensors) {
    double squares = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double outside = std::max({0.0, min[axis] - place[axis], place[axis] - max[axis]});
      squares += outside * outside;
    }
    if (std::isfinite(squares)) farthest = std::max(farthest, std::sqrt(squares));
  }
  if (farthest <= kFar * diagonal) return;
  notes.push_back("the sensor stood " + whole(farthest / diagonal) +
                  " diagonals outside the bounds of the cloud, so its place may be in another unit or coordinate "
                  "system; --viewpoint x,y,z gives another, --viewpoint none gives none");
}

// Points that are outliers because of where the sensor seems to have stood.
void add_found_sensor(const std::optional<Position>& place, std::uint64_t mixed_pixels, double diagonal,
                      std::vector<std::string>& notes) {
  if (!place || mixed_pixels == 0 || !(diagonal > 0)) return;
  int decimals = 0;  // it is known to some percent
  for (double hundredth = diagonal / 100; hundredth < 1 && decimals < 12; hundredth *= 10) ++decimals;
  const auto text = [&](std::size_t axis) { return written((*place)[axis], std::chars_format::fixed, decimals); };
  notes.push_back("the distances between points show a sensor near " + text(0) + "," + text(1) + "," + text(2) +
                  ", which tells points between two surfaces (mixed pixels); --viewpoint x,y,z gives its place, "
                  "--viewpoint none gives none");
}

// Of points among which there is nothing to see, so that all else would be said of nothing. Whether it was so.
bool add_nothing_to_see(const Look& look, std::vector<std::string>& notes) {
  constexpr std::uint64_t kFew = 10;
  const bool moved_none = look.without_surface >= look.finite;
  if (!moved_none) return false;
  if (look.finite == 0) {
    notes.push_back("there is no finite point to denoise, so none moved");
  } else if (look.finite < kFew) {
    notes.push_back(std::to_string(look.finite) + (look.finite == 1 ? " point is" : " points are") +
                    " too few to show a surface, so none moved");
  } else if (look.diagonal == 0 && look.spacing == 0) {
    notes.push_back("all points lie at one place, so there is no surface and none moved");
  } else {
    return false;
  }
  return true;
}

std::vector<std::string> notes_on(const Look& look) {
  std::vector<std::string> notes;
  if (add_nothing_to_see(look, notes)) return notes;
  add_coarse_floats(look, notes);
  add_stored_floats(look, notes);
  add_rounded(look, notes);
  add_sparse(look, notes);
  add_large(look, notes);
  add_long_wave(look, notes);
  add_lines(look, notes);
  add_copies(look, notes);
  add_no_surface(look, notes);
  return notes;
}

// Points that kept their place for want of a surface. `share`: of the finite points, where the cloud shows none.
std::uint64_t count_without_surface(const UnmovedCounts& unmoved, double share, std::uint64_t finite) {
  return unmoved.too_few_neighbors + unmoved.no_normal + unmoved.outliers + std::uint64_t(share * double(finite));
}

template <class AnyReport>
std::uint64_t mixed_pixels_of(const AnyReport& report) {
  return report.unmoved.outliers_by_reason.mixed_pixels + report.pulled.mixed_pixels;
}

bool is_noise_given(const Params& asked, const Params& used) {
  return !asked.noise.is_automatic() && used.noise.unit == Length::Unit::file;
}

// Of a typical place, as the run took it.
double noise_of(const Params& asked, const Params& used, double estimated) {
  return is_noise_given(asked, used) ? used.noise.value : estimated;
}

// A user who gives the neighbourhoods knows what they are for.
bool tells_of_shared(const Params& asked, bool is_shared) { return asked.min_neighbors == kAutomatic && is_shared; }
bool tells_of_lines(const Params& asked, bool is_of_lines) {
  return asked.min_neighbors == kAutomatic && asked.radius.is_automatic() && asked.k == kAutomatic && is_of_lines;
}

void add_mixed_systems(std::span<const NamedSystem> systems, std::vector<std::string>& notes) {
  if (systems.size() < 2) return;
  std::string note = "the inputs have " + std::to_string(systems.size()) +
                     " coordinate systems, and were denoised as if these were one: " + systems[0].name;
  for (const NamedSystem& system : systems.subspan(1, std::min<std::size_t>(systems.size() - 1, 3)))
    note += "; " + system.name + " in " + platform::text_of(system.file.filename()) +
            (system.files > 1 ? " and " + std::to_string(system.files - 1) + " more" : "");
  notes.push_back(note);
}

// In the coordinates of the file.
std::pair<Position, Position> bounds_of(const Position& origin, const Estimates& estimates) {
  Position min = origin, max = origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    min[axis] += estimates.min[axis];
    max[axis] += estimates.max[axis];
  }
  return {min, max};
}

}  // namespace

double stored_float_step(const Position& min, const Position& max) {
  float farthest = 0;
  for (const Position& corner : {min, max})
    for (const double value : corner) farthest = std::max(farthest, static_cast<float>(std::abs(value)));
  if (farthest == 0) return 0;  // of no finite point, or of 0, which floats hold
  return double{std::nextafter(farthest, std::numeric_limits<float>::infinity())} - double{farthest};
}

double stored_float_step(const Cloud& cloud, const Estimates& estimates) {
  if (!cloud.source || !cloud.source->stores_floats()) return 0;
  const auto [min, max] = bounds_of(cloud.origin, estimates);
  return stored_float_step(min, max);
}

std::vector<std::string> notes_on_cloud(const Estimates& estimates, double stored_step) {
  std::vector<std::string> notes;
  Look look;
  look.spacing = estimates.spacing;
  look.noise = estimates.noise;
  look.float_step = estimates.float_step;
  look.stored_step = stored_step;
  look.coordinate_step = estimates.coordinate_step;
  add_coarse_floats(look, notes);
  add_stored_floats(look, notes);
  add_rounded(look, notes);
  return notes;
}

std::vector<std::string> notes_on_run(const Params& asked, const Estimates& estimates, const Report& report,
                                      const Displacement& moved, double stored_step,
                                      std::optional<double> metres_per_unit) {
  std::vector<std::string> notes =
      notes_on({.spacing = estimates.spacing,
                .noise = noise_of(asked, report.params, estimates.noise),
                .diagonal = estimates.diagonal,
                .float_step = estimates.float_step,
                .stored_step = stored_step,
                .coordinate_step = estimates.coordinate_step,
                .is_noise_given = is_noise_given(asked, report.params),
                .pulls_outliers = asked.outliers == Outliers::move,
                .moved = moved,
                .finite = estimates.finite,
                .without_surface = count_without_surface(report.unmoved, report.without_surface, estimates.finite),
                .is_shared = tells_of_shared(asked, estimates.noise_is_shared),
                .is_of_lines = tells_of_lines(asked, estimates.is_of_lines),
                .copies = report.copies,
                .metres_per_unit = metres_per_unit});
  add_found_sensor(report.found_sensor, mixed_pixels_of(report), estimates.diagonal, notes);
  return notes;
}

std::string length_text(double length, std::optional<double> metres_per_unit, int digits) {
  const auto rounded = [&](double value) { return written(value, std::chars_format::general, digits); };
  if (!metres_per_unit) return rounded(length);
  const double metres = length * *metres_per_unit;
  return metres < 1 ? rounded(1000 * metres) + " mm" : rounded(metres) + " m";
}

std::vector<std::string> notes_on_viewpoints(std::span<const Position> viewpoints, const Position& origin,
                                             const Estimates& estimates) {
  const auto [min, max] = bounds_of(origin, estimates);
  std::vector<std::string> notes;
  add_far_sensors(viewpoints, min, max, estimates.diagonal, notes);
  return notes;
}

std::vector<std::string> notes_on_run(const TiledReport& report) {
  const std::uint64_t finite = report.points - std::min(report.points, report.unmoved.non_finite + report.ignored);
  std::vector<std::string> notes =
      notes_on({.spacing = report.spacing.value_or(0),
                .noise = noise_of(report.asked, report.params, report.noise.value_or(0)),
                .diagonal = report.diagonal,
                .float_step = report.float_step,
                .stored_step = report.stored_float_step,
                .coordinate_step = report.coordinate_step,
                .is_noise_known = report.noise || is_noise_given(report.asked, report.params),
                .is_noise_given = is_noise_given(report.asked, report.params),
                .pulls_outliers = report.asked.outliers == Outliers::move,
                .moved = report.displacement,
                .finite = finite,
                .without_surface = count_without_surface(report.unmoved, report.without_surface, finite),
                .is_shared = tells_of_shared(report.asked, report.noise_is_shared),
                .is_of_lines = tells_of_lines(report.asked, report.is_of_lines),
                .copies = report.copies});
  add_mixed_systems(report.systems, notes);
  add_found_sensor(report.found_sensor, mixed_pixels_of(report), report.diagonal, notes);
  if (report.sensor) add_far_sensors({&*report.sensor, 1}, report.min, report.max, report.diagonal, notes);
  return notes;
}

}  // namespace pointfair
