// SPDX-License-Identifier: Apache-2.0
// The pictures of meshes: which ones files name, and where on the faces they lie.
#include <gtest/gtest.h>

#include <map>

#include "gltf_files.h"
#include "io_files.h"
#include "pointfair/texture.hpp"

namespace pointfair::test {
namespace {

// Files by name, and which of them were asked for.
struct Shelf {
  std::map<std::string, std::string> files;
  std::vector<std::string> asked;

  ReadNamed reader() {
    return [this](const std::string& name) {
      asked.push_back(name);
      const auto found = files.find(name);
      if (found == files.end()) throw Error(ErrorKind::file, name + ": is not there");
      return found->second;
    };
  }
};

std::vector<std::string> names(const Texture& texture) {
  std::vector<std::string> result;
  for (const TexturePicture& picture : texture.pictures) result.push_back(picture.name);
  return result;
}

using Names = std::vector<std::string>;
using Floats = std::vector<float>;
using Pictures = std::vector<std::uint32_t>;

const std::string kQuads =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n"
    "vt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 1\nvt 0.75 0.25\n";

TEST(Texture, ObjFacesHaveThePictureOfTheirMaterial) {
  const Cloud cloud = parse("mtllib things.mtl\nf 1 2 3\n" + kQuads +
                                "usemtl wood\nf 1/1 2/2 3/3 4/4\nusemtl plain\nf 2/1 5/2 6/3\n"
                                "usemtl red stone\nf -6/-1 -5/-2 -4/-3\nusemtl wood\nf 2 5 6\n",
                            "a.obj");
  Shelf shelf;
  shelf.files["things.mtl"] =
      "# made by hand\r\nnewmtl wood\r\nKd 1 1 1\r\n\tmap_Kd -blendu on -clamp off oak wood.png\r\n"
      "newmtl plain\r\nKd 1 0 0\r\nnewmtl red stone\r\nmap_kd  stone.jpg \r\nnewmtl unused\r\nmap_Kd unused.png\r\n";
  const Texture its = texture(cloud, shelf.reader());
  EXPECT_EQ(names(its), (Names{"oak wood.png", "stone.jpg"}));
  EXPECT_EQ(its.notes, Names{});
  EXPECT_EQ(shelf.asked, Names{"things.mtl"});
  const TextureMap map = texture_map(cloud, its);
  EXPECT_EQ(map.pictures, (Pictures{kNoPicture, 0, kNoPicture, 1, kNoPicture}));
  EXPECT_EQ(map.coordinates, (Floats{0,    0,    0,   0, 0,   0,        // before any material
                                     0,    0,    .5F, 0, .5F, 1, 0, 1,  // wood
                                     0,    0,    0,   0, 0,   0,        // a material without a picture
                                     .75F, .25F, 0,   1, .5F, 1,        // counted from the end
                                     0,    0,    0,   0, 0,   0}));     // wood, without coordinates
}

TEST(Texture, LibrariesAreFoundWhateverTheirLinesLookLike) {
  const std::string faces = kQuads + "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\n";
  Shelf shelf;
  shelf.files = {{"my things.mtl", "newmtl a\nmap_Kd a.png\n"},
                 {"sub/b.mtl", "newmtl b\nmap_Kd -s 2 2 1 -o 0.5 pictures/b.png\n"},
                 {"a.mtl", "\xEF\xBB\xBFnewmtl a\nmap_Kd /mnt/a.png\n"}};
  const Texture spaced = texture(parse("mtllib my things.mtl\n" + faces, "a.obj"), shelf.reader());
  EXPECT_EQ(names(spaced), Names{"a.png"});
  const Texture several = texture(parse("mtllib a.mtl sub/b.mtl gone.mtl\n" + faces, "a.obj"), shelf.reader());
  EXPECT_EQ(names(several), (Names{"/mnt/a.png", "sub/pictures/b.png"})) << "from where the library is";
  ASSERT_EQ(several.notes.size(), 2U);
  EXPECT_EQ(several.notes[0], "gone.mtl: is not there");
  EXPECT_NE(several.notes[1].find("sub/pictures/b.png"), std::string::npos) << several.notes[1];
  EXPECT_NE(several.notes[1].find("moved, scaled or turned"), std::string::npos) << several.notes[1];
}

TEST(Texture, NothingIsAskedForWithoutTextureCoordinates) {
  Shelf shelf;
  shelf.files["a.mtl"] = "newmtl a\nmap_Kd a.png\n";
  for (const char* text :
       {"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl a\nf 1 2 3\n", "v 0 0 0\nv 1 0 0\nf 1 2 2\n"}) {
    const Texture its = texture(parse(text, "a.obj"), shelf.reader());
    EXPECT_EQ(names(its), Names{});
    EXPECT_EQ(its.notes, Names{});
  }
  const std::string header = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\n";
  const Cloud ply = parse(header +
                          "property float x\nproperty float y\nproperty float z\nelement face 1\n"
                          "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  EXPECT_EQ(names(texture(ply, shelf.reader())), Names{});
  EXPECT_EQ(names(texture(Cloud{}, shelf.reader())), Names{});
  EXPECT_EQ(shelf.asked, Names{});
}

const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

TEST(Texture, PlyFacesHaveThePictureThatTheyNumber) {
  Shelf shelf;
  const Cloud cloud = parse(
      "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile b of two.jpg\n"
      "element vertex 4\n" +
      kXyz +
      "element face 4\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"
      "property int texnumber\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
      "3 0 1 2 6 0 0 1 0 1 1 1\n3 0 2 3 6 .5 .5 1 1 0 1 0\n3 0 1 3 6 1 1 1 1 1 1 2\n3 1 2 3 0 0\n");
  const Texture its = texture(cloud, shelf.reader());
  EXPECT_EQ(names(its), (Names{"a.png", "b of two.jpg"}));
  EXPECT_EQ(shelf.asked, Names{});
  const TextureMap map = texture_map(cloud, its);
  EXPECT_EQ(map.pictures, (Pictures{1, 0, kNoPicture, kNoPicture}));
  EXPECT_EQ(map.coordinates, (Floats{0, 0, 1, 0, 1, 1, .5F, .5F, 1, 1, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST(Texture, PlyCoordinatesOfPointsAreThoseOfCorners) {
  Shelf shelf;
  for (const auto& [u, v] : {std::pair("s", "t"), {"u", "v"}, {"texture_u", "texture_v"}}) {
    const std::string columns = kXyz + "property float " + u + "\nproperty double " + v + "\n";
    const Cloud cloud = parse("ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\n" + columns +
                              "element face 1\nproperty list uchar int vertex_index\nend_header\n"
                              "0 0 0 .125 .25\n1 0 0 .5 .75\n0 1 0 1 0\n3 2 0 1\n");
    const Texture its = texture(cloud, shelf.reader());
    EXPECT_EQ(names(its), Names{"a.png"}) << u;
    const TextureMap map = texture_map(cloud, its);
    EXPECT_EQ(map.pictures, Pictures{0}) << u;
    EXPECT_EQ(map.coordinates, (Floats{1, 0, .125F, .25F, .5F, .75F})) << u;
  }
}

TEST(Texture, GlbFacesHaveThePictureOfTheirBaseColour) {
  const std::string binary =
      packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}) + packed<float>({0, 0, .25F, 0, .5F, 1}) + std::string("\x89PNG held");
  const std::string bytes = glb(
      R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":69}],
      "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24},
                     {"buffer":0,"byteOffset":60,"byteLength":9}],
      "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                   {"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
      "images":[{"bufferView":2,"mimeType":"image/png"},{"uri":"a%20b.png"},{"uri":"data:image/png;base64,AAEC"},
                {"bufferView":7}],
      "textures":[{"source":0},{"source":1},{"source":2},{"source":3}],
      "materials":[{},{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}},
                   {"pbrMetallicRoughness":{"baseColorTexture":{"index":1,"texCoord":1}}},
                   {"pbrMetallicRoughness":{"baseColorTexture":{"index":2}}},
                   {"pbrMetallicRoughness":{"baseColorTexture":{"index":3}}}],
      "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":1},
                               {"attributes":{"POSITION":0},"material":1},
                               {"attributes":{"POSITION":0,"TEXCOORD_0":1}},
                               {"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":3},
                               {"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":4},
                               {"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":99}]}],
      "nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],"scene":0})",
      binary);
  Shelf shelf;
  const Cloud cloud = parse(bytes, "a.glb");
  const Texture its = texture(cloud, shelf.reader());
  EXPECT_EQ(names(its), (Names{"image 0", "a b.png", "image 2"}));
  EXPECT_EQ(its.of_materials, (Pictures{kNoPicture, 0, 1, 2, kNoPicture}));
  const auto text = [&](std::size_t p) {
    return std::string(reinterpret_cast<const char*>(its.pictures[p].bytes.data()), its.pictures[p].bytes.size());
  };
  EXPECT_EQ(text(0), "\x89PNG held");
  EXPECT_EQ(text(1), "");
  EXPECT_EQ(text(2), std::string("\0\1\2", 3));
  ASSERT_EQ(its.notes.size(), 2U);
  EXPECT_NE(its.notes[0].find("a b.png"), std::string::npos) << its.notes[0];
  EXPECT_NE(its.notes[1].find("material 4 cannot be read"), std::string::npos) << its.notes[1];
  EXPECT_EQ(shelf.asked, Names{});
  const TextureMap map = texture_map(cloud, its);
  EXPECT_EQ(map.pictures, (Pictures{0, kNoPicture, kNoPicture, 2, kNoPicture, kNoPicture}));
  ASSERT_EQ(map.coordinates.size(), 36U);
  EXPECT_EQ(Floats(map.coordinates.begin(), map.coordinates.begin() + 6), (Floats{0, 1, .25F, 1, .5F, 0}))
      << "from the lower left corner";
}

// The coordinates take another way into a PLY file, which keeps those of corners.
TEST(Texture, FacesThatRemainKeepTheirPictures) {
  const Cloud cloud =
      parse("mtllib a.mtl\n" + kQuads + "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 2/5 5/4 6/1\nf 3/1 5/2 6/4\n", "a.obj");
  Shelf shelf;
  shelf.files["a.mtl"] = "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\n";
  const Texture its = texture(cloud, shelf.reader());
  std::string text = image(cloud, Format::ply, Encoding::ascii);
  text.insert(text.find("element"), "comment TextureFile a.png\n");
  const Cloud ply = parse(text);
  EXPECT_EQ(texture_map(ply, texture(ply, shelf.reader())).coordinates, texture_map(cloud, its).coordinates);
  const std::vector<std::uint8_t> removed{1, 0, 0, 0, 0, 0};
  const Cloud less = without_points(cloud, removed);
  const TextureMap map = texture_map(less, its);
  EXPECT_EQ(map.pictures, (Pictures{1, 1}));
  EXPECT_EQ(map.coordinates, (Floats{.75F, .25F, 0, 1, 0, 0, 0, 0, .5F, 0, 0, 1}));
  EXPECT_EQ(names(texture(less, shelf.reader())), names(its));
}

}  // namespace
}  // namespace pointfair::test
