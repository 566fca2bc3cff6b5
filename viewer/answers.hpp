// SPDX-License-Identifier: Apache-2.0
// The JSON of what the server tells the page; web/src/protocol.ts has the same as types. Arrays are added by whoever
// sends them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "message.hpp"
#include "pointfair/pointfair.hpp"
#include "quantise.hpp"
#include "request.hpp"

namespace pointfair::viewer {

/// The first message: what the program can do. `device` once it is known; `save_folder` as it is shown; empty: saved
/// files go to the page.
/// `has_cloud`: a cloud follows; without one the page asks for a file.
Json hello_answer(const std::optional<DeviceInfo>& device, const std::string& save_folder, bool has_cloud);

/// A cloud as it was read, of which the page holds `shown` points.
struct CloudFacts {
  std::string name, path;  ///< the path is empty for a cloud that came through the page
  Estimates estimates;
  Json colours;             ///< what there is to colour by
  std::uint64_t faces = 0;  ///< of the file, drawn or not
  std::size_t shown = 0;
  float step = 1;        ///< of displacements, file units
  bool settles = false;  ///< whether shading normals of results will come
};
Json cloud_answer(const Cloud& cloud, const CloudFacts& facts);

/// A run that was completed. `notes` as notes_on_run; `encode_ms` is the time from the run's end on.
Json result_answer(const Request& request, const Report& report, const Displacements& moved,
                   const std::vector<std::string>& notes, float step, double encode_ms, const Errand& errand);

Json progress_answer(const Json& id, double share, std::string_view stage);
Json error_answer(const Json& id, std::string_view words);

}  // namespace pointfair::viewer
