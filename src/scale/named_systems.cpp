// SPDX-License-Identifier: Apache-2.0
#include "scale/named_systems.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include "pointfair/file_info.hpp"

namespace pointfair::scale {

std::string coordinate_system_of(const Source& source) {
  std::string system;
  for (const auto& [name, value] : source.info().rows)
    if (name == "coordinate_system") system = value;
  for (char& c : system)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  return system;
}

std::vector<NamedSystem> named_systems(std::span<const InputFile> files) {
  std::map<std::string, NamedSystem> of_codes;
  for (const InputFile& file : files) {
    const std::size_t code = file.coordinate_system.rfind("EPSG:");
    if (code == std::string::npos) continue;  // the same system may have many names
    NamedSystem& system = of_codes[file.coordinate_system.substr(code)];
    if (system.files++ == 0) system = {file.coordinate_system, 1, file.path};
  }
  std::vector<NamedSystem> systems;
  for (auto& [code, system] : of_codes) systems.push_back(std::move(system));
  std::stable_sort(systems.begin(), systems.end(),
                   [](const NamedSystem& a, const NamedSystem& b) { return a.files > b.files; });
  return systems;
}

}  // namespace pointfair::scale
