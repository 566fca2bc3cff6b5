// SPDX-License-Identifier: Apache-2.0
#include "io/edits.hpp"

#include <algorithm>

#include "io/source.hpp"

namespace pointfair::io {

Edits make_edits(const Cloud& cloud, std::optional<double> las_scale) {
  Edits edits{cloud, {}, {}, las_scale};
  std::vector<Column> columns;
  if (cloud.source && !cloud.added.empty()) columns = cloud.source->columns();
  for (const Attribute& attribute : cloud.added) {
    const auto named = [&](const auto& other) { return other.name == attribute.name; };
    if (std::count_if(cloud.added.begin(), cloud.added.end(), named) > 1)
      throw Error(ErrorKind::usage, "the cloud has two attributes '" + attribute.name + "'; rename one");
    const auto own = std::find_if(columns.begin(), columns.end(), named);
    if (own == columns.end()) {
      edits.added.push_back(&attribute);
      continue;
    }
    if (own->components != attribute.components)
      throw Error(ErrorKind::usage, "the attribute '" + attribute.name + "' of the file has " +
                                        std::to_string(own->components) + " values a point, its replacement " +
                                        std::to_string(attribute.components) + "; rename it");
    edits.replaced.push_back({static_cast<std::size_t>(own - columns.begin()), &attribute});
  }
  return edits;
}

}  // namespace pointfair::io
