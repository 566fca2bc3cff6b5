// SPDX-License-Identifier: Apache-2.0
// STL meshes, NumPy arrays, and the plain floats of KITTI and nuScenes; file images made by the plainest code.
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "io_files.h"

namespace pointfair::test {
namespace {

struct Facet {
  float normal[3], corners[9];
};

const Facet kFacets[] = {{{0, 0, 1}, {0, 0, 0, 1, 0, 0, 0, 1, 0}},
                         {{0, -1, 0}, {0, 0, 0, 0.1F, 0, 1, 1, 0, 0}},
                         {{0, 0, 0}, {5, 5, 5, 6, 5, 5, 5, 6, 5}}};

std::string binary_stl(std::size_t facets = 3) {
  std::string bytes = "solid, but binary all the same";
  bytes.resize(80, ' ');
  bytes += packed<std::uint32_t>({static_cast<std::uint32_t>(facets)});
  for (std::size_t f = 0; f < facets; ++f) {
    for (const float value : kFacets[f].normal) bytes += packed<float>({value});
    for (const float value : kFacets[f].corners) bytes += packed<float>({value});
    bytes += packed<std::uint16_t>({static_cast<std::uint16_t>(f)});
  }
  return bytes;
}

std::string text_stl(const std::string& line_end = "\n") {
  std::string text = "solid a part" + line_end;
  for (const Facet& facet : kFacets) {
    char line[120];
    std::snprintf(line, sizeof line, "  facet normal %g %g %g", double(facet.normal[0]), double(facet.normal[1]),
                  double(facet.normal[2]));
    text += line + line_end + "    outer loop" + line_end;
    for (int c = 0; c < 3; ++c) {
      const float* const p = facet.corners + 3 * c;
      std::snprintf(line, sizeof line, "      vertex %e %.3f  %g", double(p[0]), double(p[1]), double(p[2]));
      text += line + line_end;
    }
    text += "    endloop" + line_end + "  endfacet" + line_end;
  }
  return text + "endsolid a part" + line_end;
}

void expect_corners(const Cloud& cloud) {
  ASSERT_EQ(cloud.points.size(), 9U);
  for (std::size_t i = 0; i < 9; ++i) {
    const float* const p = kFacets[i / 3].corners + i % 3 * 3;
    EXPECT_EQ(cloud.points[i].x, p[0]);
    EXPECT_EQ(cloud.points[i].y, p[1]);
    EXPECT_EQ(cloud.points[i].z, p[2]);
  }
  const auto faces = triangles(cloud);
  ASSERT_EQ(faces.size(), 3U);
  EXPECT_EQ(faces[2], (std::array<std::uint32_t, 3>{6, 7, 8}));
}

// What numpy.save writes: checked against it by tests/outside/test_formats.py.
std::string npy(const std::string& type, const std::string& shape, const std::string& data, bool fortran = false,
                char version = 1) {
  std::string header =
      "{'descr': " + type + ", 'fortran_order': " + (fortran ? "True" : "False") + ", 'shape': " + shape + ", }";
  header.resize(245, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY", 6);
  bytes += version;
  bytes += '\0';
  bytes += version == 1 ? packed<std::uint16_t>({246}) : packed<std::uint32_t>({246});
  return bytes + header + data;
}

void expect_prefixes_refused(const std::string& bytes, const std::string& name, Format format) {
  for (std::size_t size = 1; size < bytes.size(); ++size) refusal(bytes.substr(0, size), name, format);
}

}  // namespace

TEST(Stl, CornersArePointsAndFacetsFaces) {
  expect_corners(parse(binary_stl(), "a.stl"));
  expect_corners(parse(text_stl(), "a.stl"));
  expect_corners(parse(text_stl("\r\n"), "a.stl"));
  expect_corners(parse(binary_stl(), "misnamed.xyz"));
  expect_corners(parse(text_stl(), "misnamed.xyz"));
  std::string capitals = text_stl();
  for (char& c : capitals) c = static_cast<char>(std::toupper(c));
  expect_corners(parse(capitals, "a.stl"));
  expect_corners(parse(text_stl() + text_stl().substr(0, 0), "a.stl"));
  EXPECT_EQ(parse(text_stl() + text_stl(), "a.stl").points.size(), 18U);
}

TEST(Stl, AnUntouchedFileComesBackByteForByte) {
  for (const std::string& bytes : {binary_stl(), text_stl(), text_stl("\r\n")})
    EXPECT_EQ(image(parse(bytes, "a.stl"), Format::stl), bytes);
}

TEST(Stl, AMovedCornerTakesTheNormalWithIt) {
  std::string long_text = "solid\n";
  for (int i = 0; i < 4000; ++i) {
    const std::string part = text_stl();
    const std::size_t begin = part.find('\n') + 1;
    long_text += part.substr(begin, part.rfind("endsolid") - begin);
  }
  long_text += "endsolid";
  for (const std::string& bytes : {binary_stl(), text_stl(), long_text}) {
    Cloud cloud = parse(bytes, "a.stl");
    const std::size_t last = cloud.points.size() - 9;
    cloud.points[last + 2] = {0, 0, 1};  // of the first facet, which now looks to -y
    cloud.points[last + 8].z = 6;        // of the last one
    const std::string moved = image(cloud, Format::stl);
    const Cloud again = parse(moved, "a.stl");
    ASSERT_EQ(again.points.size(), cloud.points.size());
    EXPECT_EQ(std::memcmp(again.points.data(), cloud.points.data(), cloud.points.size() * sizeof(Point)), 0);
    if (bytes == binary_stl()) {
      float normal[3];
      std::memcpy(normal, moved.data() + 84, 12);
      EXPECT_EQ(normal[1], -1);
      EXPECT_EQ(normal[2], 0);
      std::memcpy(normal, moved.data() + 84 + 100, 12);
      EXPECT_EQ(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2],
                0);  // as the file leaves it open
      EXPECT_EQ(moved.substr(84 + 50, 50), bytes.substr(84 + 50, 50));
    } else {
      EXPECT_NE(moved.find("facet normal 0 -1 0"), std::string::npos);
    }
  }
}

TEST(Stl, MeshesOfOtherFormatsBecomeTriangles) {
  const Cloud mesh = parse(
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n9 9 9\n"
      "4 0 1 2 3\n3 0 2 1\n");
  const std::string binary = image(mesh, Format::stl), text = image(mesh, Format::stl, Encoding::ascii);
  EXPECT_EQ(binary.size(), 84U + 3 * 50);
  EXPECT_EQ(text.substr(0, 53), "solid pointfair\nfacet normal 0 0 1\n outer loop\n  vert");
  for (const std::string& bytes : {binary, text}) {
    const Cloud there = parse(bytes, "a.stl");
    ASSERT_EQ(there.points.size(), 9U);
    EXPECT_EQ(there.points[4].x, 1);
    EXPECT_EQ(there.points[4].y, 1);
    EXPECT_EQ(triangles(parse(image(there, Format::ply))).size(), 3U);
  }
  EXPECT_EQ(image(parse(binary, "a.stl"), Format::stl, Encoding::ascii), text);
  EXPECT_FALSE(losses(mesh, Format::stl).empty());
  EXPECT_EQ(thrown_by([] { image(parse("1 2 3\n", "a.xyz"), Format::stl); }).kind, ErrorKind::usage);
}

TEST(Stl, DamagedFilesAreRefusedInOneLine) {
  expect_prefixes_refused(binary_stl(), "cut.stl", Format::stl);
  const std::string text = text_stl();
  for (std::size_t size = 1; size + 8 < text.size(); ++size) refusal(text.substr(0, size), "cut.stl", Format::stl);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string other = text;
    other.replace(other.rfind(from), from.size(), to);
    return refusal(other, "a.stl");
  };
  changed("endsolid a part", "");
  changed("vertex", "vertez");
  changed("facet normal", "facette");
  EXPECT_NE(changed("6.000  5", "6.0.0 5").find("line 20"), std::string::npos);
  refusal("solid empty\nendsolid empty\n", "a.stl");
}

TEST(Npy, ArraysOfEveryNumberAreRead) {
  const Cloud floats = parse(npy("'<f4'", "(2, 3)", packed<float>({1, 2, 3, 4.5F, 5, NAN})), "a.npy");
  ASSERT_EQ(floats.points.size(), 2U);
  EXPECT_EQ(floats.points[1].x, 4.5F);
  EXPECT_TRUE(std::isnan(floats.points[1].z));
  EXPECT_TRUE(attributes(floats).empty());
  const Cloud doubles = parse(npy("'>f8'", "(2, 4)", packed<double>({1, 2, 3, 7, 4, 5, 6, 8}, true)), "a.npy");
  EXPECT_EQ(doubles.points[1].y, 5);
  EXPECT_EQ(values<double>(doubles, "column_4"), (std::vector<double>{7, 8}));
  const Cloud shorts = parse(npy("'<i2'", "(2, 1, 3)", packed<std::int16_t>({1, 2, 3, -4, 5, 6}), false, 2), "a.npy");
  EXPECT_EQ(shorts.points[1].x, -4);
  const Cloud columns = parse(npy("'<f4'", "(2, 3)", packed<float>({1, 4, 2, 5, 3, 6}), true), "misnamed.xyz");
  EXPECT_EQ(columns.points[0].z, 3);
  EXPECT_EQ(columns.points[1].x, 4);
}

const std::string kRecords =
    npy("[('id', '<u2'), ('y', '<f8'), ('X', '<f4'), ('z', '<f4'), ('note', 'S3'), ('rgb', '|u1', (3,)), ('', '|V1')]",
        "(2,)",
        packed<std::uint16_t>({7}) + packed<double>({2}) + packed<float>({1, 3}) +
            "abc"
            "\1\2\3"
            "?" +
            packed<std::uint16_t>({8}) + packed<double>({5}) + packed<float>({4, 6}) +
            "def"
            "\4\5\6"
            "!");

TEST(Npy, RecordsHaveAttributes) {
  const Cloud cloud = parse(kRecords, "a.npy");
  ASSERT_EQ(cloud.points.size(), 2U);
  EXPECT_EQ(cloud.points[1].x, 4);
  EXPECT_EQ(cloud.points[1].y, 5);
  EXPECT_EQ(cloud.points[1].z, 6);
  EXPECT_EQ(values<std::uint16_t>(cloud, "id"), (std::vector<std::uint16_t>{7, 8}));
  EXPECT_EQ(values<std::uint8_t>(cloud, "rgb"), (std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(attributes(cloud).size(), 2U);
}

TEST(Npy, UntouchedFilesComeBackAndMovedPointsAreMoved) {
  for (const std::string& bytes : {kRecords, npy("'<f4'", "(2, 3)", packed<float>({1, 4, 2, 5, 3, 6}), true),
                                   npy("'>f8'", "(2, 4)", packed<double>({1, 2, 3, 7, 4, 5, 6, 8}, true)) + "tail"}) {
    Cloud cloud = parse(bytes, "a.npy");
    EXPECT_EQ(image(cloud, Format::npy), bytes);
    cloud.points[1].y = 9;
    const std::string moved = image(cloud, Format::npy);
    EXPECT_EQ(moved.size(), bytes.size());
    EXPECT_EQ(parse(moved, "a.npy").points[1].y, 9);
    EXPECT_EQ(parse(moved, "a.npy").points[0].y, cloud.points[0].y);
  }
}

TEST(Npy, EmptyPixelsOfAnImageAreInvalidAndKeepTheirBytes) {
  const std::string rows = packed<float>({0, 0, 0, 1, 0, 2, 0, 1, 2, 1, 1, 2});
  for (const char* shape : {"(2, 2, 3)", "(4, 3)"}) {
    Cloud cloud = parse(npy("'<f4'", shape, rows), "a.npy");
    EXPECT_EQ(std::isnan(cloud.points[0].x), shape[4] == '2') << shape;
    EXPECT_FALSE(std::isnan(cloud.points[1].x));
    cloud.points[1].z = 3;
    EXPECT_NE(image(cloud, Format::npy).find(packed<float>({0, 0, 0, 1, 0, 3})), std::string::npos) << shape;
    EXPECT_EQ(image(cloud, Format::xyz).substr(0, 6), "0 0 0\n") << shape;
  }
}

TEST(Npy, OtherCloudsAndAddedAttributesBecomeRecords) {
  const std::string plain = image({.points = {{1.5F, 2, 3}, {4, 5, 6}}}, Format::npy);
  EXPECT_NE(plain.find("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }"), std::string::npos);
  EXPECT_EQ((plain.size() - 24) % 64, 0U);
  Cloud again = parse(plain, "a.npy");
  EXPECT_EQ(again.points[1].z, 6);
  again.added = {make_attribute<float>("normal", ScalarType::float32, {0, 0, 1, 0, 1, 0}, 3)};
  const Cloud records = parse(image(again, Format::npy), "a.npy");
  EXPECT_EQ(records.points[0].x, 1.5F);
  EXPECT_EQ(values<float>(records, "normal"), (std::vector<float>{0, 0, 1, 0, 1, 0}));
}

TEST(Npy, DamagedFilesAreRefusedInOneLine) {
  expect_prefixes_refused(kRecords, "cut.npy", Format::npy);
  const std::string six = packed<float>({1, 2, 3, 4, 5, 6});
  for (const auto& [type, shape] :
       std::vector<std::pair<std::string, std::string>>{{"'<f4'", "(6,)"},
                                                        {"'<f4'", "(3, 2)"},
                                                        {"'<f4'", "(3, 3)"},
                                                        {"'<f4'", "(2, 3"},
                                                        {"'<f4'", "()"},
                                                        {"'<f4'", "(0, 3)"},
                                                        {"'<f4'", "(9999999999999, 3)"},
                                                        {"'<f4'", "(4294967296, 4294967296, 3)"},
                                                        {"'|O'", "(2, 3)"},
                                                        {"'<c8'", "(1, 3)"},
                                                        {"''", "(2, 3)"},
                                                        {"[('x', '<f4')]", "(6,)"},
                                                        {"[('x', '<f4'), ('y', '<f4'), ('z', '>f4')]", "(2,)"},
                                                        {"[('x', [('y', '<f4')])]", "(2,)"}})
    refusal(npy(type, shape, six), "a.npy");
  refusal(npy("'<f4'", "(2, 3)", six, false, 9), "a.npy");
  refusal(npy("'<f4'", "(1, 2, 3)", six, true), "a.npy");
}

std::string bytes_of(const std::vector<float>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)};
}

// A turn of a lidar: points at 8 to 12 m, and `zeros` where nothing came back.
std::vector<float> turn_of_lidar(std::size_t zeros) {
  std::vector<float> values;
  for (std::size_t i = 0; i < 400; ++i) {
    const auto angle = float(i);
    const float range = 8 + float(i % 5);
    for (const float value : {range * std::cos(angle), range * std::sin(angle), -1.7F, 0.5F}) values.push_back(value);
    if (i < zeros) values.insert(values.end(), 4, 0.0F);
  }
  return values;
}

std::size_t count_invalid(const Cloud& cloud) {
  return std::size_t(std::ranges::count_if(cloud.points, [](const Point& p) { return !std::isfinite(p.x); }));
}

TEST(PlainFloats, ZerosWhereNothingIsNearAreNoPoints) {
  const std::string pcd_head =
      "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\n";
  for (const std::size_t zeros : {0U, 1U, 2U, 300U}) {
    const std::vector<float> values = turn_of_lidar(zeros);
    const std::string floats = bytes_of(values), points = std::to_string(values.size() / 4);
    const std::string pcd = pcd_head + "WIDTH " + points + "\nPOINTS " + points + "\nDATA binary\n" + floats;
    for (const auto& [file, name, format] : {std::tuple{floats, "0.bin", Format::kitti}, {pcd, "0.pcd", Format::pcd}}) {
      const Cloud cloud = parse(file, name, format);
      EXPECT_EQ(count_invalid(cloud), zeros < 2 ? 0 : zeros) << zeros;
      EXPECT_EQ(image(cloud, format), file);
      std::vector<Position> written(cloud.points.size());
      positions(parse(image(cloud, Format::ply), "0.ply"), written);
      EXPECT_EQ(std::size_t(std::ranges::count(written, Position{})), zeros)
          << "in another format they are zeros again";
    }
  }
}

// As numpy.save writes them: version 1 is Latin-1.
TEST(Npy, NamesBeforeVersion3AreLatin1AndFieldsThatAreNotReadAreTold) {
  std::string header =
      "{'descr': [('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('h\xF6he', '<f4'), ('half', '<f2'), ('label', '<U1')], "
      "'fortran_order': False, 'shape': (1,), }";
  header += std::string(117 - header.size() % 64 + 64, ' ') + "\n";
  std::string bytes("\x93NUMPY\1\0", 8);
  bytes += static_cast<char>(header.size() & 255);
  bytes += static_cast<char>(header.size() >> 8);
  const Cloud cloud = parse(bytes + header + packed<float>({1, 2, 3, 4}) +
                                std::string("\0\x3C"
                                            "a\0\0\0",
                                            6),
                            "a.npy");
  EXPECT_EQ(values<float>(cloud, "h\xC3\xB6he"), std::vector<float>{4});
  EXPECT_EQ(
      losses(cloud, Format::ply),
      (std::vector<std::string>{"PLY files have no place for the field 'half' of a type that is not read, the field "
                                "'label' of a type that is not read"}));
  EXPECT_TRUE(losses(cloud, Format::npy).empty());
}

TEST(PlainFloats, ASurfaceThroughTheOriginKeepsItsPointsThere) {
  std::vector<float> values;
  for (int copy = 0; copy < 3; ++copy)
    for (int x = -10; x <= 10; ++x)
      for (int y = -10; y <= 10; ++y) values.insert(values.end(), {float(x), float(y), 0, 0});
  EXPECT_EQ(count_invalid(parse(bytes_of(values), "0.bin", Format::kitti)), 0);
  EXPECT_EQ(count_invalid(parse(bytes_of(std::vector<float>(40)), "0.bin", Format::kitti)), 0) << "nothing else";
}

// Every second of 16,384 points is far, the others lie on a surface through the origin: more of them are near than
// there are zeros.
TEST(PlainFloats, WhetherZerosAreEmptyReturnsDoesNotFollowFromTheOrderOfPoints) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal(0, 1);
  std::vector<std::array<float, 4>> rows;
  for (int i = 0; i < 8192; ++i) {
    rows.push_back({20 + normal(random), normal(random), normal(random), 0});
    rows.push_back({normal(random) / 20, normal(random) / 20, normal(random) / 20, 0});
  }
  for (int i = 0; i < 200; ++i) rows.push_back({});
  const auto invalid = [&] {
    std::vector<float> values;
    for (const auto& row : rows) values.insert(values.end(), row.begin(), row.end());
    return count_invalid(parse(bytes_of(values), "0.bin", Format::kitti));
  };
  EXPECT_EQ(invalid(), 0);
  std::shuffle(rows.begin(), rows.end(), random);
  EXPECT_EQ(invalid(), 0);
}

TEST(PlainFloats, KittiAndNuscenesAreReadWhereTheyAreNamed) {
  const std::string kitti = packed<float>({1, 2, 3, 0.5F, 4, 5, 6, 0.25F}),
                    nuscenes = packed<float>({1, 2, 3, 50, 7, 4, 5, 6, 60, 8});
  Cloud cloud = parse(kitti, "0.bin", Format::kitti);
  EXPECT_EQ(cloud.points[1].z, 6);
  EXPECT_EQ(values<float>(cloud, "intensity"), (std::vector<float>{0.5F, 0.25F}));
  EXPECT_EQ(image(cloud, Format::kitti), kitti);
  cloud.points[1].z = 7;
  EXPECT_EQ(image(cloud, Format::kitti), packed<float>({1, 2, 3, 0.5F, 4, 5, 7, 0.25F}));
  cloud.added = {make_attribute("mark", ScalarType::uint8, std::vector<std::uint8_t>{1, 2})};
  EXPECT_EQ(image(cloud, Format::kitti), packed<float>({1, 2, 3, 0.5F, 4, 5, 7, 0.25F}));
  ASSERT_EQ(losses(cloud, Format::kitti).size(), 1);
  EXPECT_NE(losses(cloud, Format::kitti)[0].find("mark"), std::string::npos);
  const Cloud frame = parse(nuscenes, "0.bin", Format::nuscenes);
  EXPECT_EQ(values<float>(frame, "ring"), (std::vector<float>{7, 8}));
  refusal(nuscenes, "0.bin", Format::kitti);
  refusal(kitti, "0.bin", Format::nuscenes);
  refusal(kitti, "0.bin");
  EXPECT_EQ(thrown_by([&] { image(frame, Format::kitti); }).kind, ErrorKind::usage);
}

}  // namespace pointfair::test
