// SPDX-License-Identifier: Apache-2.0
#include "viewpoint_note.hpp"

#include <fmt/format.h>

namespace pointfair::cli {

std::string grid_viewpoint_note(const Cloud& cloud) {
  const FileInfo info = file_info(cloud);
  if (info.grid_width == 0) return "";
  for (const FileInfo::Row& row : info.rows)
    if (row.name == "sensor") return fmt::format("the sensor stood at {}; --viewpoint none takes no place", row.value);
  if (!file_viewpoints(cloud).empty()) return "";
  return "the file does not say where the sensor stood, and its grid does not tell: --viewpoint x,y,z finds points "
         "between two surfaces (mixed pixels)";
}

}  // namespace pointfair::cli
