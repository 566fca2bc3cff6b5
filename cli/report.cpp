// SPDX-License-Identifier: Apache-2.0
#include "report.hpp"

#include <fmt/format.h>

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

Json outliers_json(const OutlierCounts& outliers) {
  return {
      {"isolated", outliers.isolated}, {"off_surface", outliers.off_surface}, {"mixed_pixels", outliers.mixed_pixels}};
}

std::string coarse_floats(double float_step, double noise) {
  constexpr double kFewest = 3;  // steps in the noise; rounding then adds less than .5 % to it
  if (!(noise > 0) || !(kFewest * float_step > noise)) return {};
  return fmt::format(
      "coordinates far from the middle of the cloud are computed in steps of {:.4g}, coarse against the "
      "noise of {:.4g}; split so wide a cloud",
      float_step, noise);
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
  for (const AttributeInfo& attribute : attributes) {
    json.push_back(
        {{"name", attribute.name}, {"type", type_name(attribute.type)}, {"components", attribute.components}});
  }
  return json;
}

void check_report(const std::string& report, const std::vector<std::string>& files) {
  if (report.empty()) return;
  for (const std::string& file : files) check_not_same(file, report, "name another file for --report");
  check_writable(report, true);
}

void write_report(const std::string& report, const Json& json) {
  if (report.empty()) return;
  write_text(report, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace pointfair::cli
