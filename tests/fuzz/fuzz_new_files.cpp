// SPDX-License-Identifier: Apache-2.0
// A table of numbers, written anew in each format: what is written is read again, with as many points, each where it
// was, and with the same numbers where the names are the same.
#include <cmath>

#include "fuzz_reader.h"
#include "io/scalar.hpp"

namespace {

using namespace pointfair;

bool same_place(const Cloud& a, const Cloud& b) {
  if (a.points.size() != b.points.size()) return false;
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    if (is_finite(a.points[i]) != is_finite(b.points[i])) return false;
    if (is_finite(a.points[i]) && std::memcmp(&a.points[i], &b.points[i], sizeof(Point)) != 0) return false;
  }
  return true;
}

std::vector<double> numbers(const Cloud& cloud, const std::string& name) {
  const Attribute values = attribute(cloud, name);
  std::vector<double> result(values.data.size() / size_of(values.type));
  for (std::size_t i = 0; i < result.size(); ++i)
    result[i] = io::load_double(reinterpret_cast<const char*>(values.data.data()) + i * size_of(values.type),
                                io::native(values.type), false);
  return result;
}

// Colours and intensities are brought to the format's range.
bool has_range(const std::string& name) {
  return name == "red" || name == "green" || name == "blue" || name == "alpha" || name == "rgb" || name == "rgba" ||
         name == "intensity";
}

bool same_numbers(const Cloud& a, const Cloud& b) {
  for (const AttributeInfo& info : attributes(a)) {
    for (const AttributeInfo& other : attributes(b)) {
      if (info.name != other.name || has_range(info.name)) continue;
      const std::vector<double> before = numbers(a, info.name), after = numbers(b, info.name);
      if (before.size() != after.size()) return false;
      for (std::size_t i = 0; i < before.size(); ++i)
        if (before[i] != after[i] && !(std::isnan(before[i]) && std::isnan(after[i]))) return false;
    }
  }
  return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto* const begin = reinterpret_cast<const std::byte*>(data);
  Cloud cloud;
  if (!fuzz::accepted([&] { cloud = fuzz::read_as({begin, begin + size}, Format::csv); })) return 0;
  for (const Format format : {Format::ply, Format::pcd, Format::off, Format::obj, Format::e57, Format::ptx, Format::npy,
                              Format::las, Format::laz, Format::copc}) {
    std::vector<std::byte> bytes;
    if (!fuzz::accepted([&] { bytes = write_bytes(cloud, format); })) continue;
    const Cloud again = fuzz::read_as(bytes, format == Format::copc ? Format::laz : format);  // without fail
    const bool is_las = format == Format::las || format == Format::laz || format == Format::copc;
    fuzz::require(again.points.size() == cloud.points.size());
    fuzz::require(is_las || again.origin != cloud.origin || same_place(again, cloud));
    if (format == Format::ply || format == Format::pcd || format == Format::e57 || format == Format::npy)
      fuzz::require(same_numbers(cloud, again));
  }
  return 0;
}
