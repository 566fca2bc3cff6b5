// SPDX-License-Identifier: Apache-2.0
// The JSON of --report. Keys are stable from the first release on: add, never rename.
#pragma once

#include <cstdint>
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
Json outliers_json(const OutlierCounts& outliers);
/// A sentence where floats around one origin cannot tell the noise; empty: they can.
std::string coarse_floats(double float_step, double noise);
/// The same of the steps between coordinates that a file stores as integers.
std::string coarse_steps(double step, double noise);
/// What rounding to such steps adds.
Json rounding_json(double step);
/// The line of it; empty without steps.
std::string rounding_text(double step);
/// "noise of the input ..., points moved ..."; `attribute`: that the noise comes from; empty: it is estimated.
std::string noise_and_moves(std::optional<double> noise, const std::string& attribute, double mean, double max);
/// How many points a run treated: those that it neither kept nor held.
std::uint64_t count_denoised(std::uint64_t points, std::uint64_t kept, std::uint64_t held);
/// A sentence where the limits let no point move; empty: they let some.
std::string nothing_selected(std::uint64_t points, std::uint64_t non_finite, std::uint64_t ignored, std::uint64_t held);
Json bounds_json(const Cloud& cloud, const Estimates& estimates);  ///< in file coordinates
Json attributes_json(const std::vector<AttributeInfo>& attributes);

std::string_view type_name(ScalarType type);
std::string_view device_name(Device::Kind kind);

/// Early check of --report: throws if it would replace one of `files` or cannot be created. Empty: no report.
void check_report(const std::string& report, const std::vector<std::string>& files);

/// Writes the object as text; a number that JSON cannot hold becomes null. Throws ErrorKind::file.
void write_report(const std::string& report, const Json& json);

}  // namespace pointfair::cli
