// SPDX-License-Identifier: Apache-2.0
// See parallel_for.h beside it.
#pragma once

#include <tbb/parallel_for.h>

namespace tbb {

template <class First, class Second>
void parallel_invoke(const First& first, const Second& second) {
  parallel_for(std::size_t(0), std::size_t(2), [&](std::size_t which) { which == 0 ? first() : second(); });
}

}  // namespace tbb
