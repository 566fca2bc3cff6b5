// SPDX-License-Identifier: Apache-2.0
// Writing a new STL file: the triangles of the cloud's faces, each with its own three corners.
#include <algorithm>
#include <cmath>

#include "io/formats.hpp"
#include "io/stl/facets.hpp"

namespace pointfair::io {
namespace {

using Triangle = std::array<Position, 3>;

// The triangles of all faces that have a place: those with an invalid corner have none.
std::vector<Triangle> triangles_of(const Table& table) {
  std::vector<Triangle> result;
  for (std::size_t face = 0; face < table.faces.ends.size(); ++face) {
    const std::span<const std::uint32_t> corners = table.faces.corners_of(face);
    for (std::size_t c = 2; c < corners.size(); ++c) {
      const Triangle triangle{table.positions[corners[0]], table.positions[corners[c - 1]],
                              table.positions[corners[c]]};
      if (std::ranges::all_of(triangle, [](const Position& p) { return std::isfinite(p[0] + p[1] + p[2]); }))
        result.push_back(triangle);
    }
  }
  return result;
}

void write_binary(const std::vector<Triangle>& triangles, Output& out) {
  std::string header(stl::kOwnTitle);
  header.resize(80);
  append_little(header, static_cast<std::uint32_t>(triangles.size()));
  out.write(header);
  write_rows(out, triangles.size(), [&](std::size_t t, std::string& buffer) {
    for (const float value : stl::normal_of(triangles[t], 0)) append_little(buffer, value);
    for (const Position& corner : triangles[t])
      for (const double value : corner) append_little(buffer, static_cast<float>(value));
    append_little(buffer, std::uint16_t{0});
  });
}

void write_text(const std::vector<Triangle>& triangles, NativeType type, Output& out) {
  out.write("solid " + std::string(stl::kOwnName) + "\n");
  write_rows(out, triangles.size(), [&](std::size_t t, std::string& buffer) {
    buffer += "facet normal";
    for (const float value : stl::normal_of(triangles[t], 0)) append_number(buffer += ' ', value);
    buffer += "\n outer loop\n";
    for (const Position& corner : triangles[t]) {
      buffer += "  vertex";
      for (const double value : corner) append_as(buffer += ' ', value, type);
      buffer += '\n';
    }
    buffer += " endloop\nendfacet\n";
  });
  out.write("endsolid " + std::string(stl::kOwnName) + "\n");
}

// Looks for a face that STL files can hold.
class FiniteFaceFinder final : public FaceVisitor {
 public:
  explicit FiniteFaceFinder(std::span<const Point> points) : points_(points) {}

  void take(std::span<const std::uint32_t> corners, std::span<const float>) override {
    found = found || (corners.size() >= 3 && std::ranges::all_of(corners, [&](std::uint32_t corner) {
                        const Point& p = points_[corner];
                        return std::isfinite(p.x + p.y + p.z);
                      }));
  }
  bool found = false;

 private:
  std::span<const Point> points_;
};

}  // namespace

void check_new_stl(const Cloud& cloud) {
  FiniteFaceFinder finder(cloud.points);
  if (cloud.source) cloud.source->visit_faces(finder);
  if (finder.found) return;
  throw Error(ErrorKind::usage,
              "STL files hold triangles, and this cloud has no faces of finite points; choose PLY or another format");
}

std::vector<std::string> losses_in_new_stl(const Cloud& cloud) {
  std::vector<std::string> result = {
      "STL files repeat a point for each triangle that it is a corner of, and leave out those that are of none; PLY, "
      "OFF "
      "and OBJ keep the points as they are"};
  if (position_type(cloud) == ScalarType::float64)
    result.push_back("binary STL files have 32-bit floats, which round these coordinates; --encoding ascii keeps them");
  return result;
}

void write_stl(Table table, const Writing& writing, Output& out) {
  const std::vector<Triangle> triangles = triangles_of(table);
  if (triangles.size() > 0xFFFFFFFF) throw Error(ErrorKind::usage, "STL files hold at most 4294967295 triangles");
  if (writing.encoding == Encoding::ascii) return write_text(triangles, native(table.coordinate_type), out);
  write_binary(triangles, out);
}

}  // namespace pointfair::io
