// SPDX-License-Identifier: Apache-2.0
// The viewer's session, driven without a network. Oracle: a fresh pipeline.
#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <random>
#include <thread>

#include "meddling_backend.h"
#include "pipeline/pipeline_access.hpp"
#include "runs.h"
#include "seam/backend.hpp"
#include "viewer_seat.h"

namespace pointfair::viewer {
namespace {

TEST(ViewerSession, TheCloudArrivesInTheOrderOfThePage) {
  Seat seat(noisy(1000));
  const auto positions = seat.page.wait_for("cloud").array<float>("positions");
  const Order order(seat.points.size());
  ASSERT_EQ(positions.size(), 3 * seat.points.size());
  for (std::size_t place = 0; place < seat.points.size(); ++place) {
    EXPECT_EQ(positions[3 * place], seat.points[order.index(place)].x);
    EXPECT_EQ(positions[3 * place + 2], seat.points[order.index(place)].z);
  }
}

TEST(ViewerSession, PassesTravelWithinAHundredthOfTheSpacingInTwoBytesAPointIfThereIsOneElseInSix) {
  for (const auto& [iterations, along] : {std::pair("1", true), std::pair("3", false)}) {
    Seat seat(noisy(5000));
    const Json params{{"k", "16"}, {"iterations", iterations}};
    seat.ask(run_text(1, params));
    const Decoded result = seat.result(1);
    EXPECT_EQ(bool(result.head["along_normals"]), along);
    EXPECT_EQ(result.array<std::int16_t>("displacements").size(), (along ? 1 : 3) * seat.points.size());
    EXPECT_LT(seat.error_of(1, fresh_run(seat.points, params)), 0.01);
  }
}

TEST(ViewerSession, OnlyTheStagesThatDependOnTheChangeRunAgain) {
  Seat seat(noisy(3000));
  seat.ask(run_text(1, {{"k", "16"}, {"iterations", "1"}}));
  seat.result(1);
  seat.ask(run_text(2, {{"k", "16"}, {"iterations", "1"}, {"similarity_sigma", "0.01"}}));
  std::vector<std::string> stages;
  const Decoded result = seat.result(2);
  for (const Json& stage : result.head["stages"]) stages.push_back(stage["name"]);
  EXPECT_EQ(stages, (std::vector<std::string>{"fairing", "download"}));
}

TEST(ViewerSession, EveryMethodIsShownWhereItMovesPoints) {
  Seat seat(noisy(3000));
  int id = 0;
  for (const std::string method : {"bilateral", "laplacian", "taubin", "wiener", "hc-laplacian", "mls", "mollified"}) {
    const Json params{{"method", method}, {"k", "16"}, {"iterations", "1"}};
    seat.ask(run_text(++id, params));
    EXPECT_LT(seat.error_of(id, fresh_run(seat.points, params)), 0.01) << method;
    const bool along = method == "bilateral" || method == "wiener" || method == "mls";
    EXPECT_EQ(bool(seat.result(id).head["along_normals"]), along) << method;
  }
}

TEST(ViewerSession, TwoHundredRandomMessagesEndInTheStateOfTheLast) {
  Seat seat(noisy(4000));
  std::mt19937 random(7);
  const auto pick = [&](std::vector<std::string> words) { return words[random() % words.size()]; };
  Json params;
  int last_shown = 0;
  for (int id = 1; id <= 200; ++id) {
    params = {{"k", pick({"8", "16", "24"})},
              {"iterations", pick({"1", "1", "2"})},
              {"similarity_sigma", pick({"auto", "0.5s", "0.01"})},
              {"normal_sigma", pick({"auto", "2s"})},
              {"area_weight", pick({"none", "squared"})}};
    seat.ask(run_text(id, params));
    if (random() % 3 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(random() % 20));
    if (random() % 40 == 0) seat.ask(R"({"type":"cancel","id":-1})");
    if (random() % 20 == 0) seat.ask(run_text(id, {{"k", "0"}}));  // refused: changes nothing
  }
  seat.ask(run_text(201, params));
  EXPECT_LT(seat.error_of(201, fresh_run(seat.points, params)), 0.01);
  for (const Decoded& message : seat.page.all()) {
    if (!message.is("result")) continue;
    EXPECT_GT(int(message.head["id"]), last_shown);
    last_shown = message.head["id"];
  }
  EXPECT_EQ(last_shown, 201);
}

TEST(ViewerSession, ACancelledRunEndsAndShowsNothing) {
  Seat seat(noisy(100000));
  seat.ask(run_text(1, {{"k", "100"}, {"iterations", "100"}}));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  seat.ask(R"({"type":"cancel","id":2})");
  seat.page.wait_for("cancelled", 2);
  seat.ask(run_text(3, {{"k", "8"}, {"iterations", "1"}}));
  seat.result(3);
  for (const Decoded& message : seat.page.all()) EXPECT_FALSE(message.is("result") && message.head["id"] == 1);
}

TEST(ViewerSession, NewParametersStopTheRunUnderWay) {
  Seat seat(noisy(100000));
  seat.ask(run_text(1, {{"k", "100"}, {"iterations", "100"}}));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  seat.ask(run_text(2, {{"k", "8"}, {"iterations", "1"}}));
  seat.result(2);
  for (const Decoded& message : seat.page.all()) EXPECT_FALSE(message.is("result") && message.head["id"] == 1);
}

TEST(ViewerSession, ARunGoesOnAfterAJobCameBetween) {
  Seat seat(noisy(60000));
  const Json params{{"k", "40"}, {"iterations", "4"}};
  seat.ask(run_text(1, params));
  for (int id = 2; id < 6; ++id) {
    std::this_thread::sleep_for(std::chrono::milliseconds(40));
    seat.ask(Json{{"type", "colours"}, {"id", id}, {"name", "none"}}.dump());
  }
  EXPECT_LT(seat.error_of(1, fresh_run(seat.points, params)), 0.01);
}

// A page that does not read holds the worker up, so that tasks pile up behind what it sends.
TEST(ViewerSession, EveryTaskThatIsTakenIsAnsweredAndTheOthersAreRefused) {
  FakePage page;
  std::promise<void> reads;
  const std::shared_future<void> has_read = reads.get_future().share();
  Session session(cpu_options(), [to_page = page.send(), has_read](Bytes bytes) {
    has_read.wait();
    to_page(std::move(bytes));
  });
  ASSERT_TRUE(session.greet());
  std::vector<int> taken;
  for (int id = 1; id <= 200; ++id)
    if (session.receive(Json{{"type", "nonsense"}, {"id", id}}.dump())) taken.push_back(id);
  EXPECT_GE(taken.size(), 63u);
  EXPECT_LE(taken.size(), 65u);
  EXPECT_FALSE(session.receive(R"({"type":"cancel","id":201})"));
  EXPECT_FALSE(session.open(std::string("x"), "scan.ply"));
  EXPECT_FALSE(session.greet());
  reads.set_value();
  for (const int id : taken) page.wait_for("error", id);
  EXPECT_TRUE(session.receive(R"({"type":"nonsense","id":202})"));
  page.wait_for("error", 202);
  std::size_t answers = 0;
  for (const Decoded& message : page.all()) answers += message.is("error");
  EXPECT_EQ(answers, taken.size() + 1);
}

TEST(ViewerSession, AFailingStageIsSaidAndTheNextRunIsSound) {
  Meddling meddling;
  Session::Options options;
  options.make_pipeline = [&meddling] {
    return PipelineAccess::make(std::make_unique<MeddlingBackend>(make_cpu_backend(1), meddling),
                                {Device::cpu, "test", "requested"});
  };
  Seat seat(noisy(3000), options);
  meddling.kind = Meddling::Kind::error;
  seat.ask(run_text(1, {{"k", "16"}, {"iterations", "1"}}));
  EXPECT_EQ(seat.page.wait_for("error", 1).head["message"], "this call fails");
  const Json params{{"k", "16"}, {"iterations", "1"}};
  seat.ask(run_text(2, params));
  EXPECT_LT(seat.error_of(2, fresh_run(seat.points, params)), 0.01);
}

TEST(ViewerSession, WhatIsWrongWithAMessageIsSaidInWords) {
  Seat seat(noisy(500));
  const std::vector<std::pair<std::string, std::string>> cases{
      {"{", "not JSON"},
      {"[1]", "JSON object"},
      {R"({"type":"dance"})", "unknown type"},
      {R"({"type":7})", "unknown type"},
      {R"({"type":"run","params":{"kk":"8"}})", "no parameter 'kk'"},
      {R"({"type":"run","params":{"k":"-4"}})", "--k cannot be '-4'"},
      {R"({"type":"run","params":{"k":8}})", "must be a string"},
      {R"({"type":"run","params":[]})", "must be an object"},
      {R"({"type":"run","limits":{"box":"1,2"}})", "--box cannot be"},
      {R"({"type":"run","limits":{"lid":"1"}})", "no limit 'lid'"},
      {R"({"type":"colours","name":"nothing"})", "no attribute 'nothing'"},
      {R"({"type":"run","encoding":"latin"})", "no encoding 'latin'"}};
  for (const auto& [text, wanted] : cases) {
    const std::size_t before = seat.page.all().size();
    seat.ask(text);
    const Decoded error = seat.page.wait([](const Decoded& m) { return m.is("error"); }, before);
    EXPECT_NE(std::string(error.head["message"]).find(wanted), std::string::npos) << text << error.head["message"];
  }
  seat.ask(run_text(1, {{"k", "8"}}));
  seat.result(1);
}

// Oracle: a fresh pipeline.
TEST(ViewerSession, TheNoiseAtEachPointComesInTheOrderOfThePage) {
  Points points = noisy(3000);
  points[10].x = std::numeric_limits<float>::quiet_NaN();
  Pipeline pipeline = loaded(points);
  std::vector<float> expected(points.size());
  pipeline.noise(expected);
  Seat seat(points);
  seat.ask(run_text(1, {{"iterations", "2"}}));
  seat.result(1);
  seat.ask(R"({"type":"noise","id":2})");
  const Decoded answer = seat.page.wait_for("colours", 2);
  EXPECT_EQ(answer.head["name"], "noise");
  const auto noise = answer.array<float>("noise");
  const Order order(points.size());
  ASSERT_EQ(noise.size(), points.size());
  for (std::size_t place = 0; place < noise.size(); ++place) {
    const float its = expected[order.index(place)];
    ASSERT_TRUE(noise[place] == its || (std::isnan(noise[place]) && std::isnan(its))) << place;
  }
}

TEST(ViewerSession, AResultCountsTheOutliersThatWerePulledIn) {
  Points points = shapes::plane(900);
  points.push_back({points[450].x, points[450].y, points[450].z + 0.2F});
  Pipeline pipeline = loaded(points);
  pipeline.run({.outliers = Outliers::move});
  ASSERT_GT(pipeline.report().pulled.total(), 0u);
  Seat seat(points);
  seat.ask(run_text(1, {{"outliers", "move"}}));
  EXPECT_EQ(seat.page.wait_for("result", 1).head["pulled"], pipeline.report().pulled.total());
}

TEST(ViewerSession, AnOrganisedCloudSaysWhatItsGridTellsOfTheSensor) {
  std::string bytes =
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 40\nHEIGHT 40\nPOINTS 1600\n"
      "DATA ascii\n";
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.02);
  for (int i = 0; i < 1600; ++i)
    bytes += std::to_string(0.1 * (i % 40)) + " " + std::to_string(0.1 * (i / 40)) + " " +
             std::to_string(noise(random)) + "\n";
  FakePage page;
  Session session(cpu_options(), page.send());
  session.open(read(std::as_bytes(std::span(bytes)), "scan.pcd"), "scan.pcd");
  EXPECT_TRUE(session.greet());
  EXPECT_TRUE(session.receive(run_text(1, Json::object())));
  const Json notes = page.wait_for("result", 1).head["notes"];
  ASSERT_EQ(notes.size(), 1u) << notes;
  EXPECT_NE(std::string(notes[0]).find("its grid does not tell: --viewpoint x,y,z"), std::string::npos) << notes;
}

// Oracle: the sentence, with the numbers that a fresh pipeline measures.
TEST(ViewerSession, AResultSaysWhyItMayNotBeWhatItSeems) {
  Points scattered = shapes::plane(300);
  std::mt19937 random(1);
  for (Point& p : scattered) p.z = std::uniform_real_distribution<float>(0, 1)(random);  // a cube without a surface
  Pipeline pipeline = loaded(scattered);
  const Estimates estimates = pipeline.estimates();
  Seat seat(scattered);
  seat.ask(run_text(1, Json::object()));
  const Json result = seat.result(1).head;
  char wanted[400];
  std::snprintf(wanted, sizeof wanted,
                "the noise of %.4g and moves of up to %.4g are large against the cloud, whose diagonal is %.4g: its "
                "points, %.4g apart, may be too few to show a surface; compare before and after",
                estimates.noise, double(result["moved"]["max"]), estimates.diagonal, estimates.spacing);
  EXPECT_EQ(result["notes"], Json::array({wanted})) << result["notes"];
  Seat sound(noisy(3000));
  sound.ask(run_text(1, Json::object()));
  EXPECT_EQ(sound.result(1).head["notes"], Json::array());
  Session::Options options = cpu_options();
  options.viewpoint = "500000,4000000,100";  // of another coordinate system
  Seat misplaced(noisy(3000), options);
  misplaced.ask(run_text(1, Json::object()));
  const Json notes = misplaced.result(1).head["notes"];
  ASSERT_EQ(notes.size(), 1u) << notes;
  EXPECT_NE(std::string(notes[0]).find("diagonals outside the bounds of the cloud"), std::string::npos) << notes;
}

TEST(ViewerSession, ALargeCloudIsShownInPart) {
  Session::Options options = cpu_options();
  options.point_budget = 1000;
  Seat seat(noisy(20000), options);
  EXPECT_EQ(seat.page.wait_for("cloud").head["shown"], 1000);
  seat.ask(run_text(1, {{"k", "16"}, {"iterations", "1"}}));
  EXPECT_EQ(seat.result(1).array<std::int16_t>("displacements").size(), 1000u);
}

TEST(ViewerSession, DegenerateCloudsAreShownAndRun) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Points clouds[] = {
      {}, {{0, 0, 0}}, {{1, 2, 3}, {1, 2, 3}}, {{nan, 0, 0}, {0, nan, 0}}, Points(50, Point{1, 1, 1})};
  for (const Points& points : clouds) {
    Seat seat(points);
    seat.ask(run_text(1, Json::object()));
    seat.ask(run_text(2, {{"k", "4"}, {"iterations", "1"}}, {{"box", "0,0,0,1,1,1"}}));
    const Decoded result = seat.result(2);
    const Points moved = displacements(result, seat.normals_until(2), points.size());
    for (const Point& d : moved) EXPECT_EQ(d.x, 0);
  }
}

TEST(ViewerSession, ANewPageGetsEverythingAgain) {
  Seat seat(noisy(1000));
  const Json params{{"k", "16"}, {"iterations", "1"}};
  seat.ask(run_text(1, params));
  seat.result(1);
  const std::size_t before = seat.page.all().size();
  EXPECT_TRUE(seat.session.greet());
  seat.page.wait([](const Decoded& m) { return m.is("cloud"); }, before);
  seat.ask(run_text(2, params));
  EXPECT_EQ(seat.result(2).array<std::int16_t>("motion_normals").size(), 2 * seat.points.size());
}

TEST(ViewerSession, AFileThatCannotBeReadLeavesTheCloudInPlace) {
  Seat seat(noisy(500));
  EXPECT_TRUE(seat.session.open(std::string("nonsense"), "broken.ply"));
  EXPECT_NE(std::string(seat.page.wait_for("error").head["message"]).find("broken.ply"), std::string::npos);
  seat.ask(run_text(1, {{"k", "8"}}));
  seat.result(1);
}

}  // namespace
}  // namespace pointfair::viewer
