// SPDX-License-Identifier: Apache-2.0
#include "tiles/feeders.hpp"

#include <thread>
#include <vector>

namespace pointfair {

void on_feeders(std::size_t feeders, const std::function<void(std::size_t feeder)>& body) {
  std::mutex mutex;
  std::exception_ptr first;
  const auto feed = [&](std::size_t feeder) {
    try {
      body(feeder);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!first) first = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> others;
    for (std::size_t feeder = 1; feeder < feeders; ++feeder) others.emplace_back(feed, feeder);
    feed(0);
  }
  if (first) std::rethrow_exception(first);
}

}  // namespace pointfair
