// SPDX-License-Identifier: Apache-2.0
// What is cached and what is wanted give the steps to run: a pure function, without a backend.
#pragma once

#include <vector>

#include "pipeline/stage_settings.hpp"
#include "seam/backend.hpp"

namespace pointfair {

// What a backend holds of the loaded cloud. The stages are a chain, so one value says it of the first iteration.
struct Cached {
  Stage next = Stage::index;               // the first stage whose result is not valid; `iterations`: all are
  IndexOrder order = IndexOrder::fastest;  // of the index, if it is valid
  Settings settings;                       // that the valid stages ran with
  int further = 0;                         // the further iteration whose results are held, `settings` too; 0: none
  friend bool operator==(const Cached&, const Cached&) = default;
};

struct Wanted {
  Settings settings;
  IndexOrder order = IndexOrder::fastest;  // an index along the curve serves as the fastest one, too
  int iterations = 1;
};

// A stage to run, what is cached while it runs (so if it fails or is stopped), and what after it.
struct Step {
  StageOf stage;
  IndexOrder order;  // of the index that the stage builds or reads
  Cached meanwhile, after;
};

// The steps after which the results of the last wanted iteration are held.
std::vector<Step> plan(const Cached& cached, const Wanted& wanted);

// The step after which some index is there, none if there is one.
std::vector<Step> plan_index(const Cached& cached, IndexOrder order);

// What is left of `cached` if a stage that seemed done was given up.
Cached without(Cached cached, StageOf given_up);

}  // namespace pointfair
