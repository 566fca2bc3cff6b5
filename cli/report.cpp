// SPDX-License-Identifier: Apache-2.0
#include "report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "output.hpp"

namespace pointfair::cli {
namespace {

Json param_json(const Params& params, const ParamInfo& info) {
  if (const auto* field = std::get_if<int Params::*>(&info.field)) {
    if (params.*(*field) != kAutomatic) return params.*(*field);
  } else if (const auto* factor = std::get_if<std::optional<double> Params::*>(&info.field)) {
    if (params.*(*factor)) return *(params.*(*factor));
  } else if (const auto* flag = std::get_if<bool Params::*>(&info.field)) {
    return params.*(*flag);
  } else if (const auto* length = std::get_if<Length Params::*>(&info.field)) {
    if ((params.*(*length)).unit == Length::Unit::file) return (params.*(*length)).value;
    if ((params.*(*length)).is_automatic()) return nullptr;
  }
  return param_text(params, info);
}

constexpr double kRoundingRms = 0.288675;  // of a step, on each axis: 1 / sqrt(12)

// ": 5 not finite or beyond 1e18, 2 isolated"; empty: none was kept.
std::string reasons_kept(const UnmovedCounts& unmoved, std::uint64_t ignored) {
  std::string reasons;
  const auto add = [&](std::uint64_t count, const char* reason) {
    if (count > 0) reasons += fmt::format("{}{} {}", reasons.empty() ? ": " : ", ", count, reason);
  };
  add(unmoved.non_finite, "not finite or beyond 1e18");
  add(unmoved.too_few_neighbors, "with too few neighbours");
  add(unmoved.no_normal, "without a normal");
  const OutlierCounts& outliers = unmoved.outliers_by_reason;
  add(outliers.isolated, "isolated");
  add(outliers.off_surface, "off the surface");
  add(outliers.mixed_pixels, "mixed pixels");
  add(unmoved.boundary, "on the border of the mesh");
  add(ignored, "ignored");
  return reasons;
}

// Outliers that are not in the result were not kept in it.
UnmovedCounts without_removed(UnmovedCounts unmoved, const OutlierCounts& removed) {
  OutlierCounts& kept = unmoved.outliers_by_reason;
  kept.isolated -= std::min(kept.isolated, removed.isolated);
  kept.off_surface -= std::min(kept.off_surface, removed.off_surface);
  kept.mixed_pixels -= std::min(kept.mixed_pixels, removed.mixed_pixels);
  unmoved.outliers -= std::min(unmoved.outliers, removed.total());
  return unmoved;
}

// "auto (keep)" where the run chose.
std::string param_told(const Params& asked, const Params& used, const ParamInfo& info) {
  const std::string text = param_text(used, info);
  return param_text(asked, info) == "auto" && text != "auto" ? fmt::format("auto ({})", text) : text;
}

}  // namespace

std::string_view type_name(ScalarType type) {
  constexpr std::string_view kNames[] = {"int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"};
  return kNames[static_cast<std::size_t>(type)];
}

std::string_view device_name(Device::Kind kind) {
  constexpr std::string_view kNames[] = {"auto", "cpu", "cuda"};
  return kNames[static_cast<std::size_t>(kind)];
}

Json device_json(const DeviceInfo& device) {
  return {{"kind", device_name(device.kind)}, {"name", device.name}, {"reason", device.reason}};
}

Json params_json(const Params& params) {
  Json json = Json::object();
  for (const ParamInfo& info : kParams) json[std::string(info.name)] = param_json(params, info);
  return json;
}

Json stages_json(const std::vector<StageTime>& stages) {
  Json json = Json::array();
  for (const StageTime& stage : stages) json.push_back({{"name", stage.name}, {"ms", stage.milliseconds}});
  return json;
}

Json statistics_json(const Statistics& statistics) {
  return {{"mean", statistics.mean}, {"rms", statistics.rms}, {"p95", statistics.p95}, {"max", statistics.max}};
}

Json outliers_json(const PointCounts& counts) {
  const OutlierCounts &kept = counts.unmoved.outliers_by_reason, &pulled = counts.pulled;
  return {{"isolated", kept.isolated + pulled.isolated},
          {"off_surface", kept.off_surface + pulled.off_surface},
          {"mixed_pixels", kept.mixed_pixels + pulled.mixed_pixels}};
}

std::string coarse_steps(double step, double noise, std::optional<double> metres_per_unit) {
  if (!(noise > 0) || !(step > noise)) return {};
  return fmt::format(
      "the steps of {} between stored coordinates are coarse against the noise of {}; for LAS and LAZ, "
      "--las-scale makes them finer",
      length_text(step, metres_per_unit), length_text(noise, metres_per_unit));
}

Json rounding_json(double step) { return {{"step", step}, {"rms", kRoundingRms * step}}; }

std::string rounding_text(double step) {
  if (!(step > 0)) return {};
  return fmt::format("coordinates are stored in steps of {:.4g}: rounding adds {:.2g} on each axis\n", step,
                     kRoundingRms * step);
}

std::string details_told(const DeviceInfo& device, const Params& asked, const Params& used,
                         const std::vector<StageTime>& stages) {
  std::string text = fmt::format("device    {}, {} ({})\n", device_name(device.kind), device.name, device.reason);
  for (const ParamInfo& info : kParams) text += fmt::format("  {:<18} {}\n", info.name, param_told(asked, used, info));
  for (const StageTime& stage : stages) text += fmt::format("  {:<18} {:.1f} ms\n", stage.name, stage.milliseconds);
  return text;
}

std::string noise_and_moves(std::optional<double> noise, const std::string& source, double mean, double max) {
  const std::string text = noise ? fmt::format("noise of the input {:.4g} ({}), ", *noise, source) : std::string();
  return text + fmt::format("points moved {:.4g} on average, {:.4g} at most\n", mean, max);
}

std::string noise_source(const Params& asked, const std::string& attribute) {
  if (!attribute.empty()) return fmt::format("median of '{}'", attribute);
  return asked.noise.is_automatic() ? "estimated" : "given";
}

Json unmoved_json(const PointCounts& counts) {
  const UnmovedCounts& unmoved = counts.unmoved;
  return {{"non_finite", unmoved.non_finite},
          {"too_few_neighbors", unmoved.too_few_neighbors},
          {"no_normal", unmoved.no_normal},
          {"outliers", unmoved.outliers},
          {"boundary", unmoved.boundary},
          {"ignored", counts.ignored},
          {"held", counts.held}};
}

std::string points_told(const PointCounts& counts, const std::string& how) {
  const UnmovedCounts unmoved = without_removed(counts.unmoved, counts.removed);
  const std::uint64_t kept = unmoved.total() + counts.ignored, points = counts.points - counts.removed.total();
  // A point without a normal may be counted in both `kept` and `held`.
  const std::uint64_t denoised = points - std::min(points, kept + counts.held);
  std::string text = fmt::format("{} points denoised {}, {} kept as they were{}\n", denoised, how, kept,
                                 reasons_kept(unmoved, counts.ignored));
  if (counts.pulled.total() > 0)
    text += fmt::format("{} outliers pulled in{}\n", counts.pulled.total(),
                        reasons_kept({.outliers_by_reason = counts.pulled}, 0));
  if (counts.held > 0) text += fmt::format("limits, such as --where and --box, held {} others in place\n", counts.held);
  return text;
}

std::string nothing_selected(const PointCounts& counts) {
  const std::uint64_t left_out = counts.ignored + counts.held;  // without outliers
  const UnmovedCounts& unmoved = counts.unmoved;
  if (left_out == 0 || unmoved.non_finite + unmoved.outliers + unmoved.boundary + left_out < counts.points) return {};
  return "the limits, such as --where and --box, leave no point to denoise, so nothing moved; pointfair info shows the "
         "bounds and the attributes";
}

Json bounds_json(const Cloud& cloud, const Estimates& estimates) {
  if (estimates.finite == 0) return nullptr;
  Json min = Json::array(), max = Json::array();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    min.push_back(cloud.origin[axis] + estimates.min[axis]);
    max.push_back(cloud.origin[axis] + estimates.max[axis]);
  }
  return {{"min", min}, {"max", max}};
}

Json attributes_json(const std::vector<AttributeInfo>& attributes) {
  Json json = Json::array();
  for (const AttributeInfo& attribute : attributes)
    json.push_back(
        {{"name", attribute.name}, {"type", type_name(attribute.type)}, {"components", attribute.components}});
  return json;
}

bool is_page(const std::string& report) {
  const std::string extension = std::filesystem::path(report).extension().string();
  return extension == ".html" || extension == ".htm" || extension == ".HTML" || extension == ".HTM";
}

void check_kind_of_report(const std::string& report) {
  if (std::filesystem::path(report).extension() == ".csv")
    throw Error(ErrorKind::usage, fmt::format("--report {}: a report is JSON; name a .json file. Rows in CSV, one a "
                                              "file, come with pointfair run --each",
                                              report));
  if (std::filesystem::path(report).extension() == ".pdf")
    throw Error(ErrorKind::usage, fmt::format("--report {}: a report is JSON, or a page if the name ends in .html; a "
                                              "browser prints that page as PDF",
                                              report));
  // a forgotten name makes the next word the report, which is a cloud that exists; a log may well be a .txt
  if (const auto format = format_of(report); format && format != Format::txt)
    throw Error(
        ErrorKind::usage,
        fmt::format("--report {}: this is the name of a cloud, and a report is JSON; name a .json file", report));
}

void check_report(const std::string& report, const std::vector<std::filesystem::path>& files) {
  check_kind_of_report(report);
  if (is_page(report))
    throw Error(ErrorKind::usage, fmt::format("--report {}: this is written as JSON; name a .json file. A page is made "
                                              "by pointfair run in memory, and by pointfair certify",
                                              report));
  check_page(report, files);
}

void check_page(const std::string& report, const std::vector<std::filesystem::path>& files) {
  if (report.empty()) return;
  for (const std::filesystem::path& file : files)
    if (report != "-" && are_one_file(file, report))
      throw Error(ErrorKind::usage, report + ": is a cloud of this run; name another file for --report");
  check_writable(report, true);
}

void write_report(const std::string& report, const Json& json) {
  if (report.empty()) return;
  write_text(report, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace pointfair::cli
