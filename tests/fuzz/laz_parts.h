// SPDX-License-Identifier: Apache-2.0
// A sound LAZ file in parts, of which a fuzz target replaces one.
#pragma once

#include <array>

#include "fuzz_reader.h"
#include "las_files.h"

namespace pointfair::fuzz {

struct LazParts {
  std::string front;  ///< header, records and the place of the table
  std::string chunk;  ///< of all points
  std::string table;
};

inline constexpr unsigned kLazPoints = 60;

/// A file of this point format, with extra bytes in it.
inline LazParts make_parts(unsigned format) {
  const Cloud cloud = read_as(
      as_bytes(
          test::make_las({.minor = 4, .format = format, .count = kLazPoints, .extended = false, .plain_extra = 2})),
      Format::las);
  const std::vector<std::byte> bytes = write_bytes(cloud, Format::laz);
  const std::string file(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::size_t begin = test::las_points_begin(file), table = test::las_get<std::uint64_t>(file, begin);
  return {file.substr(0, begin + 8), file.substr(begin + 8, table - begin - 8), file.substr(table)};
}

inline const LazParts& parts_of(unsigned format) {
  static const std::array<LazParts, 11> all = [] {
    std::array<LazParts, 11> parts;
    for (unsigned f = 0; f < parts.size(); ++f) parts[f] = make_parts(f);
    return parts;
  }();
  return all[format];
}

/// The file of these parts; the place of the table is set.
inline std::vector<std::byte> join(std::string front, const std::string& chunk, const std::string& table) {
  test::las_put<std::uint64_t>(front, front.size() - 8, front.size() + chunk.size());
  return as_bytes(front + chunk + table);
}

}  // namespace pointfair::fuzz
