// SPDX-License-Identifier: Apache-2.0
// The plan of a run, for every state that a pipeline can be in and every wish. Oracle: a machine that knows of each
// stage's result what it was made of, as a backend would, and nothing of plans.
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <sstream>
#include <vector>

#include "pipeline/plan.hpp"

namespace pointfair {
namespace {

constexpr int kStages = 4;

// What a result was made of: the order of the index, and one number for each stage's settings up to its own.
struct Made {
  IndexOrder order;
  int neighbors, normals, fairing;  // 0 where the result is of an earlier stage
  friend bool operator==(const Made&, const Made&) = default;
};

// What a backend holds: of the first iteration and of one further, the results of stages from the index on. A stage
// reads those before it; the index of a further iteration takes the points of the one before.
struct Machine {
  struct Iteration {
    int number;
    std::vector<Made> input;    // of the faired points that it began with, for each iteration before it
    std::vector<Made> results;  // of its stages
  };
  Iteration first{0, {}, {}};
  std::optional<Iteration> further;

  // Half done: the result of the stage and those after it are lost.
  void start(StageOf step) {
    if (step.iteration == 0) {
      ASSERT_GE(int(first.results.size()), int(step.stage)) << "a stage without the one before it";
      first.results.resize(std::size_t(step.stage));
      return;
    }
    if (step.stage == Stage::index) {
      Iteration next{step.iteration, {}, {}};
      if (step.iteration == 1) {
        ASSERT_EQ(int(first.results.size()), kStages) << "there are no faired points";
        next.input = {first.results.back()};
      } else {
        ASSERT_TRUE(further && further->number == step.iteration - 1 && int(further->results.size()) == kStages);
        next.input = further->input;
        next.input.push_back(further->results.back());
      }
      further = next;
      return;
    }
    ASSERT_TRUE(further && further->number == step.iteration);
    ASSERT_GE(int(further->results.size()), int(step.stage));
    further->results.resize(std::size_t(step.stage));
  }
  void finish(StageOf step, IndexOrder order, const Settings& settings) {
    Iteration& its = step.iteration == 0 ? first : *further;
    Made made = its.results.empty() ? Made{order, 0, 0, 0} : its.results.back();
    if (step.stage == Stage::index) made = {order, 0, 0, 0};
    if (step.stage == Stage::neighbors) made.neighbors = settings.neighbors.k;
    if (step.stage == Stage::normals) made.normals = settings.normals.crease_angle;
    if (step.stage == Stage::fairing) made.fairing = settings.fairing.turn_angle;
    its.results.push_back(made);
  }
};

Settings settings_with(int neighbors, int normals, int fairing) {
  Settings settings;
  settings.neighbors.k = neighbors;
  settings.normals.crease_angle = normals;
  settings.fairing.turn_angle = fairing;
  return settings;
}

std::string name(const Wanted& w) {
  std::ostringstream text;
  text << "k " << w.settings.neighbors.k << ", normals " << w.settings.normals.crease_angle << ", fairing "
       << w.settings.fairing.turn_angle << ", order " << int(w.order) << ", " << w.iterations << " iterations";
  return text.str();
}

std::vector<Wanted> all_wishes() {
  std::vector<Wanted> all;
  for (const int neighbors : {1, 2})
    for (const int normals : {1, 2})
      for (const int fairing : {1, 2})
        for (const IndexOrder order : {IndexOrder::fastest, IndexOrder::along_curve})
          for (const int iterations : {1, 2, 3, 4})
            all.push_back({settings_with(neighbors, normals, fairing), order, iterations});
  return all;
}

struct Pipe {
  Machine machine;
  Cached cached;

  // Runs the plan; the step of number `failing` fails. Returns how many steps were done.
  int run(const Wanted& wanted, int failing = -1) {
    int done = 0;
    for (const Step& step : plan(cached, wanted)) {
      cached = step.meanwhile;
      machine.start(step.stage);
      if (testing::Test::HasFatalFailure() || done == failing) return done;
      machine.finish(step.stage, step.order, wanted.settings);
      cached = step.after;
      ++done;
    }
    return done;
  }

  // What is delivered: the results of the last wanted iteration, made of what was wanted in every iteration.
  void expect(const Wanted& wanted) const {
    const Settings& s = wanted.settings;
    const auto fits = [&](const Made& made) {
      return made.neighbors == s.neighbors.k && made.normals == s.normals.crease_angle &&
             made.fairing == s.fairing.turn_angle &&
             (made.order == wanted.order || made.order == IndexOrder::along_curve);
    };
    ASSERT_EQ(int(machine.first.results.size()), kStages) << name(wanted);
    EXPECT_TRUE(fits(machine.first.results.back())) << name(wanted);
    if (wanted.iterations == 1) return;
    ASSERT_TRUE(machine.further && machine.further->number == wanted.iterations - 1) << name(wanted);
    ASSERT_EQ(int(machine.further->results.size()), kStages) << name(wanted);
    EXPECT_TRUE(fits(machine.further->results.back())) << name(wanted);
    for (const Made& made : machine.further->input) EXPECT_TRUE(fits(made)) << name(wanted);
  }
};

TEST(Plan, of_any_wish_after_any_other_failed_at_any_step_gives_what_is_wished) {
  const std::vector<Wanted> wishes = all_wishes();
  for (const Wanted& before : wishes) {
    const int steps = int(plan({}, before).size());
    for (int failing = -1; failing < steps; ++failing) {
      Pipe failed;
      failed.run(before, failing);
      for (const Wanted& wanted : wishes) {
        Pipe pipe = failed;
        pipe.run(wanted);
        pipe.expect(wanted);
        EXPECT_EQ(pipe.run(wanted), 0) << "an equal run runs nothing";
        if (HasFailure()) FAIL() << "after " << name(before) << " failed at " << failing;
      }
    }
  }
}

// Three wishes, of which the second fails somewhere: what is held then is of both.
TEST(Plan, of_three_wishes_in_a_row_gives_what_is_wished) {
  std::vector<Wanted> wishes;
  for (const Wanted& wish : all_wishes())
    if (wish.settings.neighbors.k == 1 && wish.order == IndexOrder::fastest) wishes.push_back(wish);
  for (const Wanted& first : wishes)
    for (const Wanted& second : wishes) {
      Pipe begun;
      begun.run(first);
      const int steps = int(plan(begun.cached, second).size());
      for (int failing = -1; failing < steps; ++failing) {
        Pipe failed = begun;
        failed.run(second, failing);
        for (const Wanted& third : wishes) {
          Pipe pipe = failed;
          pipe.run(third);
          pipe.expect(third);
          if (HasFailure()) FAIL() << name(first) << "; " << name(second) << " failed at " << failing;
        }
      }
    }
}

int steps_after(const Wanted& before, const Wanted& wanted) {
  Pipe pipe;
  pipe.run(before);
  return pipe.run(wanted);
}

TEST(Plan, runs_no_stage_whose_result_is_of_use) {
  const auto wish = [](int neighbors, int normals, int fairing, int iterations, IndexOrder order = {}) {
    return Wanted{settings_with(neighbors, normals, fairing), order, iterations};
  };
  EXPECT_EQ(steps_after(wish(1, 1, 1, 1), wish(1, 1, 2, 1)), 1);
  EXPECT_EQ(steps_after(wish(1, 1, 1, 1), wish(1, 2, 1, 1)), 2);
  EXPECT_EQ(steps_after(wish(1, 1, 1, 1), wish(2, 1, 1, 1)), 3);
  EXPECT_EQ(steps_after(wish(1, 1, 1, 1), wish(1, 1, 1, 1, IndexOrder::along_curve)), 4);
  EXPECT_EQ(steps_after(wish(1, 1, 1, 1, IndexOrder::along_curve), wish(1, 1, 1, 1)), 0);
  EXPECT_EQ(steps_after(wish(1, 1, 1, 2), wish(1, 1, 1, 3)), 4) << "one more iteration";
  EXPECT_EQ(steps_after(wish(1, 1, 1, 3), wish(1, 1, 1, 1)), 0) << "the first is held";
  EXPECT_EQ(steps_after(wish(1, 1, 1, 3), wish(1, 1, 1, 2)), 4) << "the second is not";
  EXPECT_EQ(steps_after(wish(1, 1, 1, 3), wish(1, 1, 2, 3)), 1 + 2 * 4);
}

TEST(Plan, of_an_index_is_one_step_where_there_is_none) {
  Pipe pipe;
  const std::vector<Step> steps = plan_index(pipe.cached, IndexOrder::along_curve);
  ASSERT_EQ(steps.size(), 1u);
  EXPECT_EQ(steps[0].stage, (StageOf{0, Stage::index}));
  EXPECT_TRUE(plan_index(steps[0].after, IndexOrder::fastest).empty());
  pipe.cached = steps[0].after;
  pipe.machine.finish(steps[0].stage, steps[0].order, {});
  const Wanted wanted{settings_with(1, 1, 1), IndexOrder::along_curve, 2};
  EXPECT_EQ(pipe.run(wanted), 7);
  pipe.expect(wanted);
}

// A stage whose call had returned is found to be undone: it and all that was made of it runs again.
TEST(Plan, forgets_what_was_given_up) {
  const Wanted wanted{settings_with(1, 1, 1), IndexOrder::fastest, 3};
  for (const StageOf given_up : {StageOf{0, Stage::neighbors}, {0, Stage::fairing}, {2, Stage::index}}) {
    Pipe pipe;
    pipe.run(wanted);
    pipe.cached = without(pipe.cached, given_up);
    if (given_up.iteration == 0) pipe.machine.first.results.resize(std::size_t(given_up.stage));
    pipe.machine.further.reset();
    pipe.run(wanted);
    pipe.expect(wanted);
  }
}

}  // namespace
}  // namespace pointfair
