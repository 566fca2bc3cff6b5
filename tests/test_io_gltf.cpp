// SPDX-License-Identifier: Apache-2.0
// glTF meshes, made by hand: containers, transforms, shared points, strips, and what is damaged.
#include <cmath>

#include "gltf_files.h"

namespace pointfair::test {
namespace {

// Four corners of a square, their normals and colours, and the indices of two triangles.
std::string buffer() {
  return packed<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) + packed<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}) +
         packed<std::uint8_t>({255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 9, 8, 7, 255}) +
         packed<std::uint16_t>({0, 1, 2, 0, 2, 3});
}

std::string document(const std::string& nodes, const std::string& primitive, const std::string& uri = {}) {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":)" + nodes +
         R"(,"meshes":[{"primitives":[)" + primitive + R"(]}],"accessors":[
    {"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
    {"bufferView":1,"componentType":5126,"count":4,"type":"VEC3"},
    {"bufferView":2,"componentType":5121,"normalized":true,"count":4,"type":"VEC4"},
    {"bufferView":3,"componentType":5123,"count":6,"type":"SCALAR"},
    {"bufferView":3,"componentType":5123,"count":4,"type":"SCALAR"}],
    "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":48},
    {"buffer":0,"byteOffset":96,"byteLength":16},{"buffer":0,"byteOffset":112,"byteLength":12}],
    "buffers":[{"byteLength":124)" +
         (uri.empty() ? std::string() : R"(,"uri":")" + uri + "\"") + "}]}";
}

const std::string kPrimitive = R"({"attributes":{"POSITION":0,"NORMAL":1,"COLOR_0":2},"indices":3})";

std::string glb(const std::string& json) { return test::glb(json, buffer()); }

std::string base64(const std::string& bytes) {
  const char* const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned bits = 0;
    for (std::size_t j = i; j < i + 3; ++j)
      bits = bits << 8 | (j < bytes.size() ? static_cast<unsigned char>(bytes[j]) : 0U);
    for (int d = 3; d >= 0; --d) text += std::size_t(3 - d) <= bytes.size() - i ? digits[bits >> 6 * d & 63] : '=';
  }
  return text;
}

}  // namespace

TEST(Gltf, VerticesArePointsAndTrianglesFaces) {
  const std::string plain = R"([{"mesh":0}])";
  const Folder folder;
  put_file(folder / "a b.bin", buffer());
  put_file(folder / "beside.gltf", document(plain, kPrimitive, "a%20b.bin"));
  for (const Cloud& cloud :
       {parse(glb(document(plain, kPrimitive)), "misnamed.xyz"),
        parse(document(plain, kPrimitive, "data:application/octet-stream;base64," + base64(buffer())), "a.gltf"),
        read(folder / "beside.gltf")}) {
    ASSERT_EQ(cloud.points.size(), 4U);
    EXPECT_EQ(cloud.points[2].x, 1);
    EXPECT_EQ(cloud.points[2].y, 1);
    EXPECT_EQ(triangles(cloud), (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}}));
    EXPECT_EQ(values<float>(cloud, "nz"), (std::vector<float>{1, 1, 1, 1}));
    EXPECT_EQ(values<std::uint8_t>(cloud, "green"), (std::vector<std::uint8_t>{0, 255, 0, 8}));
    EXPECT_NE(image(cloud, Format::ply).find("property float x\n"), std::string::npos);
    EXPECT_EQ(triangles(parse(image(cloud, Format::stl), "a.stl")).size(), 2U);
    EXPECT_EQ(values<std::uint8_t>(cloud, "alpha"), (std::vector<std::uint8_t>{255, 255, 255, 255}));
    EXPECT_EQ(losses(cloud, Format::ply), std::vector<std::string>());
  }
}

TEST(Gltf, AFileBesideThatIsMissingIsNamedWithTheOneThatNamesIt) {
  const Folder folder;
  put_file(folder / "beside.gltf", document(R"([{"mesh":0}])", kPrimitive, "a%20b.bin"));
  try {
    read(folder / "beside.gltf");
    FAIL() << "was read";
  } catch (const Error& error) {
    const std::string line = error.what();
    EXPECT_NE(line.find("beside.gltf: its buffer "), std::string::npos) << line;
    EXPECT_NE(line.find("a b.bin is not there"), std::string::npos) << line;
  }
}

TEST(Gltf, NodesTurnStretchAndShift) {
  // a quarter turn about z, twice as large along x, and a parent that shifts
  const std::string nodes =
      R"([{"translation":[10,20,30],"children":[1,2]},
          {"mesh":0,"rotation":[0,0,0.70710678118654752,0.70710678118654752],"scale":[2,1,1]},
          {"mesh":0,"matrix":[1,0,0,0, 0,0,1,0, 0,-1,0,0, 0,0,5,1]}])";
  const Cloud cloud = parse(glb(document(nodes, kPrimitive)), "a.glb");
  ASSERT_EQ(cloud.points.size(), 8U);
  const auto expect = [&](std::size_t i, double x, double y, double z) {
    EXPECT_NEAR(cloud.points[i].x + cloud.origin[0], x, 1e-6);
    EXPECT_NEAR(cloud.points[i].y + cloud.origin[1], y, 1e-6);
    EXPECT_NEAR(cloud.points[i].z + cloud.origin[2], z, 1e-6);
  };
  expect(2, 9, 22, 30);   // (2, 1, 0), turned to (-1, 2, 0)
  expect(6, 11, 20, 36);  // y became z
  const std::vector<float> ny = values<float>(cloud, "ny"), nz = values<float>(cloud, "nz");
  EXPECT_NEAR(nz[0], 1, 1e-6);
  EXPECT_NEAR(ny[4], -1, 1e-6);
  EXPECT_EQ(triangles(cloud)[3], (std::array<std::uint32_t, 3>{4, 6, 7}));
}

TEST(Gltf, MirroredMeshesKeepTheirOutside) {
  const Cloud cloud = parse(glb(document(R"([{"mesh":0,"scale":[-1,2,1]}])", kPrimitive)), "a.glb");
  EXPECT_EQ(triangles(cloud), (std::vector<std::array<std::uint32_t, 3>>{{1, 0, 2}, {2, 0, 3}}));
  EXPECT_EQ(values<float>(cloud, "nz"), (std::vector<float>{1, 1, 1, 1}));
}

TEST(Gltf, PrimitivesShareTheirPointsAndMayBeStripsAndFans) {
  const std::string node = R"([{"mesh":0}])", attributes = R"("attributes":{"POSITION":0})";
  const Cloud shared =
      parse(glb(document(node, "{" + attributes + R"(,"indices":3},{)" + attributes + R"(,"mode":0})")), "a.glb");
  EXPECT_EQ(shared.points.size(), 4U);
  EXPECT_EQ(triangles(shared).size(), 2U);
  const Cloud strip = parse(glb(document(node, "{" + attributes + R"(,"mode":5})")), "a.glb");
  EXPECT_EQ(triangles(strip), (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {2, 1, 3}}));
  const Cloud fan = parse(glb(document(node, "{" + attributes + R"(,"mode":6})")), "a.glb");
  EXPECT_EQ(triangles(fan), (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}}));
}

TEST(Gltf, PointsOfMeshesWithoutColoursAreWhite) {
  const std::string node = R"([{"mesh":0}])", colored = R"({"attributes":{"POSITION":0,"COLOR_0":2}})",
                    plain = R"({"attributes":{"POSITION":0}})", bytes = "\xFF\xFF\xFF\xFF";
  const auto greens = [&](const std::string& primitives) {
    const Cloud cloud = parse(glb(document(node, primitives)), "a.glb");
    const auto green = values<std::uint8_t>(cloud, "green");
    return std::string(green.begin(), green.end());
  };
  const std::string own("\0\xFF\0\x08", 4);
  EXPECT_EQ(greens(colored + "," + plain), own + bytes);
  EXPECT_EQ(greens(plain + "," + colored), bytes + own);
}

TEST(Gltf, WhatIsNotReadIsTold) {
  const auto told = [](const std::string& nodes, const std::string& primitive, const std::string& more = "") {
    std::string json = document(nodes, primitive);
    json.back() = ',';
    std::string all;
    for (const std::string& note : losses(parse(glb(json + "\"extras\":1" + more + "}"), "a.glb"), Format::ply))
      all += note + "\n";
    return all;
  };
  const std::string front = "PLY files have no place for ", node = R"([{"mesh":0}])";
  EXPECT_EQ(told(node, kPrimitive), "");
  EXPECT_EQ(told(R"([{"mesh":0,"name":"door"}])", kPrimitive), front + "1 name of a part\n");
  EXPECT_EQ(told(node, kPrimitive, R"(,"materials":[{},{}],"images":[{}])"), front + "2 materials, 1 image\n");
  EXPECT_EQ(told(node, kPrimitive, R"(,"animations":[{}],"extensionsUsed":["KHR_lights_punctual"])"),
            front + "1 animation, the extension KHR_lights_punctual\n");
  EXPECT_EQ(told(node, R"({"attributes":{"POSITION":0,"TANGENT":1},"targets":[{}]})"),
            front + "1 further shape of a mesh, the attribute TANGENT\n");
  EXPECT_EQ(told(node, R"({"attributes":{"POSITION":0},"mode":3})"), front + "1 mesh of lines\n");
  EXPECT_EQ(told(node, R"({"attributes":{"POSITION":0}}]},{"primitives":[{"attributes":{"POSITION":0}})"),
            front + "1 mesh that is not in the scene\n");
}

TEST(Gltf, DamagedFilesAreRefusedInOneLine) {
  const auto refused = [](const std::string& bytes) { return refusal(bytes, "a.glb", Format::glb); };
  const std::string whole = glb(document(R"([{"mesh":0}])", kPrimitive));
  for (std::size_t size = 1; size < whole.size(); ++size) refused(whole.substr(0, size));
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string json = document(R"([{"mesh":0}])", kPrimitive);
    const std::size_t at = json.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return refused(glb(json.replace(at, from.size(), to)));
  };
  with("\"count\":4", "\"count\":5");
  with("\"count\":4", "\"count\":-4");
  with("\"count\":4", "\"count\":18446744073709551615");
  with("\"byteLength\":48", "\"byteLength\":1e30");
  with("\"byteLength\":124", "\"byteLength\":125");
  with("\"bufferView\":0", "\"bufferView\":9");
  with("\"VEC3\"", "\"MAT4\"");
  with("5126", "5124");
  with("\"POSITION\":0", "\"POSITION\":3");
  with("{\"mesh\":0}", "{\"mesh\":0,\"children\":[0]}");
  with("\"indices\":3", "\"indices\":0");
  with("\"asset\"", "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],\"asset\"");
  with("{\"mesh\":0}", "{\"mesh\":0,\"scale\":[1]}");
  with("{\"mesh\":0}", "{}");
  refused("glTF" + packed<std::uint32_t>({1, 20, 0, 0}));
  EXPECT_NE(refused(document(R"([{"mesh":0}])", kPrimitive, "/etc/hostname")).find("not a file beside it"),
            std::string::npos);
}

}  // namespace pointfair::test
