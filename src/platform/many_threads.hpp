// SPDX-License-Identifier: Apache-2.0
// More threads than cores, where a caller asks for them.
#pragma once

#include <tbb/global_control.h>

namespace pointfair::platform {

/// One limit for the whole process: of several, TBB takes the least, and says on standard error what it does not allow.
inline void allow_many_threads() {
  static const auto* const allowed = new tbb::global_control(tbb::global_control::max_allowed_parallelism, 4096);
  static_cast<void>(allowed);  // never taken back: at the end of the process TBB may be gone
}

}  // namespace pointfair::platform
