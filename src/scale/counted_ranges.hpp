// SPDX-License-Identifier: Apache-2.0
// Which points were counted: a writer may ask for the same points more than once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

namespace pointfair::scale {

/// [begin, end)
struct Range {
  std::uint64_t begin = 0, end = 0;
  friend bool operator==(const Range&, const Range&) = default;
};

/// Many threads may take at once.
class CountedRanges {
 public:
  /// The parts of the range that nobody took before, in order. From then on they are taken.
  std::vector<Range> take(Range wanted) {
    const std::lock_guard lock(mutex_);
    std::vector<Range> fresh;
    std::uint64_t begin = wanted.begin, all_begin = wanted.begin, all_end = wanted.end;
    auto taken = ends_.upper_bound(wanted.begin);
    if (taken != ends_.begin() && std::prev(taken)->second >= wanted.begin) --taken;
    while (taken != ends_.end() && taken->first <= wanted.end) {
      if (begin < taken->first) fresh.push_back({begin, taken->first});
      begin = std::max(begin, taken->second);
      all_begin = std::min(all_begin, taken->first);
      all_end = std::max(all_end, taken->second);
      taken = ends_.erase(taken);
    }
    if (begin < wanted.end) fresh.push_back({begin, wanted.end});
    if (all_begin < all_end) ends_[all_begin] = all_end;
    return fresh;
  }

 private:
  std::mutex mutex_;
  std::map<std::uint64_t, std::uint64_t> ends_;  // of ranges by their begins; they do not touch
};

}  // namespace pointfair::scale
