// SPDX-License-Identifier: Apache-2.0
#include "answers.hpp"

namespace pointfair::viewer {
namespace {

constexpr int kProtocol = 1;

Json device_json(const DeviceInfo& device) {
  return {{"kind", device.kind == Device::cuda ? "cuda" : "cpu"}, {"name", device.name}, {"reason", device.reason}};
}

Json stages_json(const std::vector<StageTime>& stages) {
  Json json = Json::array();
  for (const StageTime& stage : stages) json.push_back({{"name", stage.name}, {"ms", stage.milliseconds}});
  return json;
}

Json formats_json() {
  Json formats = Json::array(), encodings = Json::array();
  for (const char* extension :
       {"ply", "pcd", "las", "laz", "xyz", "txt", "csv", "pts", "off", "obj", "e57", "ptx", "stl", "npy", "copc.laz"}) {
    if (format_of(std::string("x.") + extension)) formats.push_back(extension);
  }
  for (const auto& [name, encoding] : kEncodings) encodings.push_back(name);
  return {{"extensions", formats}, {"encodings", encodings}};
}

// Ignored points go into a run as points that are not finite.
Json reasons_json(const UnmovedCounts& unmoved) {
  const OutlierCounts& outliers = unmoved.outliers_by_reason;
  return {{"not finite, or ignored", unmoved.non_finite}, {"with too few neighbours", unmoved.too_few_neighbors},
          {"without a normal", unmoved.no_normal},        {"isolated", outliers.isolated},
          {"off the surface", outliers.off_surface},      {"mixed pixels", outliers.mixed_pixels},
          {"on the border of the mesh", unmoved.boundary}};
}

}  // namespace

Json hello_answer(const std::optional<DeviceInfo>& device, const std::string& save_folder, bool has_cloud) {
  return {{"type", "hello"},
          {"protocol", kProtocol},
          {"version", version()},
          {"device", device ? device_json(*device) : Json()},
          {"params", describe_params()},
          {"presets", Json::array({{{"name", "automatic"}, {"params", params_texts({})}},
                                   {{"name", "paper"}, {"params", params_texts(paper_preset())}}})},
          {"limits", kLimitNames},
          {"formats", formats_json()},
          {"save_folder", save_folder},
          {"has_cloud", has_cloud}};
}

Json cloud_answer(const Cloud& cloud, const CloudFacts& facts) {
  const Estimates& estimates = facts.estimates;
  const std::optional<double> metres = file_info(cloud).metres_per_unit;
  return {{"type", "cloud"},
          {"name", facts.name},
          {"path", facts.path},
          {"points", estimates.points},
          {"finite", estimates.finite},
          {"shown", facts.shown},
          {"origin", cloud.origin},
          {"min", estimates.min},
          {"max", estimates.max},
          {"diagonal", estimates.diagonal},
          {"spacing", estimates.spacing},
          {"noise", estimates.noise},
          {"step", facts.step},
          {"metres_per_unit", metres ? Json(*metres) : Json(nullptr)},
          {"colours", facts.colours},
          {"faces", facts.faces},
          {"settles", facts.settles}};
}

Json result_answer(const Request& request, const Report& report, const Displacements& moved,
                   const std::vector<std::string>& notes, float step, double encode_ms, const Errand& errand) {
  return {{"type", "result"},
          {"id", request.id},
          {"along_normals", moved.along_normals},
          {"step", step},
          {"used", params_texts(report.params)},
          {"moved", {{"mean", moved.mean}, {"rms", moved.rms}, {"max", moved.max}}},
          {"unmoved", report.unmoved.total()},
          {"reasons", reasons_json(report.unmoved)},
          {"pulled", report.pulled.total()},
          {"notes", notes},
          {"stages", stages_json(report.stages)},
          {"total_ms", report.total_milliseconds},
          {"encode_ms", encode_ms},
          {"server_ms", request.milliseconds_since_received()},
          {"peak_bytes", {{"host", report.peak_host_bytes}, {"device", report.peak_device_bytes}}},
          {"command", as_command(request.recipe, errand)},
          {"cpp", as_cpp(request.recipe, errand)}};
}

Json progress_answer(const Json& id, double share, std::string_view stage) {
  return {{"type", "progress"}, {"id", id}, {"share", share}, {"stage", stage}};
}

Json error_answer(const Json& id, std::string_view words) {
  return {{"type", "error"}, {"id", id}, {"message", words}};
}

}  // namespace pointfair::viewer
