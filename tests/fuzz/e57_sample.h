// SPDX-License-Identifier: Apache-2.0
// A small E57 file with all kinds of fields.
#pragma once

#include "e57_files.h"

namespace pointfair::fuzz {

inline std::string e57_sample() {
  test::E57Scan scan;
  const std::vector<double> values = {1, 2, 3, 5, 8, 13, 21, 34, 55, 89};
  scan.fields = {{"cartesianX", "single", values, 0, 0, 1, 0, ""},
                 {"cartesianY", "double", values, 0, 0, 1, 0, ""},
                 {"cartesianZ", "scaled", values, -7, 100, 0.001, 4, ""},
                 {"cartesianInvalidState", "integer", {0, 0, 1, 0, 2, 0, 0, 0, 0, 0}, 0, 2, 1, 0, ""},
                 {"intensity", "integer", values, 0, 255, 1, 0, ""}};
  scan.pose =
      "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">.6</w><x type=\"Float\">.8</x>"
      "<y type=\"Float\">0</y><z type=\"Float\">0</z></rotation><translation type=\"Structure\"><x "
      "type=\"Float\">9</x><y type=\"Float\">8</y><z type=\"Float\">7</z></translation></pose>";
  test::E57Scan sphere;
  sphere.fields = {{"sphericalRange", "double", values, 0, 0, 1, 0, ""},
                   {"sphericalAzimuth", "scaled", values, 0, 1000, 0.001, 0, ""},
                   {"sphericalElevation", "single", values, 0, 0, 1, 0, ""}};
  return test::make_e57({scan, sphere}, 16);
}

/// The file without the checksums of its pages.
inline std::string logical_bytes(const std::string& file) {
  std::string logical;
  for (std::size_t at = 0; at < file.size(); at += 1024) logical += file.substr(at, 1020);
  return logical;
}

}  // namespace pointfair::fuzz
