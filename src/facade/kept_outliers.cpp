// SPDX-License-Identifier: Apache-2.0
#include "estimate/automatic.hpp"
#include "pipeline/learned_run.hpp"
#include "pointfair/outliers.hpp"

namespace pointfair {

bool keeps_outliers(const Params& params) {
  if (params.outliers == Outliers::move) return false;
  return seeks_outliers(of_stages(params));
}

}  // namespace pointfair
