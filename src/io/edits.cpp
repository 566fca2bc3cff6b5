// SPDX-License-Identifier: Apache-2.0
#include "io/edits.hpp"

#include <algorithm>

#include "io/source.hpp"

namespace pointfair::io {

std::size_t bytes_of(const AddedAttributes& added) {
  std::size_t bytes = 0;
  for (const Attribute* attribute : added) bytes += attribute->components * pointfair::size_of(attribute->type);
  return bytes;
}

Edits make_edits(const Cloud& cloud, std::optional<double> las_scale) {
  Edits edits{cloud, {}, {}, las_scale};
  std::vector<Column> columns;
  if (cloud.source && !cloud.added.empty()) columns = cloud.source->columns();
  for (const Attribute& attribute : cloud.added) {
    const auto named = [&](const auto& other) { return other.name == attribute.name; };
    if (std::ranges::count_if(cloud.added, named) > 1)
      throw Error(ErrorKind::usage, "the cloud has two attributes '" + attribute.name + "'; rename one");
    const auto own = std::ranges::find_if(columns, named);
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

void check_fits(const Column& column, double value) {
  if (column.bits == 0 || narrow<std::uint8_t>(value) >> column.bits == 0) return;
  const std::string most = std::to_string((1U << column.bits) - 1);
  const std::string holds = column.name == "classification"
                                ? "point formats 0 to 5 hold classes 0 to " + most
                                : "this point format holds '" + column.name + "' from 0 to " + most;
  throw Error(ErrorKind::usage, holds + "; choose one of these instead of " +
                                    std::to_string(narrow<std::uint8_t>(value)) + ", or write PLY, PCD or CSV");
}

void check_fits(const Replacement& replacement, const Source& source) {
  const Column column = source.columns()[replacement.column];
  for (std::uint64_t i = 0; column.bits != 0 && i < source.size(); ++i) check_fits(column, replacement.value(i, 0));
}

}  // namespace pointfair::io
