// SPDX-License-Identifier: Apache-2.0
// Nothing vanishes without a note: from every format that holds a kind of thing to every other one, the thing is there
// afterwards, or a sentence says that it is lost.
#include <cmath>
#include <functional>

#include "e57_files.h"
#include "io/contents.hpp"
#include "io/source.hpp"
#include "io_files.h"
#include "las_files.h"
#include "pointfair/normals.hpp"

namespace pointfair::test {
namespace {

using io::ContentKind;

constexpr std::pair<Format, const char*> kTargets[] = {
    {Format::ply, "ply"}, {Format::pcd, "pcd"}, {Format::xyz, "xyz"}, {Format::txt, "txt"}, {Format::csv, "csv"},
    {Format::pts, "pts"}, {Format::off, "off"}, {Format::obj, "obj"}, {Format::las, "las"}, {Format::laz, "laz"},
    {Format::e57, "e57"}, {Format::ptx, "ptx"}, {Format::stl, "stl"}, {Format::npy, "npy"}, {Format::copc, "copc.laz"}};

/// A file with one kind of thing; whether another cloud has the thing, too; and a word of the sentence about its loss.
struct Thing {
  std::string name, bytes;
  ContentKind kind;
  std::function<bool(const Cloud&)> is_there;
  std::string word;
};

std::string ply(const std::string& properties, const std::string& body, const std::string& after = "",
                const std::string& before = "") {
  return "ply\nformat ascii 1.0\n" + before +
         "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n" + properties + after +
         "end_header\n" + body;
}

// The same with the triangle of its three points.
std::string mesh(const std::string& properties, const std::string& body) {
  return ply(properties, body + "3 0 1 2\n", "element face 1\nproperty list uchar int vertex_indices\n");
}

std::string pcd(const std::string& fields, const std::string& sizes, const std::string& types, const std::string& more,
                const std::string& body) {
  return "VERSION 0.7\nFIELDS x y z" + fields + "\nSIZE 4 4 4" + sizes + "\nTYPE F F F" + types + "\n" + more +
         "POINTS 3\nDATA ascii\n" + body;
}

// Under whatever name.
bool has_values(const Cloud& cloud, const std::vector<double>& wanted) {
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

bool has_name(const Cloud& cloud, const std::string& name) {
  for (const AttributeInfo& info : attributes(cloud))
    if (info.name == name) return true;
  return false;
}

bool holds(const Cloud& cloud, ContentKind kind) {
  for (const io::Content& content : cloud.source->contents())
    if (content.kind == kind) return true;
  return false;
}

std::vector<std::uint8_t> reds(const Cloud& cloud) {
  return values<std::uint8_t>(parse(image(cloud, Format::ply, Encoding::binary)), "red");
}

bool has_colors(const Cloud& cloud) {
  if (attributes(cloud).empty()) return false;
  const std::vector<double> red = {10, 20, 30};
  return has_values(cloud, red) || reds(cloud) == std::vector<std::uint8_t>{10, 20, 30};
}

// Whether an attribute of the first point is no number.
bool has_missing(const Cloud& cloud) {
  for (const AttributeInfo& info : attributes(cloud))
    if (info.type == ScalarType::float32 && std::isnan(values<float>(cloud, info.name)[0])) return true;
  return false;
}

// Three points of a file of records with a coordinate system, two others and a format of points.
std::string las(unsigned seed) {
  LasSpec spec;
  spec.count = 3;
  spec.seed = seed;
  std::string file = make_las(spec);
  return file;
}

std::string ptx(const std::string& size, const std::string& more = "") {
  return size + "1 2 3\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n1 2 3 1\n1 2 3 0.5\n4 5 6 0.25\n7 8 9 1\n" +
         more;
}

std::string npy(const std::string& field, const std::vector<float>& values) {
  std::string header =
      "{'descr': [('x', '<f4'), ('y', '<f4'), ('z', '<f4'), " + field + "], 'fortran_order': False, 'shape': (3,), }";
  header.resize(118, ' ');
  header.back() = '\n';
  std::string file = std::string("\x93NUMPY\x01\x00", 8) + packed<std::uint16_t>({118}) + header;
  for (std::size_t i = 0; i < 3; ++i)
    file += packed<float>({1.0F + 3 * static_cast<float>(i), 2, static_cast<float>(i), values[i]});
  return file;
}

std::string e57() {
  E57Scan scan;
  scan.pose =
      "<name type=\"String\">hall</name><pose type=\"Structure\"><translation type=\"Structure\"><x "
      "type=\"Float\">5</x></translation></pose>";
  for (const char* const name : {"cartesianX", "cartesianY", "cartesianZ"})
    scan.fields.push_back({name, "double", {1, 2, 4}, 0, 0, 1, 0, ""});
  return make_e57({scan});
}

bool has_integers(const Cloud& cloud) {
  return image(cloud, Format::csv).find("1234567890123456789") != std::string::npos;
}

const std::vector<Thing>& things() {
  const auto kind_is = [](ContentKind kind) { return [kind](const Cloud& cloud) { return holds(cloud, kind); }; };
  const std::string xyz = "1 2 3\n4 5 6\n7 8 9.5\n";
  const auto colors = [](const Cloud& cloud) { return has_colors(cloud); };
  const auto normals = [](const Cloud& cloud) {
    return !normal_attributes(cloud).empty() || has_values(cloud, {1, 0, 0});
  };
  const auto faces = [](const Cloud& cloud) { return triangles(cloud).size() == 1; };
  const auto texture = [](const Cloud& cloud) { return cloud.source->faces().texture.size() == 6; };
  const auto quality = [](const Cloud& cloud) { return has_values(cloud, {0.5, 0.25, -7}); };
  const auto fine = [](const Cloud& cloud) {
    return has_values(cloud, {1000, 2000, 65000}) ||
           has_values(cloud, {1000.0F / 65535, 2000.0F / 65535, 65000.0F / 65535});
  };
  const auto intensity = [](const Cloud& cloud) { return has_values(cloud, {-12.5, 3, 8}); };
  const auto wide = [](const Cloud& cloud) { return has_integers(cloud); };
  const auto some_colors = [](const Cloud& cloud) { return has_missing(cloud); };
  const auto invalid = [](const Cloud& cloud) { return cloud.points.size() > 1 && std::isnan(cloud.points[1].x); };
  static const std::vector<Thing> all = {
      {"colors.ply",
       ply("property uchar red\nproperty uchar green\nproperty uchar blue\n",
           "1 2 3 10 1 2\n4 5 6 20 1 2\n7 8 9 30 1 2\n"),
       ContentKind::colors, colors, "colours"},
      {"colors_of_mesh.ply",
       mesh("property uchar red\nproperty uchar green\nproperty uchar blue\n",
            "1 2 3 10 1 2\n4 5 6 20 1 2\n7 8 9.5 30 1 2\n"),
       ContentKind::colors, colors, "colours"},
      {"colors.csv", "x,y,z,r,g,b\n1,2,3,10,1,2\n4,5,6,20,1,2\n7,8,9,30,1,2\n", ContentKind::colors, colors, "colours"},
      {"colors.off", "COFF\n3 0 0\n1 2 3 10 1 2 255\n4 5 6 20 1 2 255\n7 8 9 30 1 2 255\n", ContentKind::colors, colors,
       "colours"},
      {"colors.obj", "v 1 2 3 10 1 2\nv 4 5 6 20 1 2\nv 7 8 9 30 1 2\n", ContentKind::colors, colors, "colours"},
      {"colors.pcd", pcd(" rgb", " 4", " U", "", "1 2 3 655618\n4 5 6 1310978\n7 8 9 1966338\n"), ContentKind::colors,
       colors, "colours"},
      {"fine.ply",
       ply("property ushort red\nproperty ushort green\nproperty ushort blue\n",
           "1 2 3 1000 1 2\n4 5 6 2000 1 2\n7 8 9 65000 1 2\n"),
       ContentKind::fine_colors, fine, "colours have more than 8 bits"},
      {"fine.csv", "x,y,z,red,green,blue\n1,2,3,1000,1,2\n4,5,6,2000,1,2\n7,8,9,65000,1,2\n", ContentKind::fine_colors,
       fine, "colours have more than 8 bits"},
      {"some_colors.obj", "v 1 2 3\nv 4 5 6 0 0 1\nv 7 8 9.5 1 0 0\nf 1 2 3\n", ContentKind::some_colors, some_colors,
       "without a colour"},
      {"normals_of_mesh.ply",
       mesh("property float nx\nproperty float ny\nproperty float nz\n", "1 2 3 1 0 0\n4 5 6 0 1 0\n7 8 9.5 0 0 1\n"),
       ContentKind::normals, normals, "normals"},
      {"normals.ply",
       ply("property float nx\nproperty float ny\nproperty float nz\n", "1 2 3 1 0 0\n4 5 6 0 1 0\n7 8 9 0 0 1\n"),
       ContentKind::normals, normals, "normals"},
      {"normals.obj", "v 1 2 3\nvn 1 0 0\nv 4 5 6\nvn 0 1 0\nv 7 8 9\nvn 0 0 1\n", ContentKind::normals, normals,
       "normals"},
      {"normals.off", "NOFF\n3 0 0\n1 2 3 1 0 0\n4 5 6 0 1 0\n7 8 9 0 0 1\n", ContentKind::normals, normals, "normals"},
      {"normals.xyzn", "1 2 3 1 0 0\n4 5 6 0 1 0\n7 8 9 0 0 1\n", ContentKind::normals, normals, "normals"},
      {"numbers.ply", ply("property float q\n", "1 2 3 0.5\n4 5 6 0.25\n7 8 9 -7\n"), ContentKind::numbers, quality,
       "q"},
      {"numbers_of_mesh.ply", mesh("property float q\n", "1 2 3 0.5\n4 5 6 0.25\n7 8 9.5 -7\n"), ContentKind::numbers,
       quality, "q"},
      {"numbers.npy", npy("('q', '<f4')", {0.5F, 0.25F, -7}), ContentKind::numbers, quality, "q"},
      {"numbers.csv", "x,y,z,q\n1,2,3,0.5\n4,5,6,0.25\n7,8,9,-7\n", ContentKind::numbers, quality, "q"},
      {"numbers.pcd", pcd(" q", " 4", " F", "", "1 2 3 0.5\n4 5 6 0.25\n7 8 9 -7\n"), ContentKind::numbers, quality,
       "q"},
      {"numbers.off", "STOFF\n3 0 0\n1 2 3 0.5 9\n4 5 6 0.25 9\n7 8 9 -7 9\n", ContentKind::numbers, quality, "s, t"},
      {"names.csv", "x,y,z,quality\n1,2,3,0.5\n4,5,6,0.25\n7,8,9,-7\n", ContentKind::names,
       [](const Cloud& cloud) { return has_name(cloud, "quality"); }, "quality"},
      {"intensity.ply", ply("property float intensity\n", "1 2 3 -12.5\n4 5 6 3\n7 8 9 8\n"), ContentKind::intensity,
       intensity, "intensity"},
      {"intensity.pts", "3\n1 2 3 -12.5\n4 5 6 3\n7 8 9 8\n", ContentKind::intensity, intensity, "intensity"},
      {"wide.csv", "x,y,z,t\n1,2,3,1234567890123456789\n4,5,6,2\n7,8,9,3\n", ContentKind::wide_integers, wide, "t"},
      {"wide.pcd", pcd(" t", " 8", " U", "", "1 2 3 1234567890123456789\n4 5 6 2\n7 8 9 3\n"),
       ContentKind::wide_integers, wide, "t"},
      {"wide.ply", ply("property int64 t\n", "1 2 3 1234567890123456789\n4 5 6 2\n7 8 9 3\n"),
       ContentKind::wide_integers, wide, "t"},
      {"words.csv", "x,y,z,label\n1,2,3,oak\n4,5,6,ash\n7,8,9,elm\n", ContentKind::text, kind_is(ContentKind::text),
       "label"},
      {"words.txt", "x y z label\n1 2 3 oak\n4 5 6 ash\n7 8 9 elm\n", ContentKind::text, kind_is(ContentKind::text),
       "label"},
      {"lists.ply", ply("property list uchar int views\n", "1 2 3 1 7\n4 5 6 0\n7 8 9 2 1 2\n"), ContentKind::lists,
       kind_is(ContentKind::lists), "views"},
      {"faces.stl",
       "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\nvertex 4 5 6\nvertex 7 8 "
       "9.5\nendloop\nendfacet\nendsolid\n",
       ContentKind::faces, faces, "1 face"},
      {"faces.ply", ply("", xyz + "3 0 1 2\n", "element face 1\nproperty list uchar int vertex_indices\n"),
       ContentKind::faces, faces, "1 face"},
      {"faces.off", "OFF\n3 1 0\n" + xyz + "3 0 1 2\n", ContentKind::faces, faces, "1 face"},
      {"faces.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nf 1 2 3\n", ContentKind::faces, faces, "1 face"},
      {"face_values.ply",
       ply("", xyz + "3 0 1 2 9\n", "element face 1\nproperty list uchar int vertex_indices\nproperty uchar flags\n"),
       ContentKind::face_values, kind_is(ContentKind::face_values), "flags"},
      {"face_values.off", "OFF\n3 1 0\n" + xyz + "3 0 1 2 255 0 0\n", ContentKind::face_values,
       kind_is(ContentKind::face_values), "colours of faces"},
      {"edges.ply", ply("", xyz + "0 1\n", "element edge 1\nproperty int vertex1\nproperty int vertex2\n"),
       ContentKind::elements, kind_is(ContentKind::elements), "edge"},
      {"strips.ply", ply("", xyz + "3 0 1 2\n", "element tristrips 1\nproperty list int int vertex_indices\n"),
       ContentKind::elements, kind_is(ContentKind::elements), "tristrips"},
      {"lines.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nl 1 2\n", ContentKind::elements, kind_is(ContentKind::elements),
       "1 line with edges"},
      {"texture.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n",
       ContentKind::texture_coordinates, texture, "texture coordinates"},
      {"texture.ply",
       ply("", xyz + "3 0 1 2 6 0 0 1 0 1 1\n",
           "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"),
       ContentKind::texture_coordinates, texture, "texture coordinates"},
      {"corners.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\nvn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 2//2 3//2\n",
       ContentKind::corner_normals, kind_is(ContentKind::corner_normals), "normals of corners"},
      {"material.obj", "mtllib bark.mtl\nv 1 2 3\nv 4 5 6\nv 7 8 9\nusemtl bark\nf 1 2 3\n", ContentKind::materials,
       kind_is(ContentKind::materials), "bark"},
      {"image.ply", ply("", xyz, "", "comment TextureFile bark.png\n"), ContentKind::materials,
       kind_is(ContentKind::materials), "bark.png"},
      {"groups.obj", "g trunk\nv 1 2 3\nv 4 5 6\nv 7 8 9\n", ContentKind::groups, kind_is(ContentKind::groups),
       "1 line that name"},
      {"comment.ply", ply("", xyz, "", "comment by hand\n"), ContentKind::comments, kind_is(ContentKind::comments),
       "1 comment"},
      {"comment.obj", "# by hand\nv 1 2 3\nv 4 5 6\nv 7 8 9\n", ContentKind::comments, kind_is(ContentKind::comments),
       "1 comment"},
      {"comment.off", "OFF\n3 0 0\n# by hand\n" + xyz, ContentKind::comments, kind_is(ContentKind::comments),
       "1 comment"},
      {"comment.csv", "x,y,z\n1,2,3\n# by hand\n4,5,6\n7,8,9\n", ContentKind::comments, kind_is(ContentKind::comments),
       "1 comment"},
      {"title.xyz", "Survey made by hand\n" + xyz, ContentKind::comments, kind_is(ContentKind::comments),
       "lines before the first row"},
      {"comment.pcd", "# by hand\n" + pcd("", "", "", "", xyz), ContentKind::comments, kind_is(ContentKind::comments),
       "line of the header"},
      {"pose.pcd", pcd("", "", "", "VIEWPOINT 1 2 3 1 0 0 0\n", xyz), ContentKind::poses, kind_is(ContentKind::poses),
       "place of the sensor"},
      {"grid.pcd", "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 3\nPOINTS 3\nDATA ascii\n" + xyz,
       ContentKind::grid, kind_is(ContentKind::grid), "grid of 1 x 3"},
      {"system.las", las(1), ContentKind::coordinate_system, kind_is(ContentKind::coordinate_system),
       "coordinate system"},
      {"records.las", las(1), ContentKind::records, kind_is(ContentKind::records), "1 further record"},
      {"poses.ptx", ptx("3\n1\n"), ContentKind::poses, kind_is(ContentKind::poses), "poses of scans"},
      {"grid.ptx", ptx("2\n2\n", "1 1 1 0.5\n"), ContentKind::grid, kind_is(ContentKind::grid),
       "columns and rows of scans"},
      {"poses.e57", e57(), ContentKind::poses, kind_is(ContentKind::poses), "poses of scans"},
      {"descriptions.e57", e57(), ContentKind::records, kind_is(ContentKind::records), "descriptions of scans"},
      {"invalid.ptx",
       "3\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n0 0 0 0.5\n7 8 9 0.5\n",
       ContentKind::invalid_points, invalid, ""},
      {"invalid_in_mesh.obj", "v 1 2 3\nv nan nan nan\nv 7 8 9\nv 1 1 1\nf 1 3 4\n", ContentKind::invalid_points,
       invalid, ""},
      {"invalid.xyz", "1 2 3\nnan nan nan\n7 8 9\n", ContentKind::invalid_points, invalid, ""},
  };
  return all;
}

bool told(const std::vector<std::string>& notes, const std::string& word) {
  for (const std::string& note : notes)
    if (note.find(word) != std::string::npos) return true;
  return false;
}

std::string joined(const std::vector<std::string>& notes) {
  std::string text;
  for (const std::string& note : notes) text += "\n  " + note;
  return text;
}

}  // namespace

TEST(FilesLosses, NothingVanishesWithoutANote) {
  for (const Thing& thing : things()) {
    const Cloud cloud = parse(thing.bytes, thing.name);
    for (const auto& [format, extension] : kTargets) {
      SCOPED_TRACE(thing.name + " to " + extension);
      const bool copied = io::is_copied(cloud, format);
      const bool has_place = format != Format::stl || !cloud.source->faces().ends.empty();
      // LAS becomes COPC with all its records
      const bool is_octree_of_las = format == Format::copc && cloud.source->format() == Format::las;
      const bool stays = copied || (is_octree_of_las && thing.kind == ContentKind::records);
      const io::Keeps keeps = stays ? io::Keeps::kept : !has_place ? io::Keeps::refused : io::keeps(format, thing.kind);
      if (keeps == io::Keeps::refused) {
        EXPECT_EQ(thrown_by([&] { image(cloud, format); }).kind, ErrorKind::usage);
        continue;
      }
      const Cloud there = parse(image(cloud, format), std::string("a.") + extension);
      const std::vector<std::string> notes = losses(cloud, format);
      EXPECT_TRUE(thing.is_there(there) || told(notes, thing.word)) << joined(notes);
      // and the table says the truth
      EXPECT_EQ(thing.is_there(there), keeps == io::Keeps::kept) << joined(notes);
      if (copied) {
        EXPECT_TRUE(notes.empty()) << joined(notes);
      }
    }
  }
}

TEST(FilesLosses, EveryKindIsTried) {
  std::vector<ContentKind> tried;
  for (const Thing& thing : things()) tried.push_back(thing.kind);
  for (std::size_t kind = 0; kind < io::kContentKinds; ++kind)
    EXPECT_NE(std::find(tried.begin(), tried.end(), static_cast<ContentKind>(kind)), tried.end()) << kind;
}

TEST(FilesLosses, PointsWithoutAColourAreTold) {
  const Cloud cloud = parse("v 1 2 3\nv 4 5 6 0 0 1\n", "a.obj");
  EXPECT_TRUE(told(losses(cloud, Format::ply), "1 point without a colour become white"));
  EXPECT_EQ(image(cloud, Format::ply, Encoding::ascii)
                .substr(image(cloud, Format::ply, Encoding::ascii).find("end_header\n") + 11),
            "1 2 3 255 255 255\n4 5 6 0 0 255\n");
  EXPECT_TRUE(losses(cloud, Format::csv).empty());
}

TEST(FilesLosses, ThePartsOfAnObjFileGoWhereTheyHaveAPlace) {
  const std::string obj =
      "mtllib a.mtl\nv 1 2 3\nv 4 5 6\nv 7 8 9\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nusemtl bark\nf 1/1/1 2/2/1 3/3/1\nl "
      "1 2\n";
  Cloud cloud = parse(obj, "a.obj");
  const std::string text = image(cloud, Format::ply, Encoding::ascii);
  EXPECT_NE(text.find("property list uchar float texcoord\n"), std::string::npos);
  EXPECT_NE(text.find("\n3 0 1 2 6 0 0 1 0 1 1\n"), std::string::npos);
  EXPECT_NE(text.find("\n1 2 3 0 0 1\n"), std::string::npos);
  const Cloud back = parse(image(parse(text), Format::obj), "b.obj");
  EXPECT_EQ(image(back, Format::ply, Encoding::ascii), text);
  cloud.points[0].x = 1.5F;  // in its own format all lines stay
  EXPECT_EQ(image(cloud, Format::obj), "mtllib a.mtl\nv 1.5 2 3" + obj.substr(obj.find("\nv 4")));
}

TEST(FilesLosses, NormalsOfAnObjFileAreNotRenewed) {
  Cloud cloud = parse("v 1 2 3\nvn 0 0 1\n", "a.obj");
  EXPECT_EQ(thrown_by([&] { check_new_normals(cloud); }).kind, ErrorKind::usage);
  check_new_normals(cloud, Format::ply);
  set_normals(cloud, std::vector<Point>{{1, 0, 0}});
  EXPECT_NE(thrown_by([&] { image(cloud, Format::obj); }).message.find("not renewed"), std::string::npos);
  EXPECT_NE(image(cloud, Format::ply, Encoding::ascii).find("1 2 3 1 0 0\n"), std::string::npos);
}

TEST(FilesLosses, AFileOfTrianglesHasSome) {
  for (const std::string face : {"f 1 2 3\n", "f 1 3\n", ""}) {
    const Cloud cloud = parse("v 1 2 3\nv nan nan nan\nv 7 8 9\n" + face, "a.obj");
    EXPECT_NE(thrown_by([&] { image(cloud, Format::stl); }).message.find("has no faces"), std::string::npos) << face;
  }
}

TEST(FilesLosses, StrictMakesALossAnError) {
  const Folder folder;
  const Cloud cloud = parse("x,y,z,label\n1,2,3,oak\n", "a.csv");
  WriteOptions options;
  options.strict = true;
  const Thrown thrown = thrown_by([&] { check_write(folder / "b.ply", cloud, options); });
  EXPECT_EQ(thrown.kind, ErrorKind::file);
  EXPECT_NE(thrown.message.find("b.ply: PLY files have no place for the column of words 'label'"), std::string::npos)
      << thrown.message;
  EXPECT_EQ(thrown_by([&] { write(folder / "b.ply", cloud, options); }).message, thrown.message);
  EXPECT_TRUE(folder.names().empty());
  write(folder / "b.csv", cloud, options);
}

TEST(FilesLosses, IntensityBecomesTheOneOfLas) {
  const auto written = [](const std::string& values) {
    const Cloud cloud = parse("x,y,z,Intensity\n1,2,3," + values + "\n4,5,6,1\n", "a.csv");
    const Cloud las = parse(image(cloud, Format::las), "a.las");
    EXPECT_FALSE(has_name(las, "intensity_2"));
    return test::values<std::uint16_t>(las, "intensity");
  };
  EXPECT_EQ(written("700"), (std::vector<std::uint16_t>{700, 1}));
  EXPECT_EQ(written("700.75"), (std::vector<std::uint16_t>{701, 1}));
  EXPECT_EQ(written("0.5"), (std::vector<std::uint16_t>{32768, 65535}));
  EXPECT_EQ(written("-4"), (std::vector<std::uint16_t>{0, 65535}));
}

}  // namespace pointfair::test
