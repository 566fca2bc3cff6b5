// SPDX-License-Identifier: Apache-2.0
// What is said about a run beside the library's own report: as JSON, and as lines on standard error.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "pointfair/pointfair.hpp"
#include "report.hpp"
#include "statistics.hpp"

namespace pointfair::cli {

// What is said about a run beside the library's own report.
struct Findings {
  Params asked;                   // before anything was estimated
  bool is_copied = false;         // no point may move, so nothing was computed or measured
  Report report;                  // the library's own
  double spacing = 0, noise = 0;  // of the input
  std::string noise_attribute;    // that the noise comes from; empty: it is estimated
  std::array<double, 3> noise_quantiles{};
  double step = 0;                        // between the coordinates written, where these are integers
  double float_step = 0;                  // as in Estimates
  std::optional<double> metres_per_unit;  // where the file says so
  std::uint64_t ignored = 0;              // finite points left out by --ignore
  std::uint64_t held = 0;                 // others that the limits did not let move, and that are no outliers
  OutlierCounts removed;                  // that the file written does not have
  Statistics displacement;
  std::vector<std::string> notes;
  std::vector<std::string> page_notes;  // the first of them, where a page says lengths in mm or m
};

// Counts the points that the limits alone hold, and those that were left out of the run. `outliers`: of the run, if
// these are known.
void count_limited(const Cloud& cloud, const Limits& limits, std::span<const std::uint8_t> movable,
                   std::span<const std::uint8_t> outliers, Findings& findings);
// The estimates are of the points that were not ignored. `keeps_normals`: those in the file stay.
void find_out(bool keeps_normals, const WriteOptions& options, const Cloud& before, const Cloud& after,
              Pipeline& pipeline, std::stop_token stop, Findings& findings);
// What is not done in zones where the run was: normals that are written.
std::vector<std::string> notes_on_one_origin(const Report& report);
// Of a run at strength 0, whose points are written as they were.
void find_copied(const WriteOptions& options, const Cloud& cloud, const Pipeline& pipeline, Findings& findings);

// Whatever became of them.
inline std::uint64_t found_outliers(const Report& report) { return report.unmoved.outliers + report.pulled.total(); }

Json run_json(const Report& report, const Findings& findings);
void print_summary(const Report& report, const Findings& findings, bool with_details);

// What a line and a row of a table tell of a run, one of many.
struct Told {
  bool is_copied = false;  // as in Findings
  std::uint64_t points = 0, outliers = 0;
  std::optional<double> spacing, noise;  // of the input, where it was measured
  double moved_mean = 0, moved_max = 0, milliseconds = 0;
  std::optional<double> metres_per_unit;
  std::vector<std::string> notes;
  Json json;  // all of it
};

Told told_of(const Findings& findings);

}  // namespace pointfair::cli
