// SPDX-License-Identifier: Apache-2.0
// From each format to each other: points, order, colours, normals, faces, scalars.
#include <cmath>

#include "io_cases.h"
#include "io_files.h"

namespace pointfair::test {
namespace {

const Format kFormats[] = {Format::ply, Format::pcd, Format::xyz, Format::txt, Format::csv,
                           Format::pts, Format::off, Format::obj, Format::ptx};
constexpr const char* kNames[] = {"a.ply", "a.pcd", "a.xyz", "a.txt", "a.csv", "a.pts", "a.off", "a.obj", "a.ptx"};

// A mesh of four points with everything that formats share.
Cloud colored_mesh() {
  return parse(
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\n"
      "property uchar blue\nproperty int class\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0.1 0.2 0.3 0 0 1 255 0 17 -5\n1.5 0 0 0 1 0 1 2 3 70000\n1.25 1 0 1 0 0 4 5 6 0\n0 1 -1e-5 0 0 -1 7 8 9 1\n"
      "4 0 1 2 3\n");
}

void expect_points(const Cloud& actual, const Cloud& expected) {
  ASSERT_EQ(actual.points.size(), expected.points.size());
  EXPECT_EQ(std::memcmp(actual.points.data(), expected.points.data(), expected.points.size() * sizeof(Point)), 0);
}

}  // namespace

TEST(FilesConvert, EveryFormatTurnsIntoEveryOther) {
  const Cloud mesh = colored_mesh();
  for (std::size_t from = 0; from < std::size(kFormats); ++from) {
    const Cloud first = parse(image(mesh, kFormats[from]), kNames[from]);
    expect_points(first, mesh);
    for (std::size_t to = 0; to < std::size(kFormats); ++to) {
      SCOPED_TRACE(std::string(kNames[from]) + " to " + kNames[to]);
      expect_points(parse(image(first, kFormats[to]), kNames[to]), mesh);
    }
  }
}

TEST(FilesConvert, AttributesGoWhereverTheyHaveAPlace) {
  const Cloud mesh = colored_mesh();
  for (const Format format : {Format::csv, Format::txt, Format::ply}) {
    const std::string name = kNames[static_cast<std::size_t>(format)];
    SCOPED_TRACE(name);
    Cloud there = parse(image(mesh, format, Encoding::ascii), name);
    const Cloud back = parse(image(there, Format::ply, Encoding::binary));
    for (const char* channel : {"red", "green", "blue"})
      EXPECT_EQ(values<std::uint8_t>(back, channel), values<std::uint8_t>(mesh, channel));
    EXPECT_EQ(values<std::int32_t>(back, "class"), values<std::int32_t>(mesh, "class"));
  }
  for (const Format format : {Format::off, Format::obj, Format::pcd}) {
    const std::string name = kNames[static_cast<std::size_t>(format)];
    SCOPED_TRACE(name);
    const Cloud back = parse(image(parse(image(mesh, format), name), Format::ply));
    for (const char* channel : {"red", "green", "blue"})
      EXPECT_EQ(values<std::uint8_t>(back, channel), values<std::uint8_t>(mesh, channel));
  }
}

// By their places, since there are no names.
TEST(FilesConvert, AttributesWithoutANameOrWithThatOfPaddingAreNotLost) {
  for (const char* name : {"", "_", " ", "\7"}) {
    const Cloud cloud{.points = {{0, 0, 1}, {1, 0, 2}},
                      .added = {make_attribute<std::int32_t>(name, ScalarType::int32, {7, -70000})}};
    for (const Format format : {Format::ply, Format::pcd, Format::csv, Format::npy, Format::e57, Format::las}) {
      SCOPED_TRACE(std::string("'") + name + "' in " + std::to_string(static_cast<int>(format)));
      const Cloud there = parse(image(cloud, format), "a", format);
      const std::vector<AttributeInfo> all = attributes(there);
      EXPECT_TRUE(std::ranges::any_of(all, [&](const AttributeInfo& info) {
        return info.type == ScalarType::int32 && values<std::int32_t>(there, info.name) == std::vector{7, -70000};
      }));
    }
    Cloud copy = parse(image(Cloud{.points = cloud.points}, Format::pcd), "a.pcd");
    copy.added = cloud.added;
    EXPECT_EQ(attributes(parse(image(copy, Format::pcd), "a.pcd")).size(), 1U) << name;
  }
}

TEST(FilesConvert, IntensityStandsBeforeColoursInPts) {
  for (const std::string names : {"red,green,blue,intensity", "Intensity,blue,red,green", "green,red,intensity,blue",
                                  "red,q,green,blue", "blue,green,red"}) {
    const std::string values =
        replaced(replaced(replaced(replaced(names, "red", "1"), "green", "2"), "blue", "3"), "q", "7");
    const std::string row = replaced(replaced(values, "intensity", "7"), "Intensity", "7");
    const Cloud cloud = parse("x,y,z," + names + "\n4,5,6," + row + "\n", "a.csv");
    const std::string text = image(cloud, Format::pts);
    EXPECT_EQ(text, names == "blue,green,red" ? "1\n4 5 6 1 2 3\n" : "1\n4 5 6 7 1 2 3\n") << names;
    const Cloud again = parse(text, "a.pts");
    EXPECT_EQ(test::values<std::uint8_t>(again, "red"), std::vector<std::uint8_t>{1}) << names;
    EXPECT_EQ(test::values<std::uint8_t>(again, "blue"), std::vector<std::uint8_t>{3}) << names;
  }
}

TEST(FilesConvert, OpacityGoesWithColoursWhereItLosesNothing) {
  const auto as_ply = [](const std::string& second) {
    return parse(image(parse("COFF\n2 0 0\n0 0 0 1 0 .2 1\n1 0 0 0 .4 1 " + second + "\n", "a.off"), Format::ply));
  };
  EXPECT_EQ(values<std::uint8_t>(as_ply(".6"), "alpha"), (std::vector<std::uint8_t>{255, 153}));
  EXPECT_EQ(values<float>(as_ply(".123456"), "alpha"), (std::vector<float>{1, .123456F}));
}

TEST(FilesConvert, FacesGoToEveryMeshFormat) {
  const Cloud mesh = colored_mesh();
  for (const Format format : {Format::ply, Format::off, Format::obj}) {
    const std::string name = kNames[static_cast<std::size_t>(format)];
    const Cloud there = parse(image(mesh, format), name);
    EXPECT_EQ(triangles(there), triangles(mesh)) << name;
    EXPECT_EQ(triangles(parse(image(there, Format::ply))), triangles(mesh)) << name;
  }
  EXPECT_NE(image(mesh, Format::off).find("\n4 0 1 2 3\n"), std::string::npos);  // a polygon, not its triangles
}

TEST(FilesConvert, ACloudFromMemoryIsWrittenInFloatsOrWithAnOriginInDoubles) {
  Cloud cloud{.points = {{1.5F, 2, 3}, {NAN, 5, 6}},
              .added = {make_attribute<float>("normal", ScalarType::float32, {0, 0, 1, 0, 1, 0}, 3)}};
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n";
  EXPECT_EQ(image(cloud, Format::ply, Encoding::ascii), header + "1.5 2 3 0 0 1\nnan 5 6 0 1 0\n");
  EXPECT_EQ(image(cloud, Format::csv), "x,y,z,nx,ny,nz\n1.5,2,3,0,0,1\nnan,5,6,0,1,0\n");
  cloud.added.clear();
  cloud.origin = {500000, 4000000, 0};
  EXPECT_EQ(image(cloud, Format::xyz), "500001.5 4000002 3\nnan 4000005 6\n");
  EXPECT_NE(image(cloud, Format::ply).find("property double x\n"), std::string::npos);
}

TEST(FilesConvert, MovedPointsAreMovedInEveryFormat) {
  Cloud mesh = colored_mesh();
  mesh.points[1].x = 2.75F;
  for (std::size_t to = 0; to < std::size(kFormats); ++to)
    expect_points(parse(image(mesh, kFormats[to]), kNames[to]), mesh);
}

}  // namespace pointfair::test
