// SPDX-License-Identifier: Apache-2.0
// The JSON of --report. Keys are stable from the first release on: add, never rename.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pointfair/pointfair.hpp"
#include "statistics.hpp"

namespace pointfair::cli {

using Json = nlohmann::ordered_json;  // keys in the order in which they are written

Json device_json(const DeviceInfo& device);

/// Of resolved parameters: lengths as numbers in file units, null where there is none (a radius where only k counts).
Json params_json(const Params& params);
Json stages_json(const std::vector<StageTime>& stages);
Json statistics_json(const Statistics& statistics);
/// A sentence if the steps between coordinates that a file stores as integers are coarse against the noise, else empty.
std::string coarse_steps(double step, double noise, std::optional<double> metres_per_unit = {});
/// The error that rounding to such steps adds on each axis.
Json rounding_json(double step);
/// The line that tells it; empty without steps.
std::string rounding_text(double step);
/// The device, the parameters and each stage's time, a line each.
std::string details_told(const DeviceInfo& device, const Params& asked, const Params& used,
                         const std::vector<StageTime>& stages);
/// "noise of the input ..., points moved ..."; `source` as noise_source says.
std::string noise_and_moves(std::optional<double> noise, const std::string& source, double mean, double max);
/// Where the noise comes from: "given", "estimated", or the attribute that has it.
std::string noise_source(const Params& asked, const std::string& attribute);

/// The points of a run.
struct PointCounts {
  std::uint64_t points = 0;  // all
  UnmovedCounts unmoved;
  OutlierCounts pulled;   // outliers that were pulled in
  OutlierCounts removed;  // of the points that were not moved, not in the result
  std::uint64_t ignored = 0, held = 0;
};
Json unmoved_json(const PointCounts& counts);
/// All that were found, whatever became of them.
Json outliers_json(const PointCounts& counts);
/// "90 points denoised on cpu in 12.0 ms, 7 kept as they were: 5 not finite or beyond 1e18, 2 isolated", `how` being
/// "on cpu in 12.0 ms", and lines that tell of those pulled in and held.
std::string points_told(const PointCounts& counts, const std::string& how);
/// A sentence where the limits let no point move; empty: they let some.
std::string nothing_selected(const PointCounts& counts);
Json bounds_json(const Cloud& cloud, const Estimates& estimates);  ///< in file coordinates
Json attributes_json(const std::vector<AttributeInfo>& attributes);

std::string_view type_name(ScalarType type);
std::string_view device_name(Device::Kind kind);

/// Whether --report names a page and not JSON, by its extension.
bool is_page(const std::string& report);

/// Throws if --report names what no report is: a table, which only many files on their own have, a cloud, or a PDF.
void check_kind_of_report(const std::string& report);

/// Early check of --report: throws if it would be one of `files` or cannot be created, as check_page does, if it is of
/// no kind that reports have, and if it is a page. Empty: no report.
void check_report(const std::string& report, const std::vector<std::filesystem::path>& files);
void check_page(const std::string& report, const std::vector<std::filesystem::path>& files);

/// Writes the object as text; a number that JSON cannot hold becomes null. Throws ErrorKind::file.
void write_report(const std::string& report, const Json& json);

}  // namespace pointfair::cli
