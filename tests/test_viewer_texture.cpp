// SPDX-License-Identifier: Apache-2.0
// The files that a mesh names, as the viewer reads them: from its own folder only. And the pictures as the page gets
// them.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

#include "runs.h"
#include "viewer/companions.hpp"
#include "viewer/order.hpp"
#include "viewer_page.h"

namespace pointfair::viewer {
namespace {

namespace fs = std::filesystem;

const std::string kPng = "\x89PNG\r\n\x1a\n and so on", kJpeg = "\xff\xd8\xff\xe0 and so on";

// A folder with a mesh's folder in it.
struct Folders {
  test::Folder outer;
  fs::path inner = outer / "mesh";

  Folders() {
    fs::create_directories(inner / "pictures");
    test::put_file(outer / "secret.png", kPng);
    test::put_file(inner / "a b.png", kPng + "1");
    test::put_file(inner / "pictures" / "c.jpg", kJpeg + "2");
  }
};

std::string refusal(const Companions& companions, const std::string& name) {
  return test::thrown_by([&] { companions.read(name); }).message;
}

TEST(ViewerTexture, FilesAreReadFromTheFolderOfTheMesh) {
  const Folders folders;
  const Companions companions = Companions::in_folder_of(folders.inner / "mesh.obj");
  EXPECT_EQ(companions.read("a b.png"), kPng + "1");
  EXPECT_EQ(companions.read("./a b.png"), kPng + "1");
  EXPECT_EQ(companions.read("pictures/c.jpg"), kJpeg + "2");
  EXPECT_EQ(companions.read("pictures\\c.jpg"), kJpeg + "2");
}

TEST(ViewerTexture, NothingOutsideOfTheFolderIsRead) {
  const Folders folders;
  const fs::path secret = folders.outer / "secret.png", mesh = folders.inner / "mesh.obj";
  fs::create_symlink(secret, folders.inner / "link.png");
  fs::create_directory_symlink(folders.inner.parent_path(), folders.inner / "up");
  fs::create_symlink(folders.inner / "a b.png", folders.inner / "near.png");
  const Companions companions = Companions::in_folder_of(mesh);
  const std::string whole = secret.string();
  const std::vector<std::string> outside{"../secret.png",
                                         "..\\secret.png",
                                         whole,
                                         "pictures/../../secret.png",
                                         "pictures/../a b.png",
                                         "C:\\secret.png",
                                         "C:secret.png",
                                         "a b.png:x",
                                         "\\\\host\\share\\secret.png",
                                         "//" + whole,
                                         "file://" + whole,
                                         std::string("a b.png\0/../secret.png", 22)};
  for (const std::string& name : outside)
    EXPECT_NE(refusal(companions, name).find("outside of the mesh's folder"), std::string::npos) << name;
  for (const char* name : {"link.png", "up/secret.png"})
    EXPECT_NE(refusal(companions, name).find("leads out of the mesh's folder"), std::string::npos) << name;
  EXPECT_EQ(companions.read("near.png"), kPng + "1") << "a link within";
  // a folder whose name only begins like the mesh's
  fs::create_directories(folders.outer / "mesh2");
  test::put_file(folders.outer / "mesh2" / "d.png", kPng);
  fs::create_symlink(folders.outer / "mesh2" / "d.png", folders.inner / "d.png");
  EXPECT_NE(refusal(companions, "d.png").find("leads out"), std::string::npos);
}

TEST(ViewerTexture, WhatIsNoPlainFileOfAModerateSizeIsRefused) {
  const Folders folders;
  ASSERT_EQ(::mkfifo((folders.inner / "pipe.png").c_str(), 0600), 0);
  test::put_file(folders.inner / "large.png", kPng);
  fs::resize_file(folders.inner / "large.png", Companions::kMostBytes + 1);
  const Companions companions = Companions::in_folder_of(folders.inner / "mesh.obj");
  EXPECT_NE(refusal(companions, "pipe.png").find("no plain file"), std::string::npos) << "and nobody waits for it";
  EXPECT_NE(refusal(companions, "pictures").find("no plain file"), std::string::npos);
  EXPECT_NE(refusal(companions, "").find("no plain file"), std::string::npos);
  EXPECT_EQ(refusal(companions, "gone.png"), "gone.png: is not in the mesh's folder; put it there");
  EXPECT_EQ(refusal(companions, "large.png"), "large.png: has 64 MiB, and up to 64 are shown; make it smaller");
  const std::string odd = refusal(companions, std::string("x\ny").append(1000, 'z'));
  EXPECT_EQ(odd.find('\n'), odd.npos) << "one line";
  EXPECT_LT(odd.size(), 300U);
}

TEST(ViewerTexture, WhatCameThroughThePageGoesByItsName) {
  Companions companions;
  companions.hold(kPng, "a.png");
  companions.hold(kJpeg, "a.png");
  EXPECT_EQ(companions.read("a.png"), kJpeg) << "the last one";
  EXPECT_EQ(companions.read("C:\\somewhere\\a.png"), kJpeg);
  EXPECT_EQ(companions.read("/etc/a.png"), kJpeg);
  EXPECT_NE(refusal(companions, "/etc/passwd").find("is not here; open it together with the mesh"), std::string::npos);
  EXPECT_EQ(test::thrown_by([&] { companions.hold(std::string(Companions::kMostBytes + 1, 'x'), "b.png"); }).kind,
            ErrorKind::usage);
  for (std::size_t i = 1; i < Companions::kMostFiles; ++i) companions.hold("x", std::to_string(i));
  EXPECT_EQ(test::thrown_by([&] { companions.hold("x", "one more"); }).kind, ErrorKind::usage);
}

TEST(ViewerTexture, OnlyPicturesAreSent) {
  Companions companions;
  companions.hold(kPng, "a.png");
  companions.hold("newmtl x", "x.mtl");
  companions.hold("\x89PNG", "cut.png");
  companions.hold("RIFF1234WEBPVP8 ", "w.webp");
  companions.hold("RIFF1234WAVEfmt ", "w.wav");
  EXPECT_EQ(picture_bytes({"a.png", {}}, companions), kPng);
  EXPECT_EQ(picture_type(picture_bytes({"w.webp", {}}, companions)), "image/webp");
  EXPECT_EQ(picture_type(kJpeg), "image/jpeg");
  for (const char* name : {"x.mtl", "cut.png", "w.wav"})
    EXPECT_NE(test::thrown_by([&] {
                picture_bytes({name, {}}, companions);
              }).message.find("is no PNG, JPEG or WebP"),
              std::string::npos)
        << name;
  EXPECT_EQ(picture_bytes({"image 0", std::as_bytes(std::span(kJpeg))}, {}), kJpeg) << "that the mesh's file holds";
}

// The corners of each face as the page gets them, with where they lie in which picture.
TEST(ViewerTexture, ThePageGetsCornersPicturesAndNotes) {
  const std::string obj =
      "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0.1\nv 2 1 0\nvt 0 0\nvt .25 .5\nvt 1 1\n"
      "usemtl gone\nf 1/1 2/2 3/3\nusemtl here\nf 1/1 3/2 4/3\nf 2/3 5/2 6/1 3/3\n";
  Session::Options options;
  options.make_pipeline = [] { return Pipeline(Device::cpu); };
  FakePage page;
  Session session(options, page.send());
  ASSERT_TRUE(session.hold("newmtl gone\nmap_Kd gone.png\nnewmtl here\nmap_Kd here.png\n", "m.mtl"));
  ASSERT_TRUE(session.hold(kPng, "here.png"));
  ASSERT_TRUE(session.open(obj, "m.obj"));
  const Decoded cloud = page.wait_for("cloud");
  EXPECT_EQ(cloud.head["colours"][0], Json::parse(R"({"name": "texture", "kind": "texture"})"));
  ASSERT_TRUE(session.receive(R"({"type": "texture", "id": 7})"));
  const Decoded sent = page.wait_for("texture", 7);
  EXPECT_EQ(sent.head["pictures"], Json::parse(R"([{"name": "here.png", "type": "image/png"}])"));
  ASSERT_EQ(sent.head["notes"].size(), 1U);
  EXPECT_EQ(sent.head["notes"][0], "gone.png: is not here; open it together with the mesh that names it");
  const std::vector<std::uint8_t> file = sent.array<std::uint8_t>("picture0");
  EXPECT_EQ(std::string(file.begin(), file.end()), kPng);
  EXPECT_EQ(sent.array<std::uint32_t>("face_pictures"), (std::vector<std::uint32_t>{kNoPicture, 0, 0}));
  const std::vector<float> at = sent.array<float>("coordinates");
  EXPECT_EQ(std::vector<float>(at.begin() + 6, at.end()),
            (std::vector<float>{0, 0, .25F, .5F, 1, 1, 1, 1, .25F, .5F, 0, 0, 1, 1}));
  EXPECT_EQ(cloud.array<std::uint32_t>("face_corners").size() * 2, at.size());

  ASSERT_TRUE(session.open(obj, "again.obj")) << "what came along is gone";
  const Decoded again = page.wait([](const Decoded& m) { return m.is("cloud") && m.head["name"] == "again.obj"; });
  ASSERT_TRUE(session.receive(R"({"type": "texture", "id": 8})"));
  const Decoded nothing = page.wait_for("texture", 8);
  EXPECT_EQ(nothing.head["pictures"], Json::array());
  EXPECT_EQ(nothing.head["notes"][0], "m.mtl: is not here; open it together with the mesh that names it");
}

}  // namespace
}  // namespace pointfair::viewer
