// SPDX-License-Identifier: Apache-2.0
#include "pipeline/plan.hpp"

#include <algorithm>

namespace pointfair {
namespace {

Stage following(Stage stage) { return Stage(int(stage) + 1); }

// What of the cached results is of use.
Cached usable(Cached cached, const Wanted& wanted) {
  Stage next = std::min(cached.next, first_difference(cached.settings, wanted.settings));
  if (wanted.order == IndexOrder::along_curve && cached.order != wanted.order) next = Stage::index;
  if (next < Stage::iterations) cached.further = 0;
  cached.next = next;
  cached.settings = wanted.settings;
  return cached;
}

void plan_first(std::vector<Step>& steps, Cached& now, IndexOrder order) {
  while (now.next < Stage::iterations) {
    Step step{{0, now.next}, order, now, now};
    step.after.next = following(now.next);
    if (now.next == Stage::index) step.after.order = order;
    now = step.after;
    steps.push_back(step);
  }
}

// Only the last further iteration is held, so one before it cannot be gone back to.
void plan_further(std::vector<Step>& steps, Cached& now, IndexOrder order, int last) {
  if (last == 0 || now.further == last) return;
  for (int iteration = now.further < last ? now.further + 1 : 1; iteration <= last; ++iteration)
    for (Stage stage = Stage::index; stage < Stage::iterations; stage = following(stage)) {
      Step step{{iteration, stage}, order, now, now};
      step.meanwhile.further = 0;
      step.after.further = stage == Stage::fairing ? iteration : 0;
      now = step.after;
      steps.push_back(step);
    }
}

}  // namespace

std::vector<Step> plan(const Cached& cached, const Wanted& wanted) {
  std::vector<Step> steps;
  Cached now = usable(cached, wanted);
  plan_first(steps, now, wanted.order);
  plan_further(steps, now, wanted.order, wanted.iterations - 1);
  return steps;
}

std::vector<Step> plan_index(const Cached& cached, IndexOrder order) {
  if (cached.next != Stage::index) return {};
  Step step{{0, Stage::index}, order, cached, cached};
  step.meanwhile.further = step.after.further = 0;
  step.after.next = Stage::neighbors;
  step.after.order = order;
  return {step};
}

Cached without(Cached cached, StageOf given_up) {
  cached.further = 0;
  if (given_up.iteration == 0) cached.next = std::min(cached.next, given_up.stage);
  return cached;
}

}  // namespace pointfair
