// SPDX-License-Identifier: Apache-2.0
// The flags of run, which its parts share.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "outlier_action.hpp"
#include "tiled.hpp"

namespace pointfair::cli {

struct RunArguments {
  std::string input, output, report, progress = "auto", normals = "keep", write_noise, write_displacement, viewpoint,
                                     weights;
  std::vector<std::string> more;  // inputs, with an output folder
  TiledArguments tiled;
  std::optional<double> las_scale;
  ParamArguments params;
  LimitArguments limits;
  OutlierAction outlier_action;
  DeviceArguments device;
  InputArguments in;
  FormatArguments format;
  bool force = false, quiet = false, verbose = false, orient = false, each = false, skip_existing = false;

  /// With an output folder, where OUT is one of them.
  std::vector<std::string> inputs() const {
    std::vector<std::string> all = {input};
    if (!output.empty()) all.push_back(output);
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
};

/// Refuses the input and the output of one run in memory, or the output and the report of any, before the work. Throws
/// ErrorKind::usage or file.
void check_paths(const RunArguments& arguments);

}  // namespace pointfair::cli
