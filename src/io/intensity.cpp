// SPDX-License-Identifier: Apache-2.0
#include "io/intensity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pointfair::io {
namespace {

constexpr double kMost = 65535;

struct Seen {
  bool whole = true;
  double least = std::numeric_limits<double>::infinity(), most = -std::numeric_limits<double>::infinity();
};

Seen look(std::span<const char> data, NativeType type) {
  Seen seen;
  for (std::size_t at = 0; at < data.size(); at += size_of(type)) {
    const double value = load_double(data.data() + at, type, false);
    seen.whole = seen.whole && value == std::nearbyint(value);
    if (!std::isfinite(value)) continue;
    seen.least = std::min(seen.least, value);
    seen.most = std::max(seen.most, value);
  }
  return seen;
}

bool fits(const Seen& seen) { return seen.whole && seen.least >= 0 && seen.most <= kMost; }

}  // namespace

bool is_las_intensity(std::span<const char> data, NativeType type) { return fits(look(data, type)); }

std::size_t find_intensity(const std::vector<std::string>& names) {
  auto found = std::ranges::find(names, "intensity");
  if (found == names.end())
    found = std::ranges::find_if(names, [](const std::string& name) { return lower_case(name) == "intensity"; });
  return static_cast<std::size_t>(found - names.begin());
}

void use_las_intensity(Table& table) {
  const std::size_t place = find_intensity(names_of(table));
  if (place == table.columns.size()) return;
  TableColumn* const column = &table.columns[place];
  column->name = "intensity";
  const Seen seen = look(column->data, column->type);
  if (fits(seen)) return;
  const bool in_range = seen.least >= 0 && seen.most <= kMost;
  const double low = in_range ? 0 : seen.least;
  double factor = 1;
  if (in_range && seen.most <= 1) factor = kMost;
  if (!in_range && seen.most > seen.least) factor = kMost / (seen.most - seen.least);
  change_values(*column, NativeType::uint16, [&](std::size_t, double value) { return factor * (value - low); });
}

}  // namespace pointfair::io
