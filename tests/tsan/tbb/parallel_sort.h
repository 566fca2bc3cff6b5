// SPDX-License-Identifier: Apache-2.0
// See parallel_for.h beside it.
#pragma once

#include <algorithm>

namespace tbb {

template <class Iterator, class Less>
void parallel_sort(Iterator first, Iterator last, const Less& less) {
  std::sort(first, last, less);
}
template <class Iterator>
void parallel_sort(Iterator first, Iterator last) {
  std::sort(first, last);
}

}  // namespace tbb
