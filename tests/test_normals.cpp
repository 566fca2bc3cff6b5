// SPDX-License-Identifier: Apache-2.0
// Normals in files: found under their names, replaced in place, their sign kept or chosen.
#include <cmath>

#include "e57_files.h"
#include "io_files.h"
#include "las_files.h"
#include "pointfair/normals.hpp"

namespace pointfair::test {
namespace {

const std::string kPly =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";

std::vector<Point> up(std::size_t count) { return std::vector<Point>(count, Point{0, 0, 1}); }

// z of the normals as a file in this format has them after they were set.
std::vector<float> written_z(Cloud cloud, Format format, const std::string& name, std::vector<Point> normals,
                             std::optional<Encoding> encoding = {}) {
  set_normals(cloud, normals);
  const Cloud again = parse(image(cloud, format, encoding), name);
  const std::vector<std::string> names = normal_attributes(again);
  EXPECT_EQ(names.size(), 3U) << name;
  if (names.size() != 3) return {};
  const Attribute z = attribute(again, names[2]);
  std::vector<float> values;
  for (std::size_t i = 0; i < again.points.size(); ++i) {
    if (z.type == ScalarType::float64) {
      double value;
      std::memcpy(&value, z.data.data() + 8 * i, 8);
      values.push_back(static_cast<float>(value));
    } else {
      float value;
      std::memcpy(&value, z.data.data() + 4 * i, 4);
      values.push_back(value);
    }
  }
  return values;
}

}  // namespace

TEST(Normals, AreFoundUnderTheNamesOfFormatsAndPrograms) {
  const auto names_in = [](const std::string& first) {
    return normal_attributes(parse("x,y,z," + first + "\n1,2,3,0,0,1.5\n", "a.csv"));
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names_in("nx,ny,nz"), (Names{"nx", "ny", "nz"}));
  EXPECT_EQ(normal_attributes(parse(kPly + "property char nx\nproperty char ny\nproperty char nz\nend_header\n" +
                                    "1 2 3 0 0 1\n1 2 3 0 0 1\n1 2 3 0 0 1\n")),
            Names{});  // a byte holds no normal
  EXPECT_EQ(normal_attributes(parse("x,y,z,NormalX,NormalY,NormalZ\n1,2,3,.5,.5,.5\n", "a.csv")),
            (Names{"NormalX", "NormalY", "NormalZ"}));
  EXPECT_EQ(normal_attributes(parse("x,y,z,normal_z,normal_x,normal_y\n1,2,3,.5,.5,.5\n", "a.csv")),
            (Names{"normal_x", "normal_y", "normal_z"}));
  EXPECT_EQ(normal_attributes(parse("1 2 3\n", "a.xyz")), Names{});
}

TEST(Normals, ReplaceThoseOfTheFileAndKeepTheirSign) {
  const std::string rows = "0 0 0 0.6 0 0.8 7\n1 0 0 0 0.6 -0.8 8\n0 1 9 0 0 0.5 9\n";
  const Cloud cloud =
      parse(kPly + "property float nx\nproperty double ny\nproperty float nz\nproperty int id\nend_header\n" + rows);
  std::vector<Point> normals = up(3);
  normals[2] = {0, 0, 0};  // there is none
  for (const auto encoding : {Encoding::ascii, Encoding::binary, Encoding::binary_big_endian})
    EXPECT_EQ(written_z(cloud, Format::ply, "a.ply", normals, encoding), (std::vector<float>{1, -1, 0.5F}));
  EXPECT_EQ(written_z(parse(image(cloud, Format::ply, Encoding::binary)), Format::ply, "a.ply", normals),
            (std::vector<float>{1, -1, 0.5F}));
  EXPECT_EQ(written_z(cloud, Format::csv, "a.csv", normals), (std::vector<float>{1, -1, 0.5F}));
  Cloud changed = cloud;
  set_normals(changed, normals);
  EXPECT_EQ(image(changed, Format::ply),
            kPly + "property float nx\nproperty double ny\nproperty float nz\nproperty int id\nend_header\n" +
                "0 0 0 0 0 1 7\n1 0 0 0 0 -1 8\n0 1 9 0 0 0.5 9\n");
}

TEST(Normals, AreReplacedInBinaryPcdAndLasAndE57) {
  const std::string header =
      "FIELDS x y z normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4\nTYPE F F F F F F\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ";
  const Cloud ascii = parse(header + "ascii\n1 2 3 0 0 -0.5\n4 5 6 0 0 0.5\n", "a.pcd");
  for (const auto encoding : {Encoding::ascii, Encoding::binary, Encoding::binary_compressed}) {
    const Cloud cloud = parse(image(ascii, Format::pcd, encoding), "a.pcd");
    EXPECT_EQ(written_z(cloud, Format::pcd, "a.pcd", up(2)), (std::vector<float>{-1, 1}));
  }
  Cloud las = parse(make_las(LasSpec{}), "a.las");
  set_normals(las, up(100));  // as extra bytes
  const Cloud with = parse(image(las, Format::las), "a.las");
  std::vector<Point> down(100, Point{0, 0, -0.75F});
  EXPECT_EQ(written_z(with, Format::las, "a.las", down), std::vector<float>(100, 0.75F));
  E57Scan scan;
  for (const char* name : {"cartesianX", "cartesianY", "cartesianZ"})
    scan.fields.push_back({name, "single", {1, 2, 3}, 0, 0, 1, 0, ""});
  for (const char* name : {"nor:normalX", "nor:normalY", "nor:normalZ"})
    scan.fields.push_back({name, "single", {0.5, -0.5, 0.5}, 0, 0, 1, 0, ""});
  EXPECT_EQ(written_z(parse(make_e57({scan}, 7), "a.e57"), Format::e57, "a.e57", up(3)),
            (std::vector<float>{1, -1, 1}));
}

TEST(Normals, LookTowardsTheSensorWhereTheFileKnowsIt) {
  const auto pcd = [](const std::string& viewpoint) {
    return parse("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nVIEWPOINT " + viewpoint +
                     " 1 0 0 0\nPOINTS 2\nDATA ascii\n0 0 1\n0 0 -1\n",
                 "a.pcd");
  };
  EXPECT_EQ(written_z(pcd("0 0 5"), Format::pcd, "a.pcd", up(2)), (std::vector<float>{1, 1}));
  EXPECT_EQ(written_z(pcd("0 0 -5"), Format::pcd, "a.pcd", up(2)), (std::vector<float>{-1, -1}));
  EXPECT_EQ(written_z(pcd("0 0 0"), Format::pcd, "a.pcd", up(2)), (std::vector<float>{1, -1}));  // the default: outward
  E57Scan above, below;
  for (E57Scan* scan : {&above, &below}) {
    for (const char* name : {"cartesianX", "cartesianY", "cartesianZ"})
      scan->fields.push_back({name, "single", {0, 0.25}, 0, 0, 1, 0, ""});
    scan->pose = std::string("<pose type=\"Structure\"><translation type=\"Structure\"><z type=\"Float\">") +
                 (scan == &above ? "9" : "-9") + "</z></translation></pose>";
  }
  Cloud cloud = parse(make_e57({above, below}), "a.e57");
  for (Point& p : cloud.points) p.z = 0;
  set_normals(cloud, up(4));
  const auto normals = values<float>(cloud, "normal");
  EXPECT_EQ((std::vector<float>{normals[2], normals[5], normals[8], normals[11]}), (std::vector<float>{1, 1, -1, -1}));
}

TEST(Normals, LookOutwardElse) {
  Cloud sphere;
  for (const float z : {-1.0F, 1.0F}) sphere.points.push_back({0.1F, 0, z});
  set_normals(sphere, up(2));
  EXPECT_EQ(values<float>(sphere, "normal")[2], -1);
  EXPECT_EQ(values<float>(sphere, "normal")[5], 1);
  Cloud landscape;
  for (const float x : {-50.0F, 50.0F}) landscape.points.push_back({x, x, x / 10});
  set_normals(landscape, std::vector<Point>(2, Point{0, 0.6F, -0.8F}));
  EXPECT_EQ(values<float>(landscape, "normal")[2], 0.8F);
  EXPECT_EQ(values<float>(landscape, "normal")[5], 0.8F);
}

TEST(Normals, AsManyAsPoints) {
  Cloud cloud = parse("1 2 3\n4 5 6\n", "a.xyz");
  EXPECT_EQ(thrown_by([&] { set_normals(cloud, up(1)); }).kind, ErrorKind::usage);
}

}  // namespace pointfair::test
