// SPDX-License-Identifier: Apache-2.0
// Files of three points in every format, each with one thing more.
#pragma once

#include "e57_files.h"
#include "gltf_files.h"
#include "io_files.h"
#include "las_files.h"

namespace pointfair::test::lossy {

inline std::string ply(const std::string& properties, const std::string& body, const std::string& after = "",
                       const std::string& before = "") {
  return "ply\nformat ascii 1.0\n" + before +
         "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n" + properties + after +
         "end_header\n" + body;
}

// The same with the triangle of its three points.
inline std::string mesh(const std::string& properties, const std::string& body) {
  return ply(properties, body + "3 0 1 2\n", "element face 1\nproperty list uchar int vertex_indices\n");
}

inline std::string pcd(const std::string& fields, const std::string& sizes, const std::string& types,
                       const std::string& more, const std::string& body) {
  return "VERSION 0.7\nFIELDS x y z" + fields + "\nSIZE 4 4 4" + sizes + "\nTYPE F F F" + types + "\n" + more +
         "POINTS 3\nDATA ascii\n" + body;
}

// Three points of a file of records with a coordinate system, two others and a format of points.
inline std::string las(unsigned seed) { return make_las({.count = 3, .seed = seed}); }

// And a day.
inline std::string las_of_a_day() {
  std::string file = las(1);
  las_put<std::uint16_t>(file, 92, 2024);
  return file;
}

// One facet in a binary file.
inline std::string stl(const std::string& title) {
  std::string file = title;
  file.resize(80);
  return file + packed<std::uint32_t>({1}) + packed<float>({0, 0, 1, 1, 2, 3, 4, 5, 6, 7, 8, 9.5F}) +
         std::string(2, '\0');
}

inline std::string ptx(const std::string& size, const std::string& more = "") {
  return size + "1 2 3\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n1 2 3 1\n1 2 3 0.5\n4 5 6 0.25\n7 8 9 1\n" +
         more;
}

inline std::string npy(const std::string& field, const std::vector<float>& values) {
  std::string header =
      "{'descr': [('x', '<f4'), ('y', '<f4'), ('z', '<f4'), " + field + "], 'fortran_order': False, 'shape': (3,), }";
  header.resize(118, ' ');
  header.back() = '\n';
  std::string file = std::string("\x93NUMPY\x01\x00", 8) + packed<std::uint16_t>({118}) + header;
  for (std::size_t i = 0; i < 3; ++i)
    file += packed<float>({1.0F + 3 * static_cast<float>(i), 2, static_cast<float>(i), values[i]});
  return file;
}

/// `states`: cartesianInvalidState, or none.
inline std::string e57(const std::vector<double>& states = {}) {
  E57Scan scan;
  scan.pose =
      "<name type=\"String\">hall</name><pose type=\"Structure\"><translation type=\"Structure\"><x "
      "type=\"Float\">5</x></translation></pose>";
  for (const char* const name : {"cartesianX", "cartesianY", "cartesianZ"})
    scan.fields.push_back({name, "double", {1, 2, 4}, 0, 0, 1, 0, ""});
  if (!states.empty()) scan.fields.push_back({"cartesianInvalidState", "integer", states, 0, 2, 1, 0, ""});
  return make_e57({scan});
}

/// A GLB file: one mesh, the points of which have a further attribute ("NORMAL" for instance), values of which are
/// floats, `components` a point; `primitive`, `document` and `node` go into the JSON of the mesh's primitive, of the
/// file and of its node, each with a comma before it.
inline std::string gltf(const std::string& attribute, const std::string& values, const std::string& primitive = "",
                        const std::string& document = "", const std::string& node = "") {
  const std::string points = packed<float>({1, 2, 3, 4, 5, 6, 7, 8, 9.5F});
  const std::size_t components = values.size() / 12;
  std::string json = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0)" + node +
                     R"(}],"meshes":[{"primitives":[{"attributes":{"POSITION":0)" +
                     (attribute.empty() ? "" : ",\"" + attribute + "\":1") + "}" + primitive +
                     R"(}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"})";
  if (!attribute.empty())
    json += R"(,{"bufferView":1,"componentType":5126,"count":3,"type":"VEC)" + std::to_string(components) + "\"}";
  json += R"(],"bufferViews":[{"buffer":0,"byteLength":36})";
  if (!attribute.empty()) json += R"(,{"buffer":0,"byteOffset":36,"byteLength":)" + std::to_string(values.size()) + "}";
  json += R"(],"buffers":[{"byteLength":)" + std::to_string(36 + values.size()) + "}]" + document + "}";
  return glb(json, points + values);
}

/// Plain floats: x, y, z, then one or two values.
inline std::string floats(const std::vector<float>& intensity, const std::vector<float>& rings = {},
                          float second_x = 4) {
  std::string file;
  for (std::size_t i = 0; i < 3; ++i) {
    file += packed<float>({i == 1 ? second_x : 1.0F + 3 * static_cast<float>(i), 2, 3, intensity[i]});
    if (!rings.empty()) file += packed<float>({rings[i]});
  }
  return file;
}

}  // namespace pointfair::test::lossy
