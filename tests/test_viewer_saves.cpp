// SPDX-License-Identifier: Apache-2.0
// Files that a page saves. Oracle: what the library writes.
#include <gtest/gtest.h>

#include <filesystem>

#include "runs.h"
#include "viewer_seat.h"

namespace pointfair::viewer {
namespace {

namespace fs = std::filesystem;

using test::file_bytes;

TEST(ViewerSession, SavesWhatTheLibraryWrites) {
  const test::Folder folder;
  const Cloud cloud = cloud_of(noisy(2000));
  Session::Options options = cpu_options();
  options.save_folder = folder / "";
  FakePage page;
  Session session(options, page.send());
  session.open(cloud, "scan.ply");
  EXPECT_TRUE(session.receive(
      R"({"type":"save","id":1,"output":"denoised.ply","params":{"k":"12"},"limits":{"strength":"0.5"}})"));
  page.wait_for("saved", 1);
  Pipeline pipeline = loaded(cloud);
  Cloud fair = pipeline.run({.k = 12});
  apply_limits({.strength = 0.5}, cloud, fair);
  write(folder / "expected.ply", fair);
  EXPECT_EQ(file_bytes(folder / "denoised.ply"), file_bytes(folder / "expected.ply"));

  EXPECT_TRUE(session.receive(R"({"type":"save","id":2,"output":"denoised.ply"})"));
  EXPECT_NE(
      std::string(page.wait_for("error", 2).head["message"]).find("exists already; choose another name, or turn on"),
      std::string::npos);
  EXPECT_TRUE(session.receive(R"({"type":"save","id":3,"output":"denoised.ply","overwrite":true})"));
  page.wait_for("saved", 3);
}

TEST(ViewerSession, SavesNowhereElse) {
  const test::Folder folder;
  Session::Options options = cpu_options();
  options.save_folder = folder / "inner";
  fs::create_directories(options.save_folder);
  fs::create_symlink(folder / "outside.ply", options.save_folder / "link.ply");
  FakePage page;
  Session session(options, page.send());
  session.open(cloud_of(noisy(200)), "scan.ply");
  int id = 0;
  for (const char* name : {"../a.ply", "/tmp/pointfair-a.ply", "b/a.ply", ".a.ply", "-a.ply", "", "a", "a.exe", "..",
                           "link.ply", "a\nb.ply", "a\\b.ply"}) {
    EXPECT_TRUE(session.receive(Json{{"type", "save"}, {"id", ++id}, {"output", name}, {"overwrite", true}}.dump()));
    page.wait_for("error", id);
  }
  EXPECT_FALSE(fs::exists(folder / "a.ply"));
  EXPECT_FALSE(fs::exists(folder / "outside.ply"));
  EXPECT_EQ(std::distance(fs::directory_iterator(options.save_folder), {}), 1);
}

}  // namespace
}  // namespace pointfair::viewer
