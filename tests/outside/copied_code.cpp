// SPDX-License-Identifier: Apache-2.0
// copied_code FOLDER SCAN: what the viewer copies, as the files N.sh and copied_N.cpp for each of a few recipes that
// together set every row that the viewer shows of the parameter table, and every limit. Both read SCAN and write N.ply;
// test_package.py compares.
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "viewer/recipe.hpp"

namespace {

using namespace pointfair;
using namespace pointfair::viewer;

// A value that is not the default, of each unit in turn.
std::string other_value(const ParamInfo& info, std::size_t row) {
  if (info.values.empty()) {
    if (std::holds_alternative<Length Params::*>(info.field)) {
      const std::string lengths[] = {"2.5s", "0.11", "3%"};
      return lengths[row % std::size(lengths)];
    }
    if (std::holds_alternative<std::optional<double> Params::*>(info.field))
      return std::to_string(0.7 * info.min + 0.3 * info.max);
    return std::to_string(int(info.min) + 2);
  }
  return std::string(info.values.substr(info.values.rfind('|') + 1));
}

std::vector<Recipe> recipes() {
  Recipe all, in_radii, limited, methods;
  for (std::size_t row = 0; row < kParams.size(); ++row) {
    if (kParams[row].name == "method" || needs_faces(kParams[row])) continue;
    set_param(all.params, kParams[row], other_value(kParams[row], row));
  }
  set_param(all.params, *find_param("k"), "12");
  set_param(all.params, *find_param("constraint"), "on");
  set_param(in_radii.params, *find_param("closeness_sigma"), "0.7r");
  set_param(methods.params, *find_param("method"), "hc-laplacian");
  set_limit(limited.limits, "strength", "0.5");
  set_limit(limited.limits, "box", "0.1,0.1,-1,0.8,0.7,1");
  set_limit(limited.limits, "lasso", "1,0,0,0,0,1,0,0,0,0,0,1:0,0,0.9,0.1,0.8,0.9");
  return {{}, all, in_radii, limited, methods};
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::cerr << "usage: copied_code FOLDER SCAN\n";
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  int number = 0;
  for (const Recipe& recipe : recipes()) {
    const std::string name = std::to_string(number++);
    const bool needs_sensor = recipe.params.along == Along::ray;
    const Errand errand{argv[2], name + ".ply", number % 2 == 0 ? "ascii" : "", Device::cpu,
                        needs_sensor ? "0.4,0.6,3" : ""};
    std::ofstream(folder / (name + ".sh")) << as_command(recipe, errand) << '\n';
    std::ofstream(folder / ("copied_" + name + ".cpp")) << as_cpp(recipe, errand);
  }
  return 0;
} catch (const std::exception& error) {
  std::cerr << "copied_code: " << error.what() << '\n';
  return 1;
}
