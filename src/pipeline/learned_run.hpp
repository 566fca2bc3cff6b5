// SPDX-License-Identifier: Apache-2.0
// Method learned: a run of the method bilateral, whose result a net refines.
#pragma once

#include "pointfair/params.hpp"

namespace pointfair {

// What the stages run with.
inline Params of_stages(Params params) {
  if (params.method == Method::learned) params.method = Method::bilateral;
  return params;
}

}  // namespace pointfair
