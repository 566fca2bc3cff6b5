// SPDX-License-Identifier: Apache-2.0
// A session without a thread of its own, as a page has it in a worker. Oracle: what the library computes and writes.
#include <gtest/gtest.h>

#include <thread>

#include "viewer_seat.h"

namespace pointfair::viewer {
namespace {

Session::Options stepped_options() {
  Session::Options options = cpu_options();
  options.own_thread = false;
  options.saves_to_page = true;
  options.most_points = 100000;
  return options;
}

std::string bytes_of(const Cloud& cloud) {
  const std::vector<std::byte> bytes = write_bytes(cloud, Format::ply);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

struct Steps {
  FakePage page;
  Session session{stepped_options(), page.send()};

  void open(const Points& points) { EXPECT_TRUE(session.open(bytes_of(cloud_of(points)), "scan.ply")); }
  void ask(std::string_view text) { EXPECT_TRUE(session.receive(text)); }
  void finish() {
    while (const auto wait = session.step()) std::this_thread::sleep_for(*wait);
  }
  std::size_t count(std::string_view type) {
    const std::vector<Decoded> all = page.all();
    return std::size_t(std::count_if(all.begin(), all.end(), [&](const Decoded& one) { return one.is(type); }));
  }
};

TEST(ViewerSteps, NothingHappensBetweenThem) {
  Steps steps;
  EXPECT_FALSE(steps.session.step());
  steps.open(noisy(2000));
  steps.ask(run_text(1, {{"k", "12"}}));
  EXPECT_TRUE(steps.page.all().empty());
  EXPECT_TRUE(steps.session.step());  // the file comes before the run
  EXPECT_EQ(steps.count("cloud"), 1u);
  EXPECT_EQ(steps.count("result"), 0u);
  steps.finish();
  EXPECT_EQ(steps.count("result"), 1u);
  EXPECT_EQ(steps.count("settled"), 1u);
  EXPECT_FALSE(steps.session.step());
}

TEST(ViewerSteps, OfRunsThatWaitTheNewestIsDone) {
  Steps steps;
  steps.open(noisy(2000));
  for (int id = 1; id <= 5; ++id) steps.ask(run_text(id, {{"k", std::to_string(8 + id)}}));
  steps.finish();
  EXPECT_EQ(steps.count("result"), 1u);
  EXPECT_EQ(steps.page.wait_for("result", 5).head["used"]["k"], "13");
}

TEST(ViewerSteps, AHeldSliderIsHeardAfterThePreview) {
  Steps steps;
  steps.open(noisy(60000));
  const auto held = [](int id, const char* k) {
    return Json{{"type", "run"}, {"id", id}, {"held", true}, {"params", {{"k", k}, {"iterations", "6"}}}}.dump();
  };
  steps.ask(run_text(1, {{"iterations", "6"}}));  // how long a run takes is known then
  steps.finish();
  if (double(steps.page.wait_for("result", 1).head["total_ms"]) < 200)
    GTEST_SKIP() << "this machine needs no preview for such a run";
  steps.ask(held(2, "40"));
  EXPECT_GT(steps.session.step()->count(), 0);  // it waits, and may be replaced
  EXPECT_EQ(steps.page.wait_for("preview", 2).head["id"], 2);
  steps.ask(held(3, "48"));
  steps.finish();
  EXPECT_EQ(steps.page.wait_for("result", 3).head["used"]["k"], "48");
  EXPECT_EQ(steps.count("result"), 2u);
}

TEST(ViewerSteps, ASavedFileGoesToThePage) {
  Steps steps;
  const Points points = noisy(2000);
  steps.open(points);
  steps.ask(R"({"type":"save","id":1,"output":"denoised.ply","params":{"k":"12"}})");
  steps.finish();
  const Decoded saved = steps.page.wait_for("saved", 1);
  Pipeline pipeline(Device::cpu);
  const Cloud cloud = read(write_bytes(cloud_of(points), Format::ply), "scan.ply");
  pipeline.load(cloud);
  Params params{.k = 12};
  const std::vector<std::uint8_t> file = saved.array<std::uint8_t>("file");
  EXPECT_EQ(std::string(file.begin(), file.end()), bytes_of(pipeline.run(params)));
  EXPECT_EQ(saved.head["path"], "denoised.ply");
}

TEST(ViewerSteps, ACloudOfTooManyPointsIsRefusedAndTheOneBeforeStays) {
  Steps steps;
  steps.open(noisy(2000));
  steps.open(noisy(100489));
  steps.ask(run_text(1, {{"k", "12"}}));
  steps.finish();
  const std::string words = steps.page.wait_for("error").head["message"];
  EXPECT_NE(words.find("scan.ply has 100489 points and this page takes up to 100000"), std::string::npos) << words;
  EXPECT_EQ(steps.count("cloud"), 1u);
  EXPECT_EQ(steps.count("result"), 1u);
}

}  // namespace
}  // namespace pointfair::viewer
