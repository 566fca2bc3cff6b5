// SPDX-License-Identifier: Apache-2.0
// How long stages took, by the device's clock where it has one.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "seam/backend.hpp"
#include "seam/clock.hpp"

namespace pointfair {

class StageLog {
 public:
  // Of the whole run, in the order of their first; stages of one name add up.
  void note(std::string_view name, double milliseconds) {
    for (StageTime& stage : stages_)
      if (stage.name == name) {
        stage.milliseconds += milliseconds;
        return;
      }
    stages_.push_back({std::string(name), milliseconds});
  }
  // A call of a backend; counts only if the backend has no clock of its own.
  void note_call(std::string_view name, double milliseconds) { calls_.push_back({std::string(name), milliseconds}); }
  // Takes the times of the calls since the last time. Waits for them.
  Costs collect(Backend& backend) {
    Costs costs = backend.take_costs();
    for (const StageTime& stage : costs.stages.empty() ? calls_ : costs.stages) note(stage.name, stage.milliseconds);
    calls_.clear();
    return costs;
  }
  const std::vector<StageTime>& stages() const { return stages_; }

 private:
  std::vector<StageTime> stages_, calls_;
};

}  // namespace pointfair
