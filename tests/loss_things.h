// SPDX-License-Identifier: Apache-2.0
// Each kind of thing that a file may hold, in every format that holds it, and how it is found again.
#pragma once

#include <algorithm>
#include <cmath>

#include "io/contents.hpp"
#include "io/source.hpp"
#include "lossy_files.h"
#include "pointfair/normals.hpp"

namespace pointfair::test {

using io::ContentKind;

/// A file with one kind of thing, and a word of the sentence about its loss.
struct Thing {
  std::string name, bytes;
  ContentKind kind;
  std::string word;
};

// Under whatever name.
inline bool has_values(const Cloud& cloud, const std::vector<double>& wanted) {
  const std::vector<io::Column> columns = cloud.source->columns();
  for (std::size_t c = 0; c < columns.size(); ++c) {
    std::vector<char> data(cloud.points.size() * io::column_bytes(columns[c]));
    cloud.source->extract(c, data);
    bool same = columns[c].components == 1 && wanted.size() == cloud.points.size();
    for (std::size_t i = 0; same && i < wanted.size(); ++i)
      same = io::load_double(data.data() + i * io::size_of(columns[c].type), columns[c].type, false) == wanted[i];
    if (same) return true;
  }
  return false;
}

inline std::vector<std::uint8_t> reds(const Cloud& cloud) {
  return values<std::uint8_t>(parse(image(cloud, Format::ply, Encoding::binary)), "red");
}

inline bool has_colors(const Cloud& cloud) {
  if (attributes(cloud).empty()) return false;
  const std::vector<double> red = {10, 20, 30};
  return has_values(cloud, red) || reds(cloud) == std::vector<std::uint8_t>{10, 20, 30};
}

// Whether an attribute of the first point is no number.
inline bool has_missing(const Cloud& cloud) {
  for (const AttributeInfo& info : attributes(cloud))
    if (info.type == ScalarType::float32 && std::isnan(values<float>(cloud, info.name)[0])) return true;
  return false;
}

/// Whether the cloud has the thing, too.
inline bool is_there(const Thing& thing, const Cloud& cloud) {
  switch (thing.kind) {
    case ContentKind::colors:
      return has_colors(cloud);
    case ContentKind::fine_colors:
      return has_values(cloud, {1000, 2000, 65000}) ||
             has_values(cloud, {1000.0F / 65535, 2000.0F / 65535, 65000.0F / 65535});
    case ContentKind::some_colors:
      return has_missing(cloud);
    case ContentKind::normals:
      return !normal_attributes(cloud).empty() || has_values(cloud, {1, 0, 0});
    case ContentKind::numbers:
      return has_values(cloud, {0.5, 0.25, -7});
    case ContentKind::names:
      return attribute_info(cloud, thing.word.substr(0, thing.word.find(','))).has_value();
    case ContentKind::intensity:
      return has_values(cloud, {-12.5, 3, 8});
    case ContentKind::wide_integers:
      return image(cloud, Format::csv).find("1234567890123456789") != std::string::npos;
    case ContentKind::faces:
      return triangles(cloud).size() == 1;
    case ContentKind::texture_coordinates:
      return !cloud.source->faces().texture.empty();
    case ContentKind::invalid_points:
      return cloud.points.size() > 1 && std::isnan(cloud.points[1].x);
    default:
      const std::vector<io::Content> all = io::contents_of(cloud);
      return std::any_of(all.begin(), all.end(), [&](const io::Content& its) { return its.kind == thing.kind; });
  }
}

inline const std::vector<Thing>& things() {
  using enum ContentKind;
  const std::string xyz = "1 2 3\n4 5 6\n7 8 9.5\n";
  static const std::vector<Thing> all = {
      {"colors.ply",
       lossy::ply("property uchar red\nproperty uchar green\nproperty uchar blue\n",
                  "1 2 3 10 1 2\n4 5 6 20 1 2\n7 8 9 30 1 2\n"),
       colors, "colours"},
      {"colors_of_mesh.ply",
       lossy::mesh("property uchar red\nproperty uchar green\nproperty uchar blue\n",
                   "1 2 3 10 1 2\n4 5 6 20 1 2\n7 8 9.5 30 1 2\n"),
       colors, "colours"},
      {"colors.csv", "x,y,z,r,g,b\n1,2,3,10,1,2\n4,5,6,20,1,2\n7,8,9,30,1,2\n", colors, "colours"},
      {"colors.off", "COFF\n3 0 0\n1 2 3 10 1 2 255\n4 5 6 20 1 2 255\n7 8 9 30 1 2 255\n", colors, "colours"},
      {"colors.obj", "v 1 2 3 10 1 2\nv 4 5 6 20 1 2\nv 7 8 9 30 1 2\n", colors, "colours"},
      {"colors.pcd", lossy::pcd(" rgb", " 4", " U", "", "1 2 3 655618\n4 5 6 1310978\n7 8 9 1966338\n"), colors,
       "colours"},
      {"fine.ply",
       lossy::ply("property ushort red\nproperty ushort green\nproperty ushort blue\n",
                  "1 2 3 1000 1 2\n4 5 6 2000 1 2\n7 8 9 65000 1 2\n"),
       fine_colors, "colours have more than 8 bits"},
      {"fine.csv", "x,y,z,red,green,blue\n1,2,3,1000,1,2\n4,5,6,2000,1,2\n7,8,9,65000,1,2\n", fine_colors,
       "colours have more than 8 bits"},
      {"some_colors.obj", "v 1 2 3\nv 4 5 6 0 0 1\nv 7 8 9.5 1 0 0\nf 1 2 3\n", some_colors, "without a colour"},
      {"normals_of_mesh.ply",
       lossy::mesh("property float nx\nproperty float ny\nproperty float nz\n",
                   "1 2 3 1 0 0\n4 5 6 0 1 0\n7 8 9.5 0 0 1\n"),
       normals, "normals"},
      {"normals.ply",
       lossy::ply("property float nx\nproperty float ny\nproperty float nz\n",
                  "1 2 3 1 0 0\n4 5 6 0 1 0\n7 8 9 0 0 1\n"),
       normals, "normals"},
      {"normals.obj", "v 1 2 3\nvn 1 0 0\nv 4 5 6\nvn 0 1 0\nv 7 8 9\nvn 0 0 1\n", normals, "normals"},
      {"normals.off", "NOFF\n3 0 0\n1 2 3 1 0 0\n4 5 6 0 1 0\n7 8 9 0 0 1\n", normals, "normals"},
      {"normals.xyzn", "1 2 3 1 0 0\n4 5 6 0 1 0\n7 8 9 0 0 1\n", normals, "normals"},
      {"numbers.ply", lossy::ply("property float q\n", "1 2 3 0.5\n4 5 6 0.25\n7 8 9 -7\n"), numbers, "q"},
      {"numbers_of_mesh.ply", lossy::mesh("property float q\n", "1 2 3 0.5\n4 5 6 0.25\n7 8 9.5 -7\n"), numbers, "q"},
      {"numbers.npy", lossy::npy("('q', '<f4')", {0.5F, 0.25F, -7}), numbers, "q"},
      {"numbers.csv", "x,y,z,q\n1,2,3,0.5\n4,5,6,0.25\n7,8,9,-7\n", numbers, "q"},
      {"numbers.pcd", lossy::pcd(" q", " 4", " F", "", "1 2 3 0.5\n4 5 6 0.25\n7 8 9 -7\n"), numbers, "q"},
      {"numbers.off", "STOFF\n3 0 0\n1 2 3 0.5 9\n4 5 6 0.25 9\n7 8 9 -7 9\n", numbers, "s, t"},
      {"names.csv", "x,y,z,quality\n1,2,3,0.5\n4,5,6,0.25\n7,8,9,-7\n", names, "quality"},
      {"intensity.ply", lossy::ply("property float intensity\n", "1 2 3 -12.5\n4 5 6 3\n7 8 9 8\n"), intensity,
       "intensity"},
      {"intensity.pts", "3\n1 2 3 -12.5\n4 5 6 3\n7 8 9 8\n", intensity, "intensity"},
      {"wide.csv", "x,y,z,t\n1,2,3,1234567890123456789\n4,5,6,2\n7,8,9,3\n", wide_integers, "t"},
      {"wide.pcd", lossy::pcd(" t", " 8", " U", "", "1 2 3 1234567890123456789\n4 5 6 2\n7 8 9 3\n"), wide_integers,
       "t"},
      {"wide.ply", lossy::ply("property int64 t\n", "1 2 3 1234567890123456789\n4 5 6 2\n7 8 9 3\n"), wide_integers,
       "t"},
      {"words.csv", "x,y,z,label\n1,2,3,oak\n4,5,6,ash\n7,8,9,elm\n", text, "label"},
      {"words.txt", "x y z label\n1 2 3 oak\n4 5 6 ash\n7 8 9 elm\n", text, "label"},
      {"lists.ply", lossy::ply("property list uchar int views\n", "1 2 3 1 7\n4 5 6 0\n7 8 9 2 1 2\n"), lists, "views"},
      {"faces.stl",
       "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\nvertex 4 5 6\nvertex 7 8 "
       "9.5\nendloop\nendfacet\nendsolid\n",
       faces, "1 face"},
      {"faces.ply", lossy::ply("", xyz + "3 0 1 2\n", "element face 1\nproperty list uchar int vertex_indices\n"),
       faces, "1 face"},
      {"faces.off", "OFF\n3 1 0\n" + xyz + "3 0 1 2\n", faces, "1 face"},
      {"faces.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nf 1 2 3\n", faces, "1 face"},
      {"face_values.ply",
       lossy::ply("", xyz + "3 0 1 2 9\n",
                  "element face 1\nproperty list uchar int vertex_indices\nproperty uchar flags\n"),
       face_values, "flags"},
      {"face_values.off", "OFF\n3 1 0\n" + xyz + "3 0 1 2 255 0 0\n", face_values, "colours of faces"},
      {"edges.ply", lossy::ply("", xyz + "0 1\n", "element edge 1\nproperty int vertex1\nproperty int vertex2\n"),
       elements, "edge"},
      {"strips.ply", lossy::ply("", xyz + "3 0 1 2\n", "element tristrips 1\nproperty list int int vertex_indices\n"),
       elements, "tristrips"},
      {"lines.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nl 1 2\n", elements, "1 line with edges"},
      {"texture.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n", texture_coordinates,
       "texture coordinates"},
      {"texture_of_some.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nvt 0 0\nf 1/1 2/1 3/1\nf 1 2 3\n", texture_coordinates,
       "texture coordinates"},
      {"texture_of_none.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nvt 0 0\nf 1 2 3\n", elements, "1 texture coordinate that no"},
      {"odd_texture.ply",
       lossy::ply("", xyz + "3 0 1 2 3 0 0 1\n",
                  "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"),
       face_values, "which are not two for each corner"},
      {"texture.ply",
       lossy::ply("", xyz + "3 0 1 2 6 0 0 1 0 1 1\n",
                  "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"),
       texture_coordinates, "texture coordinates"},
      {"corners.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nvn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 2//2 3//2\n",
       corner_normals, "normals of corners"},
      {"material.obj", "mtllib bark.mtl\nv 1 2 3\nv 4 5 6\nv 7 8 9\nusemtl bark\nf 1 2 3\n", materials, "bark"},
      {"image.ply", lossy::ply("", xyz, "", "comment TextureFile bark.png\n"), materials, "bark.png"},
      {"groups.stl",
       "solid trunk\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\nvertex 4 5 6\nvertex 7 8 "
       "9.5\nendloop\nendfacet\nendsolid\n",
       groups, "1 name of parts"},
      {"groups.pts", "2\n1 2 3\n4 5 6\n1\n7 8 9\n", groups, "borders of 2 scans"},
      {"title.stl", lossy::stl("by hand"), comments, "title"},
      {"front.off", "OFF\n# by hand\n3 0 0\n" + xyz, comments, "commented before"},
      {"groups.obj", "g trunk\nv 1 2 3\nv 4 5 6\nv 7 8 9\n", groups, "1 line that name"},
      {"comment.ply", lossy::ply("", xyz, "", "comment by hand\n"), comments, "1 comment"},
      {"comment.obj", "# by hand\nv 1 2 3\nv 4 5 6\nv 7 8 9\n", comments, "1 comment"},
      {"comment.off", "OFF\n3 0 0\n# by hand\n" + xyz, comments, "1 comment"},
      {"comment.csv", "x,y,z\n1,2,3\n# by hand\n4,5,6\n7,8,9\n", comments, "1 comment"},
      {"title.xyz", "Survey made by hand\n" + xyz, comments, "lines before the first row"},
      {"comment.pcd", "# by hand\n" + lossy::pcd("", "", "", "", xyz), comments, "line of the header"},
      {"pose.pcd", lossy::pcd("", "", "", "VIEWPOINT 1 2 3 1 0 0 0\n", xyz), poses, "place of the sensor"},
      {"grid.pcd", "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 3\nPOINTS 3\nDATA ascii\n" + xyz,
       grid, "grid of 1 x 3"},
      {"colors.glb", lossy::gltf("COLOR_0", packed<float>({10.0F / 255, 0, 1, 20.0F / 255, 0, 1, 30.0F / 255, 0, 1})),
       colors, "colours"},
      {"normals.glb", lossy::gltf("NORMAL", packed<float>({1, 0, 0, 0, 1, 0, 0, 0, 1})), normals, "normals"},
      {"numbers.glb", lossy::gltf("TEXCOORD_0", packed<float>({0.5F, 9, 0.25F, 9, -7, 9})), numbers, "s, t"},
      {"names.glb", lossy::gltf("TEXCOORD_0", packed<float>({0.5F, 9, 0.25F, 9, -7, 9})), names, "s, t"},
      {"faces.glb", lossy::gltf("", ""), faces, "1 face"},
      {"lines.glb", lossy::gltf("", "", R"(,"mode":1)"), elements, "1 mesh of lines"},
      {"material.glb", lossy::gltf("", "", R"(,"material":0)", R"(,"materials":[{"name":"bark"}])"), materials,
       "1 material"},
      {"groups.glb", lossy::gltf("", "", "", "", R"(,"name":"trunk")"), groups, "1 name of a part"},
      {"animation.glb", lossy::gltf("", "", "", R"(,"animations":[{}])"), records, "1 animation"},
      {"attribute.glb", lossy::gltf("_QUALITY", packed<float>({1, 2, 3, 4, 5, 6})), records, "the attribute _QUALITY"},
      {"numbers.nuscenes", lossy::floats({1, 2, 3}, {0.5F, 0.25F, -7}), numbers, "ring"},
      {"names.nuscenes", lossy::floats({1, 2, 3}, {0.5F, 0.25F, -7}), names, "ring"},
      {"intensity.kitti", lossy::floats({-12.5F, 3, 8}), intensity, "intensity"},
      {"intensity.nuscenes", lossy::floats({-12.5F, 3, 8}, {1, 2, 3}), intensity, "intensity"},
      {"invalid.kitti", lossy::floats({1, 2, 3}, {}, std::nanf("")), invalid_points, ""},
      {"invalid.nuscenes", lossy::floats({1, 2, 3}, {1, 2, 3}, std::nanf("")), invalid_points, ""},
      {"system.las", lossy::las(1), coordinate_system, "coordinate system"},
      {"header.las", lossy::las_of_a_day(), records, "date"},
      {"records.las", lossy::las(1), records, "1 further record"},
      {"poses.ptx", lossy::ptx("3\n1\n"), poses, "poses of scans"},
      {"grid.ptx", lossy::ptx("2\n2\n", "1 1 1 0.5\n"), grid, "columns and rows of scans"},
      {"poses.e57", lossy::e57(), poses, "poses of scans"},
      {"descriptions.e57", lossy::e57(), records, "descriptions of scans"},
      {"invalid.ptx",
       "3\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n0 0 0 0.5\n7 8 9 0.5\n",
       invalid_points, ""},
      {"invalid_in_mesh.obj", "v 1 2 3\nv nan nan nan\nv 7 8 9\nv 1 1 1\nf 1 3 4\n", invalid_points, ""},
      {"invalid.xyz", "1 2 3\nnan nan nan\n7 8 9\n", invalid_points, ""},
  };
  return all;
}

}  // namespace pointfair::test
