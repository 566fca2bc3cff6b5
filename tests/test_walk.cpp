// SPDX-License-Identifier: Apache-2.0
// A random walk over everything that a caller of a pipeline can do: loads, places of the sensor, every parameter in
// every unit, runs that fail or are stopped anywhere, queries in between. Oracle: a fresh pipeline.
// POINTFAIR_WALK_STEPS sets how long, POINTFAIR_WALK_SEED which way.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "meddling_backend.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pipeline.hpp"
#include "pointfair/positions.hpp"
#include "runs.h"
#include "shapes.h"
#include "sharing_backend.h"
#include "tiles/tiled_backend.hpp"
#include "walk_oracle.h"

namespace pointfair {
namespace {

// A value for any parameter, as a text.
std::string random_value(const ParamInfo& info, shapes::Random& random) {
  if (info.automatic && random.below(3) == 0) return "auto";
  if (std::holds_alternative<Length Params::*>(info.field)) {
    const std::string units[] = {"", "%", "s", "r"};
    const double scales[] = {1, 60, 5, 5};
    const std::size_t unit = random.below(4);
    return std::to_string(random.uniform(0.01, 0.3) * scales[unit]) + units[unit];
  }
  if (std::holds_alternative<int Params::*>(info.field))
    return std::to_string(int(info.min) + int(random.below(std::uint64_t(std::min(info.max - info.min, 39.0)) + 1)));
  std::vector<std::string> words{""};
  for (const char c : info.values) {
    if (c == '|') {
      words.emplace_back();
    } else {
      words.back() += c;
    }
  }
  return words[random.below(words.size())];
}

class Walk {
 public:
  Walk(const MakePipeline& make, std::uint64_t seed) : random_(seed), oracle_(make), pipeline_(make(meddling_)) {
    load();
  }

  void step() {
    const std::uint64_t what = random_.below(100);
    if (what < 4) {
      load();
    } else if (what < 40) {
      change_parameters();
      run_whole(false);
    } else if (what < 46) {
      run_whole(true);
    } else if (what < 66) {
      change_parameters();
      run_meddled_with();
    } else if (what < 71) {
      run_stopped_by_another_thread();
    } else if (what < 79) {
      query_estimates();
    } else if (what < 86) {
      query_resolved();
    } else if (what < 94) {
      query_normals();
    } else if (what < 97) {
      tell_viewpoint();
    } else {
      run_into_wrong_size();
    }
  }

 private:
  const Points& points() const { return oracle_.clouds()[cloud_]; }
  const Outcome& expected() { return oracle_.run(cloud_, told_, params_); }

  void load() {
    // mostly the first clouds; parameters go on as they are
    cloud_ = std::min<std::size_t>(random_.below(9) / 2, oracle_.clouds().size() - 1);
    if (random_.below(2) == 0) {
      pipeline_.load(points());
    } else {
      pipeline_.load(shapes::as_cloud(points()));
    }
    told_ = Told::nothing;
    shown_.reset();
    if (random_.below(2) == 0) tell_viewpoint();
  }

  void tell_viewpoint() {
    std::vector<Position> too_many(points().size() + 2);
    EXPECT_THROW(pipeline_.set_viewpoint(too_many), Error);  // and what was told before holds
    if (random_.below(4) == 0) return;
    told_ = Told(random_.below(3));
    pipeline_.set_viewpoint(viewpoints(told_, points().size()));
  }

  void change_parameters() {
    for (std::uint64_t n = random_.below(4); n > 0; --n) {
      const ParamInfo& info = kParams[random_.below(kParams.size())];
      if (info.name == "connectivity" || info.name == "rings") continue;  // these clouds have no faces
      try {
        set_param(params_, info,
                  info.name == "iterations" ? std::to_string(1 + random_.below(4)) : random_value(info, random_));
      } catch (const Error&) {  // a unit that the parameter does not know
      }
    }
    if (random_.below(12) == 0) params_ = random_.below(2) == 0 ? Params{} : paper_preset();
    if (random_.below(12) == 0 && expected().error.empty()) params_ = expected().used;  // as typed by hand
  }

  void expect_like_fresh(const Outcome& found) {
    const Outcome& fresh = expected();
    EXPECT_EQ(fresh.error, "");
    EXPECT_TRUE(same_bits(found.points, fresh.points)) << "points";
    EXPECT_EQ(found.outliers, fresh.outliers);
    EXPECT_EQ(found.unmoved, fresh.unmoved);
    EXPECT_EQ(found.short_neighborhoods, fresh.short_neighborhoods);
    EXPECT_EQ(found.used, fresh.used);
    shown_ = {params_, told_};
  }

  void run_whole(bool in_one_call) {
    Points out(points().size());
    if (in_one_call) told_ = Told::nothing;
    try {
      in_one_call ? pipeline_.run(points(), params_, out) : pipeline_.run(params_, out);
    } catch (const Error& error) {
      EXPECT_EQ(expected().error, error.what());
      if (in_one_call) pipeline_.load(points());  // it may have been refused before or after the load
      shown_.reset();
      return;
    }
    expect_like_fresh(of_last_run(pipeline_, std::move(out)));
  }

  // A run of which some call fails, throws std::bad_alloc or begins after a stop was requested.
  void run_meddled_with() {
    std::stop_source stop;
    const Meddling::Kind kinds[] = {Meddling::Kind::error, Meddling::Kind::no_memory, Meddling::Kind::stop};
    const Meddling::Kind kind = kinds[random_.below(3)];
    meddling_ = {kind, int(random_.below(16)), &stop};
    run_that_may_end(stop, [&](const Error& error) {
      const ErrorKind wanted = kind == Meddling::Kind::error       ? ErrorKind::failed
                               : kind == Meddling::Kind::no_memory ? ErrorKind::memory
                                                                   : ErrorKind::interrupted;
      return error.kind() == wanted;
    });
    meddling_ = {};
  }

  void run_stopped_by_another_thread() {
    std::stop_source stop;
    const auto delay = std::chrono::microseconds(random_.below(3000));
    std::jthread stopper([&] {
      std::this_thread::sleep_for(delay);
      stop.request_stop();
    });
    run_that_may_end(stop, [](const Error& error) { return error.kind() == ErrorKind::interrupted; });
  }

  template <class Explained>
  void run_that_may_end(std::stop_source& stop, const Explained& is_explained) {
    const bool one_call = random_.below(8) == 0;
    if (one_call) told_ = Told::nothing;
    Points out(points().size());
    std::optional<Error> ended;
    try {
      if (one_call) {
        pipeline_.run(points(), params_, out, stop.get_token());
      } else {
        pipeline_.run(params_, out, stop.get_token());
      }
    } catch (const Error& error) {
      ended = error;
    }
    meddling_ = {};
    if (!ended) return expect_like_fresh(of_last_run(pipeline_, std::move(out)));
    EXPECT_TRUE(is_explained(*ended) || expected().error == ended->what()) << ended->what();
    if (one_call) pipeline_.load(points());
    shown_.reset();
  }

  void query_estimates() {
    if (random_.below(4) == 0) meddling_ = {Meddling::Kind::no_memory, int(random_.below(4)), nullptr};
    try {
      const Estimates& found = pipeline_.estimates();
      const Estimates& fresh = oracle_.estimates(cloud_);
      EXPECT_EQ(found.min, fresh.min);
      EXPECT_EQ(found.max, fresh.max);
      EXPECT_EQ(found.diagonal, fresh.diagonal);
      EXPECT_EQ(found.spacing, fresh.spacing);
      EXPECT_EQ(found.noise, fresh.noise);
      EXPECT_EQ(found.points, fresh.points);
      EXPECT_EQ(found.finite, fresh.finite);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::memory);
    }
    meddling_ = {};
  }

  void query_resolved() {
    change_parameters();
    const Outcome& fresh = expected();
    try {
      EXPECT_EQ(pipeline_.resolve(params_), fresh.used);
      EXPECT_EQ(fresh.error, "");
    } catch (const Error& error) {
      EXPECT_EQ(fresh.error.empty() ? refusal_of_fresh() : fresh.error, error.what());
    }
  }

  // A run leaves a cloud where nothing can be measured as it is; there is nothing to resolve on it.
  std::string refusal_of_fresh() const {
    Pipeline fresh = loaded(points(), Device(Device::cpu, 0, 2));
    if (told_ != Told::nothing) fresh.set_viewpoint(viewpoints(told_, points().size()));
    try {
      fresh.resolve(params_);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  // Those of the last run, or a refusal if that did not succeed.
  void query_normals() {
    Points normals(points().size());
    if (random_.below(8) == 0) meddling_ = {Meddling::Kind::no_memory, 0, nullptr};
    try {
      pipeline_.normals(normals);
      ASSERT_TRUE(shown_) << "normals of no run";
      const Points& fresh = oracle_.run(cloud_, shown_->told, shown_->params).normals;
      EXPECT_TRUE(shown_->told == told_ ? same_bits(normals, fresh) : same_up_to_sign(normals, fresh)) << "normals";
    } catch (const Error& error) {
      EXPECT_TRUE(error.kind() == ErrorKind::memory || (!shown_ && error.kind() == ErrorKind::usage)) << error.what();
    }
    meddling_ = {};
  }

  void run_into_wrong_size() {
    Points out(points().size() + 1);
    EXPECT_THROW(pipeline_.run(params_, out), Error);
    shown_.reset();
  }

  shapes::Random random_;
  Meddling meddling_;
  Oracle oracle_;
  Pipeline pipeline_;
  std::size_t cloud_ = 0;
  Params params_;
  Told told_ = Told::nothing;
  struct Shown {
    Params params;
    Told told;
  };
  std::optional<Shown> shown_;  // what the last run read, if it succeeded
};

std::uint64_t number_from(const char* variable, std::uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

void walk(const MakePipeline& make) {
  const std::uint64_t steps = number_from("POINTFAIR_WALK_STEPS", 5000), seed = number_from("POINTFAIR_WALK_SEED", 1);
  constexpr std::uint64_t kLeg = 500;  // steps with one pipeline
  for (std::uint64_t done = 0; done < steps;) {
    Walk walk(make, seed * 1'000'003 + done);
    for (std::uint64_t n = 0; n < kLeg && done < steps; ++n, ++done) {
      SCOPED_TRACE("step " + std::to_string(done));
      walk.step();
      if (testing::Test::HasFailure()) return;
    }
  }
}

std::unique_ptr<Backend> tiled(Meddling& meddling, const std::function<std::unique_ptr<Backend>()>& make) {
  std::vector<std::unique_ptr<Backend>> workers;
  for (int i = 0; i < 2; ++i) workers.push_back(std::make_unique<MeddlingBackend>(make(), meddling));
  return make_tiled_backend(std::move(workers), {3, ~0ull, 0.3});
}

TEST(Walk, on_the_cpu_gives_the_results_of_fresh_pipelines) {
  walk([](Meddling& meddling) {
    return PipelineAccess::make(std::make_unique<MeddlingBackend>(make_cpu_backend(2), meddling),
                                {Device::cpu, "test", "requested"});
  });
}

TEST(Walk, in_tiles_gives_the_results_of_fresh_pipelines) {
  walk([](Meddling& meddling) {
    return PipelineAccess::make(tiled(meddling, [] { return make_cpu_backend(2); }),
                                {Device::cpu, "test", "requested"});
  });
}

TEST(Walk, over_two_cards_gives_the_results_of_fresh_pipelines) {
  walk([](Meddling& meddling) {
    const auto card = [&meddling] { return std::make_unique<MeddlingBackend>(make_cpu_backend(2), meddling); };
    return PipelineAccess::make(card(), {Device::cpu, "test", "requested"}, MakeWorkers{{card, card}, 320});
  });
}

TEST(Walk, over_two_cards_that_share_gives_the_results_of_fresh_pipelines) {
  walk([](Meddling& meddling) {
    const auto card = [&meddling] {
      return std::make_unique<SharingBackend>(std::make_unique<MeddlingBackend>(make_cpu_backend(2), meddling));
    };
    return PipelineAccess::make(card(), {Device::cpu, "test", "requested"}, MakeWorkers{{card, card}, 320});
  });
}

TEST(Walk, on_a_card_gives_the_results_of_fresh_pipelines) {
  if (!test::why_no_card().empty()) GTEST_SKIP() << test::why_no_card();
  walk([](Meddling& meddling) {
    return PipelineAccess::make(std::make_unique<MeddlingBackend>(make_cuda_backend(0), meddling),
                                {Device::cuda, "test", "requested"});
  });
}

// One card twice.
TEST(Walk, over_cards_that_share_gives_the_results_of_fresh_pipelines) {
  if (!test::why_no_card().empty()) GTEST_SKIP() << test::why_no_card();
  walk([](Meddling&) {
    const auto card = [] { return make_cuda_backend(0); };
    return PipelineAccess::make(card(), {Device::cuda, "test", "requested"}, MakeWorkers{{card, card}, 320});
  });
}

}  // namespace
}  // namespace pointfair
