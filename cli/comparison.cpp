// SPDX-License-Identifier: Apache-2.0
#include "comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>

namespace pointfair::cli {
namespace {

bool is_same_type(const AttributeInfo& a, const AttributeInfo& b) {
  return a.type == b.type && a.components == b.components;
}

// Of two types: floats are what the other's values round to.
std::uint64_t differing_values(const Attribute& a, const Attribute& b, std::size_t points) {
  if (a.components != b.components) return points;
  const bool has_floats = a.type == ScalarType::float32 || b.type == ScalarType::float32;
  const auto is_same = [&](double x, double y) {
    return x == y || (std::isnan(x) && std::isnan(y)) || (has_floats && static_cast<float>(x) == static_cast<float>(y));
  };
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < points; ++i) {
    bool same = true;
    for (std::uint32_t c = 0; c < a.components; ++c) same = same && is_same(value_at(a, i, c), value_at(b, i, c));
    count += !same;
  }
  return count;
}

std::uint64_t differing(const Attribute& a, const Attribute& b, std::size_t points) {
  if (!is_same_type(a, b)) return differing_values(a, b, points);
  if (a.data == b.data) return 0;
  const std::size_t bytes = size_of(a.type) * a.components;
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < points; ++i)
    count += std::memcmp(a.data.data() + i * bytes, b.data.data() + i * bytes, bytes) != 0;
  return count;
}

void compare_attributes(const Cloud& before, const Cloud& after, Comparison& result) {
  const std::vector<AttributeInfo> its = attributes(before), others = attributes(after);
  const auto find = [](const std::vector<AttributeInfo>& all, const std::string& name) {
    return std::ranges::find(all, name, &AttributeInfo::name);
  };
  for (const AttributeInfo& info : its) {
    const auto other = find(others, info.name);
    if (other == others.end())
      result.lost.push_back(info.name);
    else
      result.rows.push_back({info.name,
                             differing(attribute(before, info.name), attribute(after, info.name), before.points.size()),
                             is_same_type(info, *other)});
  }
  for (const AttributeInfo& info : others)
    if (find(its, info.name) == its.end()) result.added.push_back(info.name);
}

std::span<const std::uint32_t> corners_of(const Polygons& faces, std::size_t face) {
  const std::uint64_t begin = face == 0 ? 0 : faces.ends[face - 1];
  return std::span(faces.corners)
      .subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(faces.ends[face] - begin));
}

void compare_faces(const Cloud& before, const Cloud& after, Comparison& result) {
  const Polygons faces = polygons(before), others = polygons(after);
  if (faces.size() == 0 && others.size() == 0) return;
  if (others.size() == 0) return result.lost.push_back("faces");
  if (faces.size() == 0) return result.added.push_back("faces");
  const std::size_t both = std::min(faces.size(), others.size());
  std::uint64_t differ = std::max(faces.size(), others.size()) - both;
  for (std::size_t i = 0; i < both; ++i) differ += !std::ranges::equal(corners_of(faces, i), corners_of(others, i));
  result.faces_that_differ = differ;
}

void measure_moves(const Cloud& before, const Cloud& after, Comparison& result) {
  std::array<double, 3> shift{};
  for (std::size_t axis = 0; axis < 3; ++axis) shift[axis] = after.origin[axis] - before.origin[axis];
  std::vector<double> lengths;
  lengths.reserve(before.points.size());
  result.moved.resize(before.points.size(), std::numeric_limits<float>::quiet_NaN());
  for (std::size_t i = 0; i < before.points.size(); ++i) {
    const Point &p = before.points[i], &q = after.points[i];
    const double length = std::hypot(shift[0] + q.x - p.x, shift[1] + q.y - p.y, shift[2] + q.z - p.z);
    if (!std::isfinite(length)) continue;
    lengths.push_back(length);
    result.moved[i] = static_cast<float>(length);
    result.kept += length == 0;
  }
  result.displacement = summarize(lengths);
}

}  // namespace

void check_same_unit(const Cloud& a, const Cloud& b, const std::string& names) {
  constexpr double kSame = 1e-3;  // of the unit; feet are of several kinds
  const FileInfo of_a = file_info(a), of_b = file_info(b);
  const auto check = [&](const std::optional<double>& its, const std::optional<double>& other, const char* unit) {
    if (its && other && std::abs(*its - *other) > kSame * *other)
      throw Error(ErrorKind::usage,
                  fmt::format("{}: the unit {}of one is {:.4g} m and that of the other {:.4g} m, so distances between "
                              "them mean nothing; convert one of them",
                              names, unit, *its, *other));
  };
  check(of_a.metres_per_unit, of_b.metres_per_unit, "");
  check(of_a.metres_per_height, of_b.metres_per_height, "of the heights ");
}

Comparison compare_copies(const Cloud& before, const Cloud& after, const std::string& names) {
  if (before.points.size() != after.points.size())
    throw Error(ErrorKind::file, fmt::format("{}: one has {} points and the other {}, so that no point of one can be "
                                             "found in the other; name a cloud and its denoised copy{}",
                                             names, before.points.size(), after.points.size(),
                                             before.points.size() > after.points.size()
                                                 ? ". Where outliers were removed, --report of that run makes the page"
                                                 : ""));
  if (file_info(after).is_octree && !keeps_order(after, Format::copc))
    throw Error(ErrorKind::file, names +
                                     ": COPC files have their points in the order of an octree, so that no point of "
                                     "one can be found in the other; write LAZ, and make the COPC file of that");
  check_same_unit(before, after, names);
  Comparison result;
  measure_moves(before, after, result);
  compare_attributes(before, after, result);
  compare_faces(before, after, result);
  return result;
}

}  // namespace pointfair::cli
